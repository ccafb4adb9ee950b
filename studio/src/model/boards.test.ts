import { afterEach, beforeEach, describe, expect, test, vi } from 'vitest';
import { basesOf } from './bases';
import { added, fileOf, format, kinds, movedTo, newWidget, problemsOf, readFile, widgets, type Board, type Widget } from './boards';
import { Paced } from './paced';
import { axesOf, parseSequence, Sequence, type JobState, type SequenceDoes } from './sequence';

describe('digits', () => {
  test.each([
    [0x0627, 'UNSIGNED16', '1575', '0627h', '0000 0110 0010 0111'],
    [-1, 'INTEGER8', '-1', 'FFh', '1111 1111'],
    [-2, 'INTEGER32', '-2', 'FFFFFFFEh', '1111 1111 1111 1111 1111 1111 1111 1110'],
    [1, 'BOOLEAN', '1', '1h', '1'],
    [300, '', '300', '012Ch', '0000 0001 0010 1100'],
    [-200, '', '-200', 'FF38h', '1111 1111 0011 1000'],
    [0.125, 'REAL32', '0.125', '', ''],
    [100, 'REAL32', '100', '64h', '0110 0100'],
  ])('%d as %s', (value, type, decimal, hexadecimal, binary) => {
    expect(basesOf(value, type)).toEqual({ decimal, hexadecimal, binary });
  });
});

const all: Board = {
  name: 'all kinds',
  widgets: [
    { kind: 'value', title: '', span: 1, channel: 'x/velocity_rpm', format: 'decimal' },
    { kind: 'plot', title: 'speed', span: 2, channels: ['x/velocity_rpm', 'y/6064:00'], seconds: 10 },
    { kind: 'switch', title: '', span: 1, object: 'x/60FE:01', on: 65536, off: 0 },
    { kind: 'slider', title: '', span: 1, object: 'x/2000:01', minimum: 0, maximum: 100, step: 0.5 },
    { kind: 'button', title: '', span: 1, axis: 'x', do: 'move', by: 1, velocity: 5 },
    { kind: 'script', title: '', span: 2, lines: 'x enable\nx move to 1' },
    { kind: 'watch', title: '', span: 2, channels: ['x/6041:00'] },
    { kind: 'note', title: '', span: 1, text: 'mind the belt' },
  ],
};

describe('a file of dashboards', () => {
  test('is read as it was written, with every kind of widget', () => {
    expect(all.widgets.map(({ kind }) => kind)).toEqual(kinds);
    expect(readFile(fileOf([all]))).toEqual([all]);
  });

  const with0 = (change: Record<string, unknown>) => JSON.stringify({ format, version: 1, boards: [{ name: 'a', widgets: [{ ...all.widgets[3], ...change }] }] });
  test.each([
    ['{', /no JSON/],
    ['[]', /its "format" is not "servodrome-dashboards"/],
    [JSON.stringify({ format, version: 2, boards: [] }), /version 2; this page reads version 1/],
    [JSON.stringify({ format, version: 1 }), /^the dashboards must be a list$/],
    [JSON.stringify({ format, version: 1, boards: [{ name: '', widgets: [] }] }), /^dashboard 1: name must be a name$/],
    [JSON.stringify({ format, version: 1, boards: [{ name: 'a', widgets: [] }, { name: 'a', widgets: 1 }] }), /^dashboard 2 "a": name is there already\ndashboard 2 "a": widgets must be a list$/],
    [with0({ kind: 'robot' }), /^dashboard 1 "a", widget 1: kind must be one of value, plot/],
    [with0({ maximum: -1 }), /^dashboard 1 "a", widget 1: maximum must be above the minimum$/],
    [with0({ step: 'fast' }), /widget 1: step must be a number/],
    [with0({ object: 'x/velocity_rpm' }), /object must be an object of an axis/],
    [with0({ colour: 'red' }), /widget 1: colour is not known/],
    [with0({ span: 9 }), /span must be at most 4/],
    [with0({ title: 7 }), /title must be a text/],
    [JSON.stringify({ format, version: 1, boards: [{ name: 'a', widgets: Array(5).fill(all.widgets[1]) }] }), /^dashboard 1 "a": must have at most 4 plots$/],
    [JSON.stringify({ format, version: 1, boards: [{ name: 'a', widgets: Array(61).fill(all.widgets[0]) }] }), /^dashboard 1 "a": must have at most 60 widgets$/],
  ])('is refused with the place of the mistake: %s', (text, problem) => {
    expect(() => readFile(text)).toThrow(problem);
  });

  test('names a mistake in a script by its line', () => {
    const text = JSON.stringify({ format, version: 1, boards: [{ name: 'a', widgets: [{ ...all.widgets[5], lines: 'x enable\nx fly' }] }] });
    expect(() => readFile(text)).toThrow(/widget 1: lines: line 2: "fly" is no command/);
  });

  test('is added to those that are there', () => {
    const named = (name: string): Board => ({ name, widgets: [] });
    expect(added([named('a'), named('a (2)')], [named('a'), named('b')]).map(({ name }) => name)).toEqual(['a', 'a (2)', 'a (3)', 'b']);
  });
});

