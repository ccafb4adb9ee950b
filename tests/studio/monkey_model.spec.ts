import { expect, test } from '@playwright/test';
import { leavesOf, Model, ticksPerMs, type Widgets } from './monkey/model';
import type { Control } from './monkey/page_log';

// The monkey's model reports each kind of violation, and only violations.

const control = (name: string, more: Partial<Control> = {}): Control => ({ name, region: 'Motion', path: '/axis/one', disabled: false, fields: {}, isJog: false, ...more });
const enabled = 4;

class Bench {
  readonly model: Model;
  private ms = 0;
  private turns = 0;
  private jobs = 0;
  private requests = 0;

  constructor(widgets: Widgets = {}) {
    this.model = new Model([{ name: 'one', counts: 1000 }], widgets);
    this.model.begin();
  }

  // The shaft turns at `rpm` for so long.
  turn(rpm: number, ms: number) {
    const values = Array.from({ length: ms }, () => ((this.turns += rpm / 60_000), 1000 * this.turns));
    const tick = (this.ms + 1) * ticksPerMs;
    this.ms += ms;
    this.model.take_samples({ tick, stride: ticksPerMs, channels: [values.map(() => rpm), values.map(() => enabled), values].map((each) => Float64Array.from(each)) });
    this.model.judge();
    return this;
  }

  press(name: string, more?: Partial<Control>) {
    this.model.note(0, { kind: 'press', control: control(name, more) });
    return this;
  }

  // The page begins a job, and the line reports it.
  job(what: string, after?: number) {
    this.request(what, after);
    this.model.note(0, { kind: 'answer', n: this.requests, status: 201, body: JSON.stringify({ id: ++this.jobs }) });
    return this.event(what, 'running');
  }

  event(what: string, state: string) {
    this.model.job({ tick: this.ms * ticksPerMs, axis: 'one', job: { id: this.jobs, do: what, state } });
    return this;
  }

  request(what: string, after?: number) {
    this.model.note(0, { kind: 'request', n: ++this.requests, method: 'POST', path: '/axes/one/jobs', body: JSON.stringify({ do: what, after }) });
    return this;
  }

  refused() {
    this.model.note(0, { kind: 'answer', n: this.requests, status: 409, body: '{}' });
    return this;
  }

  // STOP takes the page's last request back. The server has begun the job.
  stopBefore(what: string) {
    const n = this.requests;
    this.stop().model.note(0, { kind: 'answer', n, status: 0, body: '' });
    ++this.jobs;
    return this.event(what, 'running');
  }

  stop() {
    this.press('STOP');
    this.model.note(0, { kind: 'request', n: ++this.requests, method: 'POST', path: '/stop', body: '{}' });
    this.model.note(0, { kind: 'answer', n: this.requests, status: 200, body: '{}' });
    return this;
  }

  reload() {
    this.model.note(0, { kind: 'loaded' });
    return this;
  }

  // The line reports a job, and no page has reported its request.
  unreported(what: string) {
    ++this.jobs;
    return this.event(what, 'running');
  }

  get found() {
    return this.model.violations.join('\n');
  }
}

const moved = () => new Bench().turn(0, 10).press('Move +').job('enable').event('enable', 'done').job('move').turn(300, 200).event('move', 'done').turn(0, 500);

test('a motion that was asked for is none of its findings', () => {
  expect(moved().found).toBe('');
});

test('a shaft that turns, or creeps, without a command is found', () => {
  expect(new Bench().turn(0, 10).turn(20, 20).found).toContain('one turns at 20.0 rpm');
  expect(new Bench().turn(0, 10).turn(5, 200).found).toContain('one has crept by');
  expect(moved().turn(50, 1).found).toContain('one turns at 50.0 rpm');
  expect(moved().turn(7, 8).turn(0, 10).turn(7, 8).found).toBe('');
  expect(moved().turn(2, 1000).found).toContain('one has crept');
});

test('a job that nobody asked for, or twice, is found', () => {
  expect(new Bench().job('move').found).toContain('which nobody asked for');
  expect(new Bench().press('Halt').job('enable').found).toContain('which nobody asked for');
  expect(moved().job('move').found).toContain('which nobody asked for');
});

