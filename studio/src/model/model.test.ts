import { describe, expect, test, vi } from 'vitest';
import type { Geometry, Limits, ObjectEntry, Recording, Units, Words } from '../api/types';
import { controlBits, edges, modeText, statusBits, toneOf } from './cia402';
import { Jog } from './jog';
import { LiveBuffer } from './live_buffer';
import { differs, hexValue, inGroup, matches, namedOf, parseValue, rankOf, showValue } from './objects';
import { alongside, axisOf, channelOf, fileNameOf, objectOf, ofAxis, queryOf, samplesOf, setupOf, span, textOfChannel, without, zoomed } from './scope';
import { indexes, travelScale } from './travel';
import { decadeTicks, duration, fixed, fromDrivePosition, greatestOf, isLabelled, proposed, significant, ticksText, toDriveAcceleration, toDrivePosition, toDriveVelocity, holdsOf } from './units';

describe('units', () => {
  const units: Units = { position_per_revolution: 131072, velocity_per_rps: 131072, acceleration_per_rps2: 10 };
  test('are the drive’s', () => {
    expect(toDrivePosition(units, 1.5)).toBe(196608);
    expect(toDriveVelocity(units, 60)).toBe(131072);
    expect(toDriveAcceleration(units, 2.04)).toBe(20);
    expect(fromDrivePosition(units, -65536)).toBe(-0.5);
  });
  test('are none where the drive does not tell them', () => {
    expect(toDrivePosition({ ...units, position_per_revolution: null }, 1)).toBeNull();
    expect(fromDrivePosition(undefined, 1)).toBeNull();
  });
  test('stand at 1 to 9 times each power of ten on a logarithmic axis, with numbers where there is room', () => {
    expect(decadeTicks(13.3, 110)).toEqual([20, 30, 40, 50, 60, 70, 80, 90, 100]);
    expect(decadeTicks(0.08, 0.2)).toEqual([0.08, 0.09, 0.1, 0.2]);
    const labelled = (pixels: number) => decadeTicks(1, 1000).filter((tick) => isLabelled(tick, pixels));
    expect(labelled(200)).toEqual([1, 2, 5, 10, 20, 50, 100, 200, 500, 1000]);
    expect(labelled(100)).toEqual([1, 10, 100, 1000]);
  });
  test('are printed with as many places as they have', () => {
    expect(fixed(-1234567.891, 2)).toBe('\u22121\u2009234\u2009567.89');
    expect(fixed(-0.0001, 2)).toBe('0.00');
    expect(fixed(undefined, 1)).toBe('–');
    expect([fixed(1e30, 0), fixed(-3.3333333333333336e27, 2), fixed(1e15, 0)]).toEqual(['1e30', '\u22123.3333e27', '1e15']);
    expect([0.00123456, 12.3456, 123456.7, 42].map(significant)).toEqual(['0.001235', '12.346', '123\u2009457', '42']);
    expect(ticksText([25, 25.0005, 25.001, null])).toEqual(['25.0000', '25.0005', '25.0010', '']);
    expect(ticksText([-100000, 0, 100000])).toEqual(['\u2212100\u2009000', '0', '100\u2009000']);
    expect(ticksText([0, 0.25, 0.5])).toEqual(['0.00', '0.25', '0.50']);
    expect(ticksText([1, null, 10, 100])).toEqual(['1', '', '10', '100']);
    expect(duration(3_725_500_000_000)).toBe('1:02:05.5');
  });
});

