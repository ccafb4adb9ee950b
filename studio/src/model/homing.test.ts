import { describe, expect, test } from 'vitest';
import type { Geometry, HomingLeg, HomingMethod } from '../api/types';
import { cannotHome, followLeg, homingPath, proposedMethod, schematicOf } from './homing';

const turn = 1000;
const geometry: Geometry = {
  negative_stop: -11 * turn, positive_stop: 11 * turn, negative_limit: -10 * turn, positive_limit: 10 * turn,
  home_from: -500, home_to: 500, index_every: turn, index_at: 0,
};
const leg = (direction: HomingLeg['direction'], speed: HomingLeg['speed'], until: string, then: string, next?: number, on_limit?: number): HomingLeg =>
  ({ direction, speed, until, then, ...(next === undefined ? {} : { next }), ...(on_limit === undefined ? {} : { on_limit }) });

// Method 7 of the standard: in positive direction to the home switch, back off the switch, first index outside it.
const method7: HomingMethod = {
  method: 7, supported: true, start_active: 2,
  legs: [
    leg('positive', 'switch', 'home_rising', 'stop', 2, 1),
    leg('negative', 'switch', 'home_rising', 'keep', 2),
    leg('negative', 'zero', 'home_falling', 'keep', 3),
    leg('negative', 'zero', 'index', 'latch'),
  ],
};
const ends = (start: number) => homingPath(method7, geometry, start).map(({ to }) => to);

describe('the path of method 7', () => {
  test('from below the cam', () => expect(ends(-3000)).toEqual([-500, -500, -1000]));
  test('from above the cam it turns round at the positive limit switch', () => expect(ends(3000)).toEqual([10000, 500, -500, -1000]));
  test('from inside the cam', () => expect(ends(200)).toEqual([-500, -1000]));
});

test('with a reversed polarity the path is that of the mirrored machine', () => {
  const mirrored = { ...geometry, negative_stop: -12 * turn, negative_limit: -11 * turn, positive_limit: 9 * turn, home_from: -400, home_to: 600, index_at: 300 };
  const machine = { ...geometry, negative_limit: -9 * turn, positive_limit: 11 * turn, positive_stop: 12 * turn, home_from: -600, home_to: 400, index_at: -300 };
  for (const start of [-3000, 3000, 200]) {
    const path = homingPath(method7, machine, -start, true);
    expect(path.map(({ to }) => -to)).toEqual(homingPath(method7, mirrored, start).map(({ to }) => to));
    expect(path.map(({ leg: { direction }, sign }) => (direction === 'negative' ? 1 : -1) === sign)).not.toContain(false);
  }
  // The axis is followed by the way of the shaft.
  const path = homingPath(method7, machine, -3000, true);
  expect(followLeg(path, 0, -8900, 10)).toBe(1);
  expect(followLeg(path, 1, -300, 100)).toBe(2);
});

test('a limit switch, and the first index beside it', () => {
  const method1: HomingMethod = {
    method: 1, supported: true,
    legs: [leg('negative', 'switch', 'limit_reached', 'stop', 1), leg('positive', 'zero', 'limit_released', 'keep', 2), leg('positive', 'zero', 'index', 'latch')],
  };
  expect(homingPath(method1, { ...geometry, index_at: 300 }, 0).map(({ to }) => to)).toEqual([-10000, -10000, -9700]);
});

test('an index on which the axis stands is not the next one', () => {
  const method = (direction: HomingLeg['direction']): HomingMethod => ({ method: 33, supported: true, legs: [leg(direction, 'zero', 'index', 'latch')] });
  expect(homingPath(method('negative'), geometry, 2000).map(({ to }) => to)).toEqual([1000]);
  expect(homingPath(method('positive'), geometry, 2000).map(({ to }) => to)).toEqual([3000]);
});

test('ends where the geometry has no such switch', () => {
  expect(homingPath(method7, { ...geometry, home_from: null, home_to: null, positive_limit: null }, -3000)).toEqual([]);
});

test('an axis is followed from leg to leg', () => {
  const path = homingPath(method7, geometry, 3000);
  expect(followLeg(path, 0, 5000, 100)).toBe(0);
  expect(followLeg(path, 0, 9900, -10)).toBe(1); // the axis has reversed
  expect(followLeg(path, 1, 2000, -100)).toBe(1);
  expect(followLeg(path, 1, 400, -100)).toBe(2); // the axis has passed the edge
  expect(followLeg(path, 3, -1000, 0)).toBe(3);
});

describe('the methods that the wiring permits', () => {
  const method = (number: number, needs: string[], legs = method7.legs): HomingMethod => ({ method: number, supported: true, legs, needs });
  const methods = [method(-1, ['negative_stop']), method(1, ['negative_limit', 'index']), method(7, ['home', 'index']), method(17, ['negative_limit']), method(33, ['index']), method(35, [], [])];
  const bare: Geometry = { ...geometry, negative_limit: null, positive_limit: null, home_from: null, home_to: null };
  test('without switches only methods without them are left', () => {
    expect(methods.map((each) => cannotHome(each, bare))).toEqual(['', 'no negative limit switch', 'no home switch', 'no negative limit switch', '', '']);
    expect(proposedMethod(methods, bare)?.method).toBe(33);
  });
  test('7 is proposed if everything is there, and if nothing is known', () => {
    expect(proposedMethod(methods, geometry)?.method).toBe(7);
    expect(proposedMethod(methods, undefined)?.method).toBe(7);
  });
  test('an encoder without an index leaves out its methods', () => {
    expect(proposedMethod(methods, geometry, false)?.method).toBe(17);
    expect(cannotHome(methods[2], geometry, false)).toBe('no index of this encoder');
    expect(proposedMethod(methods, bare, false)?.method).toBe(35);
  });
});

describe('the schematic of a method whose switches are at unknown places', () => {
  const path = (method: HomingMethod) => {
    const { geometry: generic, start } = schematicOf(method);
    return homingPath(method, generic, start).map(({ index }) => index);
  };
  test('goes through the legs to the last one', () => {
    expect(path(method7)).toEqual([0, 2, 3]);
    expect(path({ method: 1, supported: true, legs: [leg('negative', 'switch', 'limit_reached', 'stop', 1), leg('positive', 'zero', 'limit_released', 'keep', 2), leg('positive', 'zero', 'index', 'latch')] })).toEqual([0, 1, 2]);
    expect(path({ method: -1, supported: true, legs: [leg('negative', 'switch', 'stalled', 'hold')] })).toEqual([0]);
    expect(path({ method: 35, supported: true, legs: [] })).toEqual([]);
  });
  test('has the switches that the legs name, and no others', () => {
    expect(schematicOf(method7).geometry).toMatchObject({ negative_limit: null, negative_stop: null, positive_stop: null });
    expect(schematicOf(method7).geometry.positive_limit).not.toBeNull(); // the first leg turns round there
    expect(schematicOf({ method: 33, supported: true, legs: [leg('negative', 'zero', 'index', 'latch')] }).geometry).toMatchObject({ negative_limit: null, positive_limit: null, home_from: null });
  });
});
