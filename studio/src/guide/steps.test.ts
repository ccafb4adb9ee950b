import { describe, expect, test } from 'vitest';
import type { AxisView, ObjectEntry, ObjectValue } from '../api/types';
import { noPowerOn } from './journal';
import { noMechanics, scaleOf } from './mechanics';
import type { Found } from './state';
import type { Facts } from './step';
import { checkOf, fieldsOf, noGains, objectsOf, openOf, refusedBy, steps } from './steps';

// Steps of drives on buses: what is not known is not complete.

const units = { position_per_revolution: 1000, velocity_per_rps: 1000, acceleration_per_rps2: 1000 };
const entry = (object: string, name: string, more: Partial<ObjectEntry> = {}): [string, ObjectEntry] =>
  [object, { index: `0x${object.slice(0, 4)}`, sub: parseInt(object.slice(5), 16), name, type: 'INTEGER32', access: 'rw', unit: '', pdo: 'none', saved: true, ...more }];
const drive = (entries: [string, ObjectEntry][], values: Record<string, ObjectValue> = {}, more: Partial<Facts> = {}): Facts => ({
  axis: { name: 'x', product: 'some drive', powered: true } as AxisView, isVirtual: false, entries: new Map(entries), values, mechanics: noMechanics,
  scale: scaleOf(noMechanics, units), units, limits: undefined, geometry: undefined, polarity: null, homing: undefined, gains: undefined, proposed: {}, journal: [], powerOn: noPowerOn, ...more,
});
const of = (id: string) => steps.find((step) => step.id === id)!;
const open = (id: string, facts: Facts, found: Found = {}, typed: Record<string, number> = {}) => of(id).open(facts, { found, typed });

describe('inputs of a drive on a bus', () => {
  const facts = drive([entry('60FD:00', 'Digital inputs', { bits: [{ bit: 0, name: 'negative limit switch' }, { bit: 2, name: 'home switch' }] })]);
  test('every bit with a name must be seen at both levels', () => {
    expect(open('inputs', facts)).toBe('Not seen at both levels yet: negative limit switch, home switch.');
    expect(open('inputs', facts, { seen: { 'negative limit switch': [true, true], 'home switch': [false, true] } })).toBe('Not seen at both levels yet: home switch.');
    expect(open('inputs', facts, { seen: { 'negative limit switch': [true, true], 'home switch': [true, true] } })).toBe('');
  });
  test('except those that are not wired, and then the check says so', () => {
    expect(open('inputs', facts, { seen: { 'negative limit switch': [true, true] }, notWired: ['home switch'] })).toBe('');
    expect(checkOf(of('inputs'), facts, { typed: {}, found: { notWired: ['home switch'] } })).toBe('Every wired input was seen at both levels.');
    expect(checkOf(of('inputs'), facts, { typed: {}, found: { notWired: ['home switch', 'negative limit switch'] } })).toBe('Every input is marked as not wired.');
  });
  test('without 60FDh the step cannot be done', () => {
    const none = drive([entry('6041:00', 'Statusword')]);
    expect(of('inputs').lacks?.(none)).toContain('has no object 60FDh');
    expect(of('inputs').lacks?.(facts)).toBe('');
  });
  test('nothing is known before the dictionary has come', () => expect(open('inputs', drive([]))).toBe('The wiring is not known yet.'));
});

test('the torque limit is complete when the drive has it', () => {
  const limit = entry('6072:00', 'Max torque', { default: 3000 });
  expect(open('torque', drive([limit], { '6072:00': 600 }))).toBe('Not in the drive: 6072:00 = 3000.');
  expect(open('torque', drive([limit]))).not.toBe('');
  expect(open('torque', drive([limit], { '6072:00': 3000 }))).toBe('');
  expect(open('torque', drive([limit], { '6072:00': 3000 }), {}, { torque: 1500 })).not.toBe('');
  expect(open('torque', drive([entry('6072:00', 'Max torque')], { '6072:00': 600 }))).toBe('Not entered yet: Torque or current limit.');
});

test('Pn401 and Pn402 of the ProNet limit its torque', () => {
  const pronet = drive([entry('3068:00', 'Pn401', { unit: '%', default: 300 }), entry('3069:00', 'Pn402', { unit: '%', default: 300 })], { '3068:00': 300, '3069:00': 60 });
  expect(of('torque').lacks?.(pronet)).toBe('');
  expect(fieldsOf(of('direction'), pronet, { typed: {}, found: {} }).find(({ key }) => key === 'torque')).toMatchObject({ objects: ['3068:00', '3069:00'], usual: 60, unit: '%' });
  expect(open('torque', pronet)).toBe('Not in the drive: 3069:00 = 300.');
});