describe('CiA 402', () => {
  test('statusword 0237h is operation enabled', () => {
    expect(statusBits(0x0237, 1).filter(({ on }) => on).map(({ bit }) => bit)).toEqual([0, 1, 2, 4, 5, 9]);
  });
  const words: Words = {
    modes: { '-4': 'pulse', 6: 'homing' },
    statusword: [{ bit: 12, name: 'homing error', mode: 6 }, { bit: 12, name: 'set-point acknowledge', mode: 1 }, { bit: 13, name: 'following error' }],
  };
  test('bits have the names of the product, and those of their mode', () => {
    expect([1, 6, 3].map((mode) => statusBits(0, mode, words)[12].name)).toEqual(['set-point acknowledge', 'homing error', 'mode-specific']);
    expect([13, 14].map((bit) => statusBits(0, 1, words)[bit].name)).toEqual(['following error', 'manufacturer-specific']);
    expect(controlBits(0x5f, 1).filter(({ on }) => on).map(({ name }) => name).slice(-2)).toEqual(['new set-point', 'relative']);
  });
  test('has sixteen transitions and the start, each once', () => {
    expect(edges.map(({ number }) => number)).toEqual(Array.from({ length: 17 }, (_, i) => i));
  });
  test('modes and tones have names', () => {
    expect([modeText(6, words), modeText(-4, words), modeText(-3, words), modeText(99, words)]).toEqual(['homing', 'pulse', 'manufacturer-specific mode −3', 'mode 99']);
    expect([toneOf('fault'), toneOf('operation enabled'), toneOf(undefined)]).toEqual(['bad', 'live', 'quiet']);
  });
});

describe('limits of the drive', () => {
  const units: Units = { position_per_revolution: 4000, velocity_per_rps: 4000, acceleration_per_rps2: 4000 };
  test('bound the proposed numbers', () => {
    const limits: Limits = { velocity: 14400, acceleration: 100000, deceleration: null, lowest_position: null, highest_position: null, wraps_within: null };
    const { velocity, acceleration } = greatestOf(units, limits);
    expect([velocity, acceleration]).toEqual([216, 25]);
    expect([proposed(300, velocity), proposed(50, acceleration), proposed(120, velocity)]).toEqual([210, 25, 120]);
    expect(proposed(300, greatestOf(units, undefined).velocity)).toBe(300);
    expect(proposed(300, 0.0123)).toBe(0.012);
  });
});

describe('travel', () => {
  const geometry: Geometry = {
    negative_stop: -1100, positive_stop: 1100, negative_limit: -1000, positive_limit: 1000, home_from: null, home_to: null, index_every: 100, index_at: 25,
  };
  test('shows all of it, and clips what is outside', () => {
    const scale = travelScale(geometry, 0);
    expect(scale.at(0)).toBeCloseTo(0.5);
    expect(scale.at(-1100)).toBeCloseTo(0.04 / 1.08);
    expect(scale.at(1e9)).toBe(1);
  });
  test('of an axis that turns is the present revolution', () => {
    const turning = { ...geometry, negative_stop: null, positive_stop: null, negative_limit: null, positive_limit: null };
    expect(travelScale(turning, 250)).toMatchObject({ from: 196, to: 304 });
    expect(travelScale(turning, -1)).toMatchObject({ from: -104, to: 4 });
  });
  test('has its indexes, as long as they can be told apart', () => {
    const marks = indexes(geometry, travelScale(geometry, 0));
    expect(marks[0]).toBe(-1175);
    expect(marks).toContain(25);
    expect(marks).toHaveLength(24);
    expect(indexes({ ...geometry, index_every: 10 }, travelScale(geometry, 0))).toEqual([]);
  });
});

describe('live buffer', () => {
  const frame = (tick: number, stride: number, values: number[]) => ({ id: 1, tick, stride, channels: [Float64Array.from(values)] });
  test('keeps the last seconds, whatever the stride', () => {
    const buffer = new LiveBuffer(1, 1000, 0.01);
    for (let i = 0; i < 200; ++i) buffer.append(frame(i * 160, i % 2 ? 32 : 16, Array.from({ length: i % 2 ? 5 : 10 }, () => i)));
    const { x, values: [values] } = buffer.view();
    expect(x.at(-1)).toBe(0);
    expect(x[0]).toBeGreaterThanOrEqual(-0.01);
    expect([...x]).toEqual([...x].sort((a, b) => a - b));
    expect(values.at(-1)).toBe(199);
  });
  test('begins anew when the server did', () => {
    const buffer = new LiveBuffer(1, 1000, 10);
    buffer.append(frame(1_000_000, 16, [1, 2, 3]));
    buffer.append(frame(16, 16, [4]));
    expect([...buffer.view().values[0]]).toEqual([4]);
  });
});