test('a new widget lacks only what the user must choose', () => {
  const missing = Object.fromEntries(kinds.map((kind) => [kind, Object.keys(problemsOf(newWidget(kind)))]));
  expect(missing).toEqual({ value: ['channel'], plot: ['channels'], switch: ['object'], slider: ['object'], button: ['axis'], script: ['lines'], watch: ['channels'], note: ['text'] });
  expect(Object.values(widgets).every(({ span }) => span >= 1 && span <= 4)).toBe(true);
});

test('a button needs the numbers of its job', () => {
  const button = (more: Record<string, unknown>): Widget => ({ kind: 'button', title: '', span: 1, axis: 'x', ...more });
  expect(problemsOf(button({ do: 'move' }))).toEqual({ by: 'a move needs either a distance or an end' });
  expect(problemsOf(button({ do: 'move', by: 1, to: 1 }))).toHaveProperty('by');
  expect(problemsOf(button({ do: 'jog' }))).toHaveProperty('velocity');
  expect(problemsOf(button({ do: 'fly' }))).toHaveProperty('do');
  expect(problemsOf(button({ do: 'jog', velocity: -2 }))).toEqual({});
});

test('an element is moved', () => {
  expect(movedTo(['a', 'b', 'c'], 0, 2)).toEqual(['b', 'c', 'a']);
  expect(movedTo(['a', 'b', 'c'], 2, 1)).toEqual(['a', 'c', 'b']);
});

describe('a paced write', () => {
  beforeEach(() => void vi.useFakeTimers());
  afterEach(() => void vi.useRealTimers());

  test('writes at most so often, and the last value always', async () => {
    const written: [number, number][] = [];
    const paced = new Paced(10, { write: (value) => Promise.resolve(written.push([Date.now(), value])), failed: () => expect.unreachable() });
    const begin = Date.now();
    for (let value = 1; value <= 100; ++value) {
      paced.push(value);
      await vi.advanceTimersByTimeAsync(5); // 200 values in a second
    }
    await vi.advanceTimersByTimeAsync(1000);
    expect(written.length).toBeLessThanOrEqual(7);
    expect(written.length).toBeGreaterThan(4);
    expect(written[0]).toEqual([begin, 1]);
    expect(written.at(-1)![1]).toBe(100);
    written.slice(1).forEach(([at], i) => expect(at - written[i][0]).toBeGreaterThanOrEqual(100));
  });

  test('waits for a slow drive, goes on after a refusal, and tells it', async () => {
    let running = 0;
    let most = 0;
    const refused: number[] = [];
    const paced = new Paced(10, {
      write: async (value) => {
        most = Math.max(most, ++running);
        await new Promise((resolve) => setTimeout(resolve, 700));
        --running;
        if (value === 1) throw new Error('too high');
      },
      failed: (_, value) => refused.push(value),
    });
    paced.push(1);
    paced.push(2);
    await vi.advanceTimersByTimeAsync(300);
    paced.push(3);
    await vi.advanceTimersByTimeAsync(3000);
    expect([most, running]).toEqual([1, 0]);
    expect(refused).toEqual([1]);
    paced.push(1);
    await vi.advanceTimersByTimeAsync(3000);
    expect(refused).toEqual([1, 1]);
  });

  test('drops what waits, and writes what comes later', async () => {
    const written: number[] = [];
    const paced = new Paced(10, { write: (value) => Promise.resolve(written.push(value)), failed: () => undefined });
    paced.push(1);
    paced.push(2);
    paced.drop();
    await vi.advanceTimersByTimeAsync(1000);
    expect(written).toEqual([1]);
    paced.push(3);
    await vi.advanceTimersByTimeAsync(1000);
    expect(written).toEqual([1, 3]);
  });

  test.each(['accepts', 'refuses'])('drops what waits for a slow drive, which then %s the value before', async (answer) => {
    const written: number[] = [];
    const refused: number[] = [];
    const paced = new Paced(10, {
      write: async (value) => {
        written.push(value);
        await new Promise((resolve) => setTimeout(resolve, 700));
        if (answer === 'refuses') throw new Error('too high');
      },
      failed: (_, value) => refused.push(value),
    });
    paced.push(1);
    await vi.advanceTimersByTimeAsync(300);
    paced.push(2);
    paced.drop();
    await vi.advanceTimersByTimeAsync(3000);
    expect(written).toEqual([1]);
    expect(refused).toEqual(answer === 'refuses' ? [1] : []);
  });
});

