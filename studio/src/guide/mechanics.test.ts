import { expect, test } from 'vitest';
import { fromUser, noMechanics, scaleOf, toDrive, toUser } from './mechanics';

const units = { position_per_revolution: 131072, velocity_per_rps: 600, acceleration_per_rps2: 600 };

test('a spindle of 10 mm behind a gear of 5 to 2', () => {
  const scale = scaleOf({ ...noMechanics, machine: 'spindle', feed_mm: 10, motor_turns: 5, load_turns: 2 }, units)!;
  expect(toUser(scale, 'position', 2.5)).toBe(10);
  expect(toUser(scale, 'velocity', 2.5)).toBe(10);
  expect(scale.unit.velocity).toBe('mm/s');
  expect(toDrive(scale, 'position', fromUser(scale, 'position', 10))).toBe(2.5 * 131072);
  expect(toDrive(scale, 'velocity', fromUser(scale, 'velocity', 10))).toBe(1500);
});

test('revolutions have rpm, degrees have degrees per second', () => {
  expect(toUser(scaleOf(noMechanics, units)!, 'velocity', 5)).toBe(300);
  expect(toUser(scaleOf({ ...noMechanics, machine: 'degrees' }, units)!, 'velocity', 0.5)).toBe(180);
});

test('without the size of the units there is no scale, unless it is typed', () => {
  const unknown = { position_per_revolution: null, velocity_per_rps: null, acceleration_per_rps2: null };
  expect(scaleOf(noMechanics, unknown)).toBeNull();
  expect(scaleOf({ ...noMechanics, units_per_turn: 4000 }, unknown)!.drive).toEqual({ position: 4000, velocity: 4000, acceleration: 4000 });
  expect(scaleOf({ ...noMechanics, motor_turns: 0 }, units)).toBeNull();
});