describe('jog', () => {
  const later = (ms: number) => new Promise((resolve) => setTimeout(resolve, ms));
  const does = (start: () => Promise<number>) => ({ start: vi.fn(start), alive: vi.fn(() => Promise.resolve(true)), stop: vi.fn(() => Promise.resolve()), failed: vi.fn() });

  test('lives while it is pressed and stops once', async () => {
    vi.useFakeTimers();
    const calls = does(() => Promise.resolve(5));
    const jog = new Jog(calls);
    jog.press();
    jog.press();
    await vi.advanceTimersByTimeAsync(1000);
    expect(calls.start).toHaveBeenCalledOnce();
    expect(calls.alive.mock.calls.length).toBeGreaterThanOrEqual(3);
    expect(calls.stop).not.toHaveBeenCalled();
    jog.release();
    await vi.advanceTimersByTimeAsync(100);
    expect(calls.stop).toHaveBeenCalledExactlyOnceWith(5);
    vi.useRealTimers();
  });
  test('released before the server has answered, it stops as soon as it has', async () => {
    vi.useFakeTimers();
    const calls = does(async () => { await later(300); return 6; });
    const jog = new Jog(calls);
    jog.press();
    jog.release();
    await vi.advanceTimersByTimeAsync(400);
    expect(calls.stop).toHaveBeenCalledExactlyOnceWith(6);
    expect(calls.alive).not.toHaveBeenCalled();
    vi.useRealTimers();
  });
  test('a release takes the start back', async () => {
    const calls = { ...does(() => Promise.resolve(0)), start: vi.fn((released: AbortSignal) => new Promise<number>((_, reject) => released.addEventListener('abort', () => reject(new Error('taken back'))))) };
    const jog = new Jog(calls);
    jog.press();
    jog.release();
    await later(0);
    expect(calls.failed).not.toHaveBeenCalled();
    expect(calls.stop).not.toHaveBeenCalled();
    jog.press();
    expect(calls.start).toHaveBeenCalledTimes(2);
    jog.release();
  });
  test('the release does not wait for a sign of life that is on its way', async () => {
    vi.useFakeTimers();
    const calls = { ...does(() => Promise.resolve(7)), alive: vi.fn(() => new Promise<boolean>(() => undefined)) };
    const jog = new Jog(calls);
    jog.press();
    await vi.advanceTimersByTimeAsync(1000);
    expect(calls.alive).toHaveBeenCalledOnce();
    expect(calls.stop).not.toHaveBeenCalled();
    jog.release();
    await vi.advanceTimersByTimeAsync(20);
    expect(calls.stop).toHaveBeenCalledExactlyOnceWith(7);
    vi.useRealTimers();
  });
  test('a jog that the server has ended asks no more, until it is pressed again', async () => {
    vi.useFakeTimers();
    const calls = { ...does(() => Promise.resolve(9)), alive: vi.fn(() => Promise.resolve(false)) };
    const jog = new Jog(calls);
    jog.press();
    await vi.advanceTimersByTimeAsync(1000);
    expect(calls.alive).toHaveBeenCalledOnce();
    expect(calls.failed).not.toHaveBeenCalled();
    jog.press();
    await vi.advanceTimersByTimeAsync(20);
    expect(calls.start).toHaveBeenCalledTimes(2);
    jog.release();
    await vi.advanceTimersByTimeAsync(100);
    vi.useRealTimers();
  });
  test('a refused sign of life ends the jog', async () => {
    vi.useFakeTimers();
    const calls = { ...does(() => Promise.resolve(8)), alive: vi.fn(() => Promise.reject(new Error('over'))) };
    const jog = new Jog(calls);
    jog.press();
    await vi.advanceTimersByTimeAsync(300);
    expect(calls.failed).toHaveBeenCalledOnce();
    expect(calls.stop).toHaveBeenCalledExactlyOnceWith(8);
    vi.useRealTimers();
  });
  test('a refused start is told, and the next press tries again', async () => {
    const calls = does(() => Promise.reject(new Error('busy')));
    const jog = new Jog(calls);
    jog.press();
    await later(0);
    expect(calls.failed).toHaveBeenCalledOnce();
    expect(calls.stop).not.toHaveBeenCalled();
    jog.press();
    await later(0);
    expect(calls.start).toHaveBeenCalledTimes(2);
  });
});