describe('a script', () => {
  test('is jobs, writes and waits in their order', () => {
    const { steps, problems } = parseSequence('# begin\nx enable\nrepeat 2\n  x move by 1 velocity 10  # there\n  wait 0.5\nend\ny set 6083 5000\n');
    expect(problems).toEqual([]);
    expect(steps.map((step) => [step.line, step.kind])).toEqual([[2, 'job'], [4, 'job'], [5, 'wait'], [4, 'job'], [5, 'wait'], [7, 'set']]);
    expect(steps[1]).toMatchObject({ axis: 'x', request: { do: 'move', by: 1, velocity: 10, units: 'revolutions' } });
    expect(steps[5]).toMatchObject({ object: '6083:00', value: 5000 });
    expect(axesOf(steps)).toEqual(['x', 'y']);
    expect(parseSequence('x reset').steps[0]).toMatchObject({ request: { do: 'reset_fault' } });
  });

  test.each([
    ['', 1, 'the script has no step'],
    ['x', 1, 'a command is missing after "x"'],
    ['x fly', 1, '"fly" is no command: use enable, disable, reset, stop, quickstop, home, move, set'],
    ['x constructor', 1, '"constructor" is no command: use enable, disable, reset, stop, quickstop, home, move, set'],
    ['x enable\nx move velocity 1', 2, 'move needs either to or by'],
    ['x move to 1 by 1', 1, 'move needs either to or by'],
    ['x move to', 1, 'a number is missing after "to"'],
    ['x move to 1,5', 1, '"1,5" after "to" is no number'],
    ['x move to 1 speed 2', 1, 'move has no "speed": use to, by, velocity, acceleration, deceleration'],
    ['x move to 1 to 2', 1, '"to" is there twice'],
    ['x enable now', 1, 'enable has no "now"'],
    ['wait -1', 1, 'wait takes 0 to 3600 seconds'],
    ['wait', 1, 'a number is missing after "wait"'],
    ['x set velocity 4', 1, 'set needs an object and a value: set 6083:00 5000'],
    ['x set 6083:00', 1, 'a number is missing after "6083:00"'],
    ['x enable\nx set 6040 15', 2, 'a script cannot set the controlword 6040h: use enable, disable, reset, stop, quickstop'],
    ['x set 6040:00 6', 1, 'a script cannot set the controlword 6040h: use enable, disable, reset, stop, quickstop'],
    ['x set 60FF 5', 1, 'a script cannot set 60FFh, a target or the mode of operation: use move, home'],
    ['x enable\nx set 607a:00 5', 2, 'a script cannot set 607Ah, a target or the mode of operation: use move, home'],
    ['x set 6071 5', 1, 'a script cannot set 6071h, a target or the mode of operation: use move, home'],
    ['x set 6042 5', 1, 'a script cannot set 6042h, a target or the mode of operation: use move, home'],
    ['x set 60B1 5', 1, 'a script cannot set 60B1h, a target or the mode of operation: use move, home'],
    ['x set 60B2 5', 1, 'a script cannot set 60B2h, a target or the mode of operation: use move, home'],
    ['x set 6060 3', 1, 'a script cannot set 6060h, a target or the mode of operation: use move, home'],
    ['repeat 2\nx stop', 1, '"end" is missing for this "repeat"'],
    ['end', 1, '"end" without "repeat"'],
    ['repeat 0\nx stop\nend', 1, 'repeat takes a whole number from 1 on'],
    ['repeat 1e9\nx stop\nend', 3, 'the script has more than 2000 steps'],
  ])('refuses %s', (text, line, problem) => {
    expect(parseSequence(text).problems[0]).toEqual({ line, problem });
  });

  interface Log {
    log: string[];
    does: SequenceDoes;
  }
  function recorder(change: Partial<SequenceDoes> = {}): Log {
    const log: string[] = [];
    let id = 0;
    const does: SequenceDoes = {
      start: (axis, request) => {
        log.push(`${axis} ${request.do}${'after' in request ? ` after ${String(request.after)}` : ''}`);
        return Promise.resolve({ id: ++id, state: 'running' });
      },
      finish: (job) => Promise.resolve({ ...job, state: 'done' }),
      cancel: (job) => Promise.resolve(log.push(`cancel ${job.id}`)),
      write: (axis, object, value) => Promise.resolve(log.push(`${axis} ${object} = ${value}`)),
      latest: () => id,
      sleep: () => Promise.resolve(),
      at: () => undefined,
      ...change,
    };
    return { log, does };
  }
  const stepsOf = (text: string) => parseSequence(text).steps;

  test('halts its axes first, and each job continues the one before', async () => {
    const { log, does } = recorder();
    // Each axis has its own latest job.
    does.latest = (axis) => ({ x: 5, y: 4 })[axis];
    await new Sequence(stepsOf('x enable\ny enable\nx move by 1\ny set 6083 7'), does).run();
    expect(log).toEqual(['x stop', 'y stop', 'x enable after 1', 'y enable after 2', 'x move after 3', 'y 6083:00 = 7']);
  });

  test('sends the first halts of all axes together', async () => {
    let answer: () => void = () => undefined;
    const answered = new Promise<void>((resolve) => (answer = resolve));
    const { log, does } = recorder({ finish: (job) => answered.then(() => ({ ...job, state: 'done' })) });
    const ended = new Sequence(stepsOf('x enable\ny enable\nz enable'), does).run();
    await vi.waitFor(() => expect(log).toEqual(['x stop', 'y stop', 'z stop']));
    answer();
    await ended;
    expect(log).toEqual(['x stop', 'y stop', 'z stop', 'x enable after 1', 'y enable after 2', 'z enable after 3']);
  });

  test('ends before a write if another client has commanded the axis', async () => {
    let latest = 0;
    const { log, does } = recorder({ latest: () => latest, sleep: () => Promise.resolve(void (latest = 7)) });
    await expect(new Sequence(stepsOf('x enable\nx set 6083 1\nwait 1\nx set 6083 2'), does).run()).rejects.toThrow('another command to the axis came first');
    expect(log).toEqual(['x stop', 'x enable after 1', 'x 6083:00 = 1']);
  });

  test('ends at a job that fails, with its reason', async () => {
    const { log, does } = recorder({ finish: (job) => Promise.resolve(job.id === 2 ? { ...job, state: 'failed', error: { what: 'following error' } } : { ...job, state: 'done' }) });
    await expect(new Sequence(stepsOf('x enable\nx move by 1'), does).run()).rejects.toThrow('following error');
    expect(log).toEqual(['x stop', 'x enable after 1']);
  });

  test('ends when the server refuses, as after a stop of another page', async () => {
    const { does } = recorder({ start: (_, request) => (request.do === 'move' ? Promise.reject(new Error('job 2 is not the last command')) : Promise.resolve({ id: 1, state: 'running' })) });
    await expect(new Sequence(stepsOf('x enable\nx move by 1\nx disable'), does).run()).rejects.toThrow('not the last command');
  });

  test('ends before a move that the travel does not permit, with the reason', async () => {
    const { log, does } = recorder({ hindrance: (_, { by }) => Promise.resolve(by === 30 ? 'longer than the travel' : '') });
    await expect(new Sequence(stepsOf('x move by 1\nx move by 30'), does).run()).rejects.toThrow('longer than the travel');
    expect(log).toEqual(['x stop', 'x move after 1']);
  });

  test('that is stopped while the travel is asked begins no move', async () => {
    let answer: (reason: string) => void = () => undefined;
    const { log, does } = recorder({ hindrance: () => new Promise((resolve) => (answer = resolve)) });
    const sequence = new Sequence(stepsOf('x move by 1'), does);
    const ended = sequence.run();
    await new Promise((resolve) => setTimeout(resolve));
    sequence.stop();
    answer('');
    await expect(ended).rejects.toThrow('stopped');
    expect(log).toEqual(['x stop']);
  });

  test('that is stopped ends its job and begins no other', async () => {
    let finish: (job: JobState) => void = () => undefined;
    const { log, does } = recorder({ finish: (job) => (job.id === 2 ? new Promise((resolve) => (finish = resolve)) : Promise.resolve({ ...job, state: 'done' })) });
    const sequence = new Sequence(stepsOf('x move by 1\nx move by -1'), does);
    const ended = sequence.run();
    await vi.waitFor(() => expect(log).toContain('x move after 1'));
    sequence.stop();
    finish({ id: 2, state: 'cancelled' });
    await expect(ended).rejects.toThrow('stopped');
    expect(log).toEqual(['x stop', 'x move after 1', 'cancel 2']);
  });

  test('that is stopped while the server begins a job ends that job too', async () => {
    let begin: (job: JobState) => void = () => undefined;
    const { log, does } = recorder({ start: (_, request) => (request.do === 'move' ? new Promise((resolve) => (begin = resolve)) : Promise.resolve({ id: 1, state: 'running' })) });
    const sequence = new Sequence(stepsOf('x move by 1'), does);
    const ended = sequence.run();
    await new Promise((resolve) => setTimeout(resolve));
    sequence.stop();
    begin({ id: 9, state: 'running' });
    await expect(ended).rejects.toThrow('stopped');
    expect(log).toContain('cancel 9');
  });
});
