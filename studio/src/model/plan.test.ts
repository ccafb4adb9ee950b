import { describe, expect, test } from 'vitest';
import cases from '../../../tests/data/reach.json';
import type { AxisView, Geometry } from '../api/types';
import { endOf, hindrance, positionAt, type Move, type Reach } from './plan';

const turn = 1000; // counts of the shaft
const geometry: Geometry = {
  negative_stop: -11 * turn, positive_stop: 11 * turn, negative_limit: -10 * turn, positive_limit: 10 * turn,
  home_from: null, home_to: null, index_every: turn, index_at: 0,
};
const units = { position_per_revolution: 500, velocity_per_rps: 500, acceleration_per_rps2: 500 };
const limits = { velocity: null, acceleration: null, deceleration: null, lowest_position: null, highest_position: null, wraps_within: null };
// At shaft 2, where 6064h is 7.
const axis = { position_counts: 2 * turn, position_actual: 7 * 500 } as AxisView;
const simulated: Reach = { geometry, units, limits };

describe('a move of a simulated axis', () => {
  test('ends on the shaft, by a distance or at a position of 6064h', () => {
    expect(endOf(axis, simulated, { by: 3 })).toBe(5 * turn);
    expect(endOf(axis, simulated, { to: 4 })).toBe(-1 * turn);
    expect(positionAt(axis, simulated, 10 * turn)).toBe(15);
  });
  test('is refused beyond the nearest end', () => {
    expect(hindrance(axis, simulated, { by: 7.9 })).toBe('');
    expect(hindrance(axis, simulated, { by: 9 })).toBe('The move of 9.00 rev is longer than the 8.00 rev to the positive limit switch.');
    expect(hindrance(axis, simulated, { by: 9 }, (turns) => `${5 * turns} mm`)).toBe('The move of 45 mm is longer than the 40 mm to the positive limit switch.');
    expect(hindrance(axis, simulated, { by: -13 })).toBe('The move of 13.00 rev is longer than the 12.00 rev to the negative limit switch.');
    expect(hindrance(axis, { ...simulated, limits: { ...limits, lowest_position: 2 * 500, highest_position: 12 * 500 } }, { by: 6 })).toContain('5.00 rev to the software limit (607Dh)');
  });
});

describe('with a reversed polarity (607Eh)', () => {
  for (const polarity of [1, 0x80, 0xc0]) {
    const reversed = { ...simulated, polarity };
    test(`${polarity}: 6064h counts against the shaft`, () => {
      expect(endOf(axis, reversed, { by: 3 })).toBe(-1 * turn);
      expect(endOf(axis, reversed, { to: 4 })).toBe(5 * turn);
      expect(positionAt(axis, reversed, 10 * turn)).toBe(-1);
      expect(hindrance(axis, reversed, { by: 9 })).toBe('');
      expect(hindrance(axis, reversed, { by: -9 })).toBe('The move of 9.00 rev is longer than the 8.00 rev to the positive limit switch.');
      expect(hindrance(axis, { ...reversed, limits: { ...limits, lowest_position: 2 * 500, highest_position: 12 * 500 } }, { by: 6 })).toContain('5.00 rev to the software limit (607Dh)');
    });
  }
  test('bit 6 reverses the velocity only', () => expect(endOf(axis, { ...simulated, polarity: 0x40 }, { by: 3 })).toBe(5 * turn));
});

// The server's tests read the same cases (tests/studio_server/reach_test.cpp).
describe('of the cases of the server', () => {
  const perTurn = units.position_per_revolution;
  const inUnits = (span: number[] | null) => span && ([span[0] * perTurn, span[1] * perTurn] as [number, number]);
  const expectReasons = (at: AxisView, reach: Reach, { refused, accepted }: { refused: object[]; accepted: object[] }) => {
    for (const move of refused) expect(hindrance(at, reach, move as Move), JSON.stringify(move)).not.toBe('');
    for (const move of accepted) expect(hindrance(at, reach, move as Move), JSON.stringify(move)).toBe('');
  };
  for (const row of cases.software_limits) {
    test(row.case, () => {
      const acts = inUnits(row.acts);
      const reach: Reach = { geometry, units, limits: { ...limits, lowest_position: acts?.[0] ?? null, highest_position: acts?.[1] ?? null, wraps_within: inUnits(row.wraps_within) } };
      expectReasons({ position_counts: 0, position_actual: 0 } as AxisView, reach, row);
    });
  }
  test('the switches', () => {
    const { place, negative_limit, positive_limit, refused, accepted, refused_with_reversed_polarity: reversed } = cases.switches;
    const at = { position_counts: place * turn, position_actual: place * perTurn } as AxisView;
    const reach: Reach = { ...simulated, geometry: { ...geometry, negative_limit: negative_limit * turn, positive_limit: positive_limit * turn } };
    expectReasons(at, reach, { refused, accepted });
    for (const { side, by } of refused) expect(hindrance(at, reach, { by })).toContain(`the ${side} limit switch`);
    for (const { side, by } of reversed) expect(hindrance(at, { ...reach, polarity: 0x80 }, { by })).toContain(`the ${side} limit switch`);
  });
});

describe('a move of a drive on a bus', () => {
  const onBus = { position_counts: 7 * 500 } as AxisView; // 6064h
  const known: Reach = { units, limits: { ...limits, lowest_position: 2 * 500, highest_position: 12 * 500 } };
  test('is refused beyond the soft limits, without a geometry', () => {
    expect(hindrance(onBus, known, { by: 5 })).toBe('');
    expect(hindrance(onBus, known, { by: 6 })).toBe('The move of 6.00 rev is longer than the 5.00 rev to the software limit (607Dh).');
    expect(hindrance(onBus, known, { to: 1 })).toBe('The move of 6.00 rev is longer than the 5.00 rev to the software limit (607Dh).');
    expect(hindrance(onBus, { ...known, polarity: 1 }, { by: 6 })).toContain('5.00 rev to the software limit');
    expect(endOf(onBus, known, { by: 5 })).toBeNull();
  });
  test('is not judged without limits or units', () => {
    expect(hindrance(onBus, { units, limits }, { by: 100 })).toBe('');
    expect(hindrance(onBus, { limits: known.limits }, { by: 100 })).toBe('');
  });
});
