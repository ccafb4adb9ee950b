import { expect, test } from '@playwright/test';
import { leavesOf, Model, ticksPerMs } from './monkey/model';
import type { Control } from './monkey/page_log';

// The monkey's model reports each kind of violation, and only violations.

const control = (name: string, more: Partial<Control> = {}): Control => ({ name, region: 'Motion', path: '/axis/one', disabled: false, fields: {}, isJog: false, ...more });
const enabled = 4;

class Bench {
  readonly model = new Model([{ name: 'one', counts: 1000 }], {});
  private ms = 0;
  private turns = 0;
  private jobs = 0;
  private requests = 0;

  constructor() {
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
  job(what: string) {
    this.model.note(0, { kind: 'request', n: ++this.requests, method: 'POST', path: '/axes/one/jobs', body: JSON.stringify({ do: what }) });
    this.model.note(0, { kind: 'answer', n: this.requests, status: 201, body: JSON.stringify({ id: ++this.jobs }) });
    return this.event(what, 'running');
  }

  event(what: string, state: string) {
    this.model.job({ tick: this.ms * ticksPerMs, axis: 'one', job: { id: this.jobs, do: what, state } });
    return this;
  }

  stop() {
    this.press('STOP');
    this.model.note(0, { kind: 'request', n: ++this.requests, method: 'POST', path: '/stop', body: '{}' });
    this.model.note(0, { kind: 'answer', n: this.requests, status: 200, body: '{}' });
    return this;
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
  expect(new Bench().turn(0, 10).turn(5, 20).found).toContain('one turns at 5.0 rpm');
  expect(moved().turn(50, 10).found).toContain('one turns at 50.0 rpm');
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

test('what was asked for before STOP or a halt is over', () => {
  const begun = () => new Bench().press('Move +').job('enable').event('enable', 'done');
  expect(begun().stop().job('move').found).toContain('which nobody asked for');
  expect(begun().press('Halt').job('stop').event('stop', 'done').job('move').found).toContain('which nobody asked for');
  expect(begun().stop().press('Move +').job('enable').event('enable', 'done').job('move').turn(300, 100).found).toBe('');
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