test('soft limits are complete when both are typed, in order, and in the drive', () => {
  const entries = [entry('607D:01', 'Min position limit'), entry('607D:02', 'Max position limit')];
  expect(open('limits', drive(entries, { '607D:01': 0, '607D:02': 0 }))).toBe('Not entered yet: Lowest position.');
  expect(open('limits', drive(entries, { '607D:01': -8000, '607D:02': 0 }), {}, { lowest: -8 })).toBe('Not entered yet: Highest position.');
  expect(open('limits', drive(entries, { '607D:01': -8000, '607D:02': 0 }), {}, { lowest: -8, highest: 8 })).toBe('Not in the drive: 607D:02 = 8000.');
  expect(open('limits', drive(entries, { '607D:01': -8000, '607D:02': 8000 }), {}, { lowest: -8, highest: 8 })).toBe('');
});

describe('soft limits that are not written', () => {
  const entries = [entry('607D:01', 'Min position limit'), entry('607D:02', 'Max position limit')];
  const refused = (facts: Facts, lowest: number, highest: number) => refusedBy(of('limits'), facts, { typed: { lowest, highest }, found: {} });
  const geometry = { negative_stop: -11000, positive_stop: 11000, negative_limit: -10000, positive_limit: null, index_every: 1000 } as Facts['geometry'];
  const axis = { name: 'x', product: 'some drive', powered: true, position_counts: 0, position_actual: 2000 } as AxisView; // 6064h is 2 revolutions above the shaft
  test('the lowest is above the highest, also if the drive has them', () => {
    const facts = drive(entries, { '607D:01': 8000, '607D:02': -8000 });
    expect(refused(facts, 8, -8)).toBe('The lowest position must be below the highest.');
    expect(openOf(of('limits'), facts, { typed: { lowest: 8, highest: -8 }, found: {} })).toBe('The lowest position must be below the highest.');
  });
  test('they lie beyond a switch, or beyond a stop where there is no switch', () => {
    const facts = drive(entries, {}, { geometry, axis });
    expect(refused(facts, -8, 13)).toBe('');
    expect(refused(facts, -9, 12)).toBe('The lowest position, −9 rev, lies beyond the negative limit switch at −8 rev: choose one inside.');
    expect(refused(facts, -8, 14)).toBe('The highest position, 14 rev, lies beyond the positive stop at 13 rev: choose one inside.');
    expect(refused({ ...facts, polarity: 1 }, -13, 14)).toContain('beyond the negative limit switch at 12 rev');
    expect(openOf(of('limits'), { ...facts, values: { '607D:01': -9000, '607D:02': 12000 } }, { typed: { lowest: -9, highest: 12 }, found: {} })).toContain('lies beyond');
  });
  test('of an axis without known switches any are written', () => expect(refused(drive(entries), -1e5, 1e5)).toBe(''));
});

describe('a number beyond the objects to which it is written is refused', () => {
  const refused = (id: string, facts: Facts, typed: Record<string, number>) => refusedBy(of(id), facts, { typed, found: {} });
  test('by their type, in the units of the step', () => {
    const facts = drive([entry('607D:01', 'Min position limit'), entry('607D:02', 'Max position limit')]);
    expect(refused('limits', facts, { lowest: -2147483.649, highest: 8 })).toBe('Lowest position: At least -2147483.648 rev (607D:01).');
    expect(refused('limits', facts, { lowest: -8, highest: 2147483.648 })).toBe('Highest position: At most 2147483.647 rev (607D:02).');
    expect(refused('limits', facts, { lowest: -2147483.648, highest: 2147483.647 })).toBe('');
  });
  test('by their range, the narrowest of several objects', () => {
    const facts = drive([entry('6083:00', 'Acceleration', { type: 'UNSIGNED32', maximum: 90000 }), entry('6084:00', 'Deceleration', { type: 'UNSIGNED16' }), entry('6081:00', 'Velocity', { type: 'UNSIGNED32' })]);
    expect(refused('cycle', facts, { acceleration: 65.536 })).toBe('Acceleration: At most 65.535 rev/s² (6083:00, 6084:00).');
    expect(refused('cycle', facts, { velocity: -1, acceleration: 50 })).toContain('Velocity: At least 0 rpm');
  });
  test('a fraction, if the object has whole numbers', () => {
    const facts = drive([entry('6072:00', 'Max torque', { type: 'UNSIGNED16', default: 3000 })]);
    expect(refused('torque', facts, { torque: 1500.5 })).toBe('Torque or current limit: A whole number (6072:00).');
    expect(refused('torque', facts, { torque: 65536 })).toBe('Torque or current limit: At most 65535 (6072:00).');
    expect(refused('torque', facts, { torque: 1500 })).toBe('');
    expect(refused('cycle', facts, { times: 1.5 })).toBe('Cycles: A whole number.');
  });
});

