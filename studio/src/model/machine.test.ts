import { describe as group, expect, test } from 'vitest';
import type { AxisView, Mechanics } from '../api/types';
import { coupledWith, describe, filterOf, fitting, isMirrored, pairsOf, sliderAt, turnsOf, visibleRows } from './machine';

const mechanics: Mechanics = { kind: 'rotary', counts_per_revolution: 1000, cycle_revolutions: 10, cycle_offset_turns: 0.25, crank_ratio: 0.25, hangs: false, belt: false, elastic: false };

test('the turns are those of the motor, or of the arm behind its gear', () => {
  expect(turnsOf(mechanics, 1250)).toBeCloseTo(0.25, 9);
  expect(turnsOf(mechanics, -250)).toBeCloseTo(0.75, 9);
  expect(turnsOf({ ...mechanics, kind: 'arm' }, 2500)).toBeCloseTo(0.5, 9);
  expect(turnsOf({ ...mechanics, kind: 'crank' }, 9000)).toBeCloseTo(0.15, 9);
});

test('the slider of a crank goes from end to end, and is beyond the middle at a quarter turn', () => {
  for (const ratio of [0, 0.25, 0.9]) {
    expect(sliderAt(0, ratio)).toBeCloseTo(1, 9);
    expect(sliderAt(0.5, ratio)).toBeCloseTo(0, 9);
  }
  expect(sliderAt(0.25, 0)).toBeCloseTo(0.5, 9);
  expect(sliderAt(0.25, 0.25)).toBeCloseTo((Math.sqrt(15) - 3) / 2, 9); // the rod is inclined
});

test('an axis in words', () => {
  expect(describe(mechanics)).toBe('rotary');
  expect(describe({ ...mechanics, kind: 'linear', belt: true, elastic: true, hangs: true })).toBe('linear, by a belt, hanging load');
  expect(describe({ ...mechanics, kind: 'arm', elastic: true })).toBe('arm, elastic coupling');
});

test('coupled axes are found once a pair', () => {
  const axis = (name: string, ...coupled: string[]) => ({ name, coupled }) as unknown as AxisView;
  const axes = { left: axis('left', 'right'), y: axis('y'), right: axis('right', 'left'), real: { name: 'real' } as AxisView };
  expect(pairsOf(['left', 'y', 'right', 'real', 'gone'], axes)).toEqual([['left', 'right']]);
  expect(pairsOf(['right', 'left'], axes)).toEqual([['right', 'left']]);
  expect(coupledWith(axes.left)).toBe('coupled with right');
  expect(coupledWith(axes.y) + coupledWith(axes.real)).toBe('');
  expect(isMirrored({ ...mechanics, coupling: { axis: 'right', ratio: -1 } })).toBe(true);
  expect(isMirrored({ ...mechanics, coupling: null })).toBe(false);
});

group('the axes of a large line', () => {
  const axis = (name: string, more: Partial<AxisView>) => ({ name, product: 'ismc', bus: 'can0', serial: null, powered: true, state: 'switched on', ...more }) as AxisView;
  const axes = Object.fromEntries([
    axis('a', { state: 'operation enabled', in_motion: true }), axis('b', { bus: 'can1', state: 'fault' }), axis('c', { powered: false, state: undefined }),
    axis('d', { product: 'ismk', serial: { bus: 'rs485', station: 2, protocol: 'modbus' }, powered: false, state: undefined, problem: { what: 'no answer' } }),
  ].map((each) => [each.name, each]));
  const of = (query: string) => fitting(['a', 'b', 'c', 'd', 'gone'], axes, filterOf(new URLSearchParams(query))).join('');
  test.each([['', 'abcd'], ['q=ISMK', 'd'], ['q=can0 ismk', 'd'], ['q=ismc can1', 'b'], ['bus=rs485', 'd'], ['bus=can0', 'acd'], ['state=enabled', 'a'], ['state=ready', 'b'], ['state=fault', 'b'], ['state=off', 'c'], ['state=moving', 'a'], ['state=silent', 'd'], ['state=nonsense', 'abcd'], ['q=can1&state=off', '']])('%s', (query, names) => {
    expect(of(query)).toBe(names);
  });
});

test('the visible rows', () => {
  expect(visibleRows(0, 340, 34, 256)).toEqual([0, 16]);
  expect(visibleRows(3400, 340, 34, 256)).toEqual([94, 116]);
  expect(visibleRows(99999, 340, 34, 256)).toEqual([256, 256]);
  expect(visibleRows(0, 340, 34, 3)).toEqual([0, 3]);
});