describe('objects', () => {
  const entry: ObjectEntry = { index: '0x6081', sub: 0, name: 'Profile velocity', type: 'UNSIGNED32', access: 'rw', unit: 'inc/s', pdo: 'rx', saved: true, default: 1000 };
  test('are found by any of their words', () => {
    for (const search of ['6081', '6081h', '0x6081', '0X6081', '6081:00', '0x6081:00', 'profile VEL', 'inc/s 6081:00', '']) expect(matches(entry, search), search).toBe(true);
    expect(matches(entry, 'torque')).toBe(false);
  });
  test('whose name is searched come first', () => {
    const position = { ...entry, index: '0x6064', name: 'Position actual value' };
    const named = { ...entry, index: '0x607A', name: 'Target position' };
    const explained = { ...entry, index: '0x2000', name: 'Gain', text: 'of the position loop' };
    const addressed = { ...entry, index: '0x6065' };
    const found = (search: string) => [explained, named, position, addressed].filter((each) => matches(each, search)).sort((a, b) => rankOf(a, search) - rankOf(b, search)).map(({ index }) => index);
    expect(found('position')).toEqual(['0x6064', '0x607A', '0x2000']);
    expect(found('6065h')).toEqual(['0x6065']);
    expect(found('0x6065')).toEqual(['0x6065']);
  });
  test('show CAN identifiers in hexadecimal, other numbers in decimal', () => {
    expect(showValue(0x40000181, { ...entry, name: 'COB-ID used by TPDO 1' })).toBe('40000181h');
    expect([showValue(385, entry), showValue(385)]).toEqual(['385', '385']);
  });
  test('are changed when they differ from their default', () => {
    expect([differs(entry, 1001), differs(entry, 1000), differs(entry, undefined), differs({ ...entry, access: 'ro' }, 5)]).toEqual([true, false, false, false]);
    expect(inGroup(entry, 'CiA 402', () => false)).toBe(true);
    expect(inGroup(entry, 'Changed', () => true)).toBe(true);
    expect(inGroup(entry, 'Manufacturer-specific', () => true)).toBe(false);
  });
  test('take decimal and hexadecimal', () => {
    expect(['12', '0x1F', '1Fh', '\u22125', ' 7 '].map((typed) => parseValue({ ...entry, type: 'INTEGER32' }, typed))).toEqual([12, 31, 31, -5, 7].map((value) => ({ value })));
    expect(parseValue({ ...entry, type: 'REAL32' }, '1.5')).toEqual({ value: 1.5 });
    expect(parseValue({ ...entry, type: 'VISIBLE_STRING' }, '1F')).toEqual({ value: '1F' });
    expect(['4294967295', '0xFFFFFFFF'].map((typed) => parseValue(entry, typed))).toEqual([{ value: 4294967295 }, { value: 4294967295 }]);
  });
  test.each([
    ['UNSIGNED32', '', 'Enter a number.'],
    ['UNSIGNED32', 'abc', 'Not a number: enter for example 12, 0x1F or 1Fh.'],
    ['UNSIGNED32', '1,5', 'The decimal separator is a point: 1.5.'],
    ['REAL32', '1,5', 'The decimal separator is a point: 1.5.'],
    ['UNSIGNED32', '12.5', 'UNSIGNED32 is a whole number.'],
    ['UNSIGNED32', '99999999999999999999', 'Too high: UNSIGNED32 is at most 4294967295.'],
    ['UNSIGNED32', '0x100000000', 'Too high: UNSIGNED32 is at most 4294967295.'],
    ['UNSIGNED8', '-1', 'Too low: UNSIGNED8 is at least 0.'],
    ['INTEGER16', '-32769', 'Too low: INTEGER16 is at least -32768.'],
    ['INTEGER8', '128', 'Too high: INTEGER8 is at most 127.'],
    ['REAL64', '1e999', 'Too high for REAL64.'],
  ])('of %s: "%s" is refused with the reason', (type, typed, problem) => expect(parseValue({ ...entry, type }, typed)).toEqual({ problem }));
  test('show numbers of 32 bits in hexadecimal', () => {
    expect(hexValue(entry, 255)).toBe('000000FFh');
  });
  test('have names for bits and values', () => {
    expect(namedOf({ 0: 'a', 3: 'b' })).toEqual([{ value: 0, name: 'a' }, { value: 3, name: 'b' }]);
    expect(namedOf([{ bit: 4, name: 'x' }, { value: -1, name: 'y' }])).toEqual([{ value: 4, name: 'x' }, { value: -1, name: 'y' }]);
    expect(namedOf(undefined)).toEqual([]);
  });
});