describe('a move that is too small to show anything', () => {
  const refused = (id: string, distance: number, more: Partial<Facts> = {}) => refusedBy(of(id), drive([], {}, more), { typed: { distance }, found: {} });
  const reason = 'Distance: At least 0.05 rev, forward or back: a smaller move does not show the direction.';
  test('does not show the direction', () => {
    for (const distance of [0, 0.001, 0.0499, -0.0499]) expect(refused('direction', distance)).toBe(reason);
    for (const distance of [0.05, -0.05, 0.1]) expect(refused('direction', distance)).toBe('');
  });
  test('in the units of the step, and in counts of a coarse encoder', () => {
    const scale = (perTurn: number) => scaleOf({ ...noMechanics, machine: 'degrees' }, { ...units, position_per_revolution: perTurn });
    expect(refused('direction', 0.04, { scale: scale(1000) })).toContain('At least 18 °, forward or back');
    expect(refused('direction', 0.4, { scale: scale(20) })).toContain('At least 180 °, forward or back');
  });
  test('nor can it be measured', () => {
    expect(refused('position', 0)).toContain('a smaller move cannot be measured');
    expect(refused('cycle', 0.009)).toContain('At least 0.01 rev');
    expect(refused('cycle', 0.01)).toBe('');
  });
  test('one that was made before is not counted', () => {
    const move = (asked: number, drive: number): Found => ({ moved: { asked, drive, shaft: null }, way: 'right' });
    expect(open('direction', drive([]), move(0, 0))).toBe('The small move has not been made yet.');
    expect(open('direction', drive([]), move(0.05, 0))).toContain('did not move by the distance');
    expect(open('direction', drive([]), move(0.05, 0.05))).toBe('');
  });
});

test('gains that are not on the bus are not said to be undocumented', () => {
  const gains = (object: string[]) => ({ gains: object.map((each) => ({ object: each, set: 0, does: '' })) }) as unknown as Facts['gains'];
  const entries = [entry('6041:00', 'Statusword')];
  expect(noGains(drive(entries, {}, { gains: gains([]) }))).toContain('documents no gains');
  expect(noGains(drive(entries, {}, { gains: gains(['2001:04']) }))).toContain('are no objects on its bus');
  expect(noGains(drive([entry('2001:04', 'Rigidity level')], {}, { gains: gains(['2001:04']) }))).toBe('');
});

test('a loop is not complete while its gains are not in the drive', () => {
  const gains = { gains: [{ object: '60F9:01', set: '', does: '' }] } as unknown as Facts['gains'];
  const written = { step: 'velocity', object: '60F9:01', name: 'Kp', unit: '', before: 10, after: 20 };
  const facts = (now: number) => drive([entry('60F9:01', 'Kp')], { '60F9:01': now, '6060:00': 3 }, { gains, journal: [written, { ...written, object: '6060:00', after: 9 }] });
  const measured = { first: {} } as Found;
  expect(open('velocity', facts(20), measured)).toBe('');
  expect(open('velocity', facts(10), measured)).toBe('Not in the drive any more: 60F9:01 = 20. Write it again, or undo this step.');
  expect(open('velocity', facts(15), measured)).toContain('60F9:01 = 20');
  expect(open('position', facts(10), measured)).toBe('');
});

describe('identify', () => {
  const entries = [entry('1008:00', 'Device name'), entry('2F12:00', 'Encoder counts per revolution', { access: 'ro' }), entry('2690:00', 'Communication encoder data reset'), entry('6094:00', 'Velocity encoder factor', { access: 'const' }), entry('3068:00', 'Pn401'), entry('3069:00', 'Pn402')];
  const read = { '1008:00': 'x', '2F12:00': 131072, '3068:00': 300, '3069:00': 300 };
  test('shows what tells the motor and the encoder, by the names, and the torque limit', () =>
    expect(objectsOf(of('identify'), drive(entries), []).shown).toEqual(['1008:00', '2F12:00', '3068:00', '3069:00']));
  test('is complete when all is read and a person has compared it', () => {
    expect(open('identify', drive(entries), { agrees: true })).toBe('The objects have not been read yet.');
    expect(open('identify', drive(entries, { ...read, '2F12:00': undefined as unknown as ObjectValue }), { agrees: true })).toBe('The objects have not been read yet.');
    expect(open('identify', drive(entries, read))).toBe('Compare the values with the nameplate.');
    expect(open('identify', drive(entries, read), { agrees: true })).toBe('');
  });
});

test('the report is complete when it is saved, or a person says so', () => {
  expect(open('report', drive([]))).toContain('not saved yet');
  expect(open('report', drive([]), { saved: true })).toBe('');
});

test('a drive without a store command has stored nothing', () => {
  const facts = drive([]);
  expect(checkOf(of('store'), facts, { typed: {}, found: { stored: { stored: false, lost: [] } } })).toBe('The drive has no store command.');
  expect(checkOf(of('store'), facts, { typed: {}, found: { stored: { stored: true, lost: [] } } })).toBe('The drive has stored its parameters.');
});

test('a step lacks the size of the units only when the drive has answered without it', () => {
  const needing = steps.filter(({ lacks }) => lacks?.(drive([], {}, { scale: null, units: {} as Facts['units'] })).includes('size of the drive\'s units'));
  expect(needing.map(({ id }) => id)).toEqual(expect.arrayContaining(['direction', 'velocity', 'position', 'homing', 'limits', 'cycle']));
  for (const { lacks } of needing) expect(lacks?.(drive([], {}, { scale: null, units: undefined }))).not.toContain('size of the drive\'s units');
});
