import { expect, test } from 'vitest';
import type { Recording } from '../api/types';
import { measuredOf, type Channel } from './measured';
import { noMechanics, scaleOf } from './mechanics';

const scale = scaleOf({ ...noMechanics, machine: 'spindle', feed_mm: 5 }, { position_per_revolution: 1000, velocity_per_rps: 1000, acceleration_per_rps2: 1000 })!;
const channels: Channel[] = [
  { object: '6064:00', name: 'position', kind: 'position', role: 'response' },
  { signal: 'following_error', name: 'following error', kind: 'position', role: 'error' },
];

test('the figures of a ramp, in the units of the user', () => {
  // 2000 units (10 mm) in 100 ms, from 100 ms on.
  const x = Float64Array.from({ length: 1000 }, (_, i) => i - 100);
  const position = x.map((t) => 2000 * Math.max(0, Math.min(1, t / 100)));
  const error = x.map((t) => (t > 0 && t < 100 ? -20 : 0));
  const found = measuredOf({ recording: {} as Recording, x, interval_ms: 1, values: [position, error] }, channels, scale, { by: 2000 }, 'now');
  expect(found.rise_ms).toBeCloseTo(80, 6);
  expect(found.settling_ms).toBeCloseTo(89, 0); // 10 ms to 98 ms, then the next sample
  expect(found.overshoot_percent).toBeCloseTo(0, 6);
  expect(found.greatest_error).toBeCloseTo(0.1, 9);
  expect(found.x.length).toBeLessThanOrEqual(250);
  expect(Math.max(...found.curves[0].values.map(Number))).toBe(10);
  expect(found.curves.map(({ unit }) => unit)).toEqual(['mm', 'mm']);
});