describe('scope', () => {
  test('its setup lives in the address', () => {
    const setup = setupOf(new URLSearchParams('ch=a/torque_nm,b/6064:0&rate=16000&ms=500&pre=50&trigger=edge&tch=1&level=-2.5&slope=falling'), 'a');
    expect(setup.channels).toEqual([{ axis: 'a', signal: 'torque_nm' }, { axis: 'b', object: '6064:0' }]);
    expect(setup.trigger).toEqual({ kind: 'edge', channel: 1, level: -2.5, slope: 'falling' });
    const query = new URLSearchParams(Object.entries(queryOf(setup)).filter((pair): pair is [string, string] => pair[1] !== null));
    expect(setupOf(query, 'a')).toEqual(setup);
  });
  test('any state and any axis trigger, and come back from the address', () => {
    for (const trigger of ['trigger=state&taxis=b&tstate=*', 'trigger=fault&taxis=*']) {
      const setup = setupOf(new URLSearchParams(trigger), 'a');
      expect(setup.trigger).toEqual(trigger.includes('state') ? { kind: 'state', axis: 'b' } : { kind: 'fault' });
      const query = new URLSearchParams(Object.entries(queryOf(setup)).filter((pair): pair is [string, string] => pair[1] !== null));
      expect(setupOf(query, 'a')).toEqual(setup);
    }
  });
  test('the trigger stays with its channel when another goes', () => {
    const setup = setupOf(new URLSearchParams('ch=a/torque_nm,a/current_a,a/supply_v&trigger=edge&tch=2&level=1'), 'a');
    expect(without(setup, 0)).toMatchObject({ channels: [{ signal: 'current_a' }, { signal: 'supply_v' }], trigger: { channel: 1 } });
    expect(without(setup, 2)).toMatchObject({ channels: [{ signal: 'torque_nm' }, { signal: 'current_a' }], trigger: { channel: 0 } });
  });
  test('moves to another axis with its signals and trigger, and leaves out manufacturer-specific objects', () => {
    const setup = setupOf(new URLSearchParams('ch=a/torque_nm,a/2010:01,a/6064:00,b/torque_nm,b/supply_v&trigger=edge&tch=2&level=1'), 'a');
    expect(ofAxis(setup, 'b')).toMatchObject({
      channels: [{ axis: 'b', signal: 'torque_nm' }, { axis: 'b', object: '6064:00' }, { axis: 'b', signal: 'supply_v' }],
      trigger: { kind: 'edge', channel: 1, level: 1 },
    });
    const state = setupOf(new URLSearchParams('ch=a/2010:01&trigger=state&taxis=a'), 'a');
    expect(ofAxis(state, 'b')).toMatchObject({ channels: [{ axis: 'b', signal: 'position_counts' }], trigger: { axis: 'b' } });
    // The new axis is that of the first channel, and the trigger stays with its channel.
    const others = ofAxis(setupOf(new URLSearchParams('ch=a/2010:01,c/torque_nm&trigger=edge&tch=1'), 'a'), 'b');
    expect(axisOf(others)).toBe('b');
    expect(others).toMatchObject({ channels: [{ axis: 'b' }, { axis: 'c', signal: 'torque_nm' }], trigger: { channel: 1 } });
  });
  test('an address is an object with and without its marks', () => {
    expect(['6064', '6064h', '0x6064', '6064:00', ' 6064:0 '].map(objectOf)).toEqual(Array(5).fill('6064:00'));
    expect(['60FE:1', '60feh:01'].map(objectOf)).toEqual(['60FE:01', '60FE:01']);
    expect(['velocity_rpm', '606', '60644', 'DI0'].map(objectOf)).toEqual([null, null, null, null]);
  });
  test('zooms about the middle, within what there is', () => {
    const x = Float64Array.from({ length: 101 }, (_, i) => i);
    expect(zoomed(x, null, 0.5)).toEqual([25, 75]);
    expect(zoomed(x, [25, 75], 2)).toBeNull();
    expect(zoomed(x, [0, 50], 1, 0.5)).toEqual([25, 75]);
    expect(zoomed(x, [60, 100], 1, 0.5)).toEqual([60, 100]);
    expect(zoomed(x, null, 1, 0.5)).toBeNull();
    expect(zoomed(new Float64Array(1), null, 0.5)).toBeNull();
  });
  test('what makes no sense in the address is the default', () => {
    const setup = setupOf(new URLSearchParams('ch=,nonsense&rate=x&trigger=never'), 'a');
    expect(setup).toMatchObject({ rate_hz: 1000, trigger: { kind: 'now' } });
    expect(setup.channels.map(textOfChannel)).toEqual(['a/position_counts', 'a/velocity_rpm']);
    expect(channelOf('/x')).toBeNull();
  });
  const recording = (trigger_tick: number): Recording => ({ id: 1, name: '', state: 'done', rate_hz: 1000, trigger_tick, first_tick: 1600, samples: 5, channels: [] });
  test('zero is the trigger', () => {
    const { x } = samplesOf(recording(1632), { id: 1, stride: 16, tick: 1600, channels: [new Float64Array(5)] });
    expect([...x]).toEqual([-2, -1, 0, 1, 2]);
    expect(span(x, 1, -1)).toEqual([1, 4]);
    expect(span(x, 10, 20)).toEqual([5, 5]);
  });
  test('an earlier recording is laid over by its trigger, whatever its rate', () => {
    const main = samplesOf(recording(1632), { id: 1, stride: 16, tick: 1600, channels: [new Float64Array(5)] });
    const other = samplesOf(recording(1600), { id: 2, stride: 32, tick: 1600, channels: [Float64Array.of(0, 20)] });
    expect([...alongside(main.x, other, other.values[0])]).toEqual([NaN, NaN, 0, 10, 20]);
  });
});

