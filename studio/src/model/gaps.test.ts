import { expect, test } from 'vitest';
import { gaps } from './gaps';

test('what is not a number is left out, of samples as they come as well', () => {
  expect(gaps(Float64Array.of(1, NaN, 3))).toEqual([1, null, 3]);
  expect(gaps([NaN])).toEqual([null]);
});

test('samples without a gap are not copied', () => {
  const samples = Float64Array.of(1, 2);
  expect(gaps(samples)).toBe(samples);
});
