import { expect, test } from 'vitest';
import { figuresOf, placeOf, setsOf } from './tuning';

test('an object is an index and a sub-index', () => {
  expect(placeOf('60F9:0A')).toEqual([0x60f9, 10]);
});

test('lines of a set stand together', () => {
  const line = (object: string, set: string) => ({ object, set, does: '' });
  expect(setsOf([line('1', 'a'), line('2', 'b'), line('3', 'a')]).map(([set, lines]) => [set, lines.map(({ object }) => object)])).toEqual([
    ['a', ['1', '3']],
    ['b', ['2']],
  ]);
});

test('figures that nobody measured are left out', () => {
  expect(figuresOf({ result: 'tuned by the drive itself', gains: [] })).toEqual([]);
  const rows = figuresOf({ result: 'proposed', gains: [], promised_bandwidth_hz: 60, predicted: { bandwidth_hz: 60, phase_margin_deg: 55 } });
  expect(rows.map(({ label, promised }) => [label, promised])).toEqual([
    ['Bandwidth, closed loop, -3 dB', 60],
    ['Phase margin', 55],
  ]);
});

test('a proposed position gain is no measured one', () => {
  const gain = { before: 62.8, after: 33.4, unit: '1/s' };
  const row = (result: 'proposed' | 'applied') => figuresOf({ result, gains: [], position_gain: gain }).map(({ label, before, promised, after }) => [label, before, promised, after]);
  expect(row('proposed')).toEqual([['Position gain', 62.8, 33.4, undefined]]);
  expect(row('applied')).toEqual([['Position gain', 62.8, 33.4, 33.4]]);
});