test('the numbers that the objects of a motion can hold, in the units of the form', () => {
  const holds = holdsOf({ position_per_revolution: 131072, velocity_per_rps: 131072, acceleration_per_rps2: 131072 });
  expect(holds).toEqual({ position: 16383, speed: 1966079, velocity: 983039, acceleration: 32767 });
  expect(holdsOf({ position_per_revolution: 65536, velocity_per_rps: 1073741.824, acceleration_per_rps2: 1073741824 }).acceleration).toBe(3.9999);
  for (const unknown of [undefined, { position_per_revolution: null, velocity_per_rps: 1, acceleration_per_rps2: 1 }]) {
    expect(holdsOf(unknown)).toEqual({ position: 2147483647, speed: 4294967295, velocity: 2147483647, acceleration: 4294967295 });
  }
});

test.each([
  ['first try', 'first-try'], ['gain 12, "loose" / belt', 'gain-12-loose-belt'], ['../../etc/passwd', 'etc-passwd'], ['Prüfstand 2.5', 'Prüfstand-2.5'], ['', 'recording-20'], [' ?* ', 'recording-20'],
  ['nul', 'recording-20'], ['Con.txt', 'recording-20'], ['x'.repeat(100), 'x'.repeat(60)], ['step of the velocity, ismc', 'step-of-the-velocity-ismc'],
])('the file of the recording "%s"', (name, file) => expect(fileNameOf({ name, id: 20 })).toBe(file));