test('a shaft has the time of its ramp after STOP, and no more', () => {
  const run = () => new Bench().press('Run').job('enable').event('enable', 'done').job('velocity').event('velocity', 'done').turn(300, 100).stop();
  expect(run().turn(150, 300).turn(0, 500).found).toBe('');
  expect(run().turn(300, 600).found).toContain('was to be at rest');
  expect(run().turn(500, 20).found).toContain('speeds up');
});

test('a shaft stops from the speed that it has when STOP is pressed, which is known later', () => {
  const run = () => {
    const bench = new Bench().press('Run').job('enable').event('enable', 'done').job('velocity').event('velocity', 'done').turn(100, 100);
    bench.model.now = 110 * ticksPerMs;
    return bench.stop();
  };
  expect(run().turn(400, 10).turn(390, 300).turn(0, 500).found).toBe('');
  expect(run().turn(400, 20).found).toBe('');
  expect(run().turn(100, 10).turn(400, 10).found).toContain('speeds up');
});

test('what was asked for before STOP or a halt is over', () => {
  const begun = () => new Bench().press('Move +').job('enable').event('enable', 'done');
  expect(begun().stop().job('move').found).toContain('which nobody asked for');
  expect(begun().press('Halt').job('stop').event('stop', 'done').job('move').found).toContain('which nobody asked for');
  expect(begun().stop().press('Move +').job('enable').event('enable', 'done').job('move').turn(300, 100).found).toBe('');
});

test('a job that STOP takes back may begin, and may not move the axis', () => {
  const late = () => new Bench().press('Move +').job('enable').event('enable', 'done').request('move').stopBefore('move');
  expect(late().turn(0, 300).found).toBe('');
  expect(late().turn(50, 300).found).toContain('one turns at 50.0 rpm');
});

test('a job that follows another belongs to its press, not to a later one that the server refuses', () => {
  const run = () => {
    const bench = new Bench().press('There and back').job('enable').press('Enable').request('enable').refused();
    return bench.job('move', 1).job('move', 2);
  };
  expect(run().found).toBe('');
  expect(run().job('move', 3).found).toContain('which nobody asked for');
  // The move of the first press is refused after the enabling of the second, and uses up nothing of the second.
  const twice = new Bench().press('Move +').job('enable').press('Move +').job('enable').request('move', 1).refused();
  expect(twice.job('move', 2).found).toBe('');
});

test('a script ends when its dashboard is left, and the first dashboard has two addresses', () => {
  const script = (left: string) => {
    const bench = new Bench({ Script: [{ axis: 'one', wants: { enable: 1 } }] }).press('Run', { region: 'Script', path: '/boards' });
    bench.model.leave(0, left);
    return bench.job('enable').found;
  };
  expect(script('/boards?name=Monkey')).toBe('');
  expect(script('/boards?rec=1&plot=bode')).toBe('');
  expect(script('/boards?name=Other')).toContain('which nobody asked for');
  expect(script('/bus')).toContain('which nobody asked for');
});

test('a document that is left may have sent what its press asked for, and nothing else', () => {
  const begun = () => new Bench().press('Move +').job('enable').event('enable', 'done');
  expect(begun().reload().unreported('move').turn(300, 200).event('move', 'done').turn(0, 500).found).toBe('');
  expect(begun().reload().unreported('move').unreported('move').turn(0, 10).found).toContain('no page has sent it');
  expect(begun().reload().job('move').found).toContain('which nobody asked for');
  expect(begun().stop().reload().unreported('move').turn(0, 10).found).toContain('no page has sent it');
  expect(begun().unreported('move').turn(0, 10).found).toContain('no page has sent it');
});

test('a press of STOP without its request is found', () => {
  expect(new Bench().press('STOP').turn(0, 10).found).toContain('the page sent no stop');
});

test('it knows which controls ask for motion', () => {
  expect(leavesOf(control('Home'), ['one'], {})).toMatchObject([{ axis: 'one', wants: { enable: 1, home: 1 } }]);
  expect(leavesOf(control('Home', { disabled: true }), ['one'], {})).toEqual([]);
  expect(leavesOf(control('Enable all', { path: '/' }), ['one', 'two'], {})).toHaveLength(2);
  expect(leavesOf(control('Sweep and record', { path: '/scope', fields: { 'Axis to excite': 'two' } }), ['one', 'two'], {})).toMatchObject([{ axis: 'two', wants: { enable: 1, sweep: 1 } }]);
});
