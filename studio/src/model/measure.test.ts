import { describe, expect, test } from 'vitest';
import { statistics, stepResponse, valueAt } from './measure';

describe('statistics', () => {
  test('of a sine are those of the textbook', () => {
    const sine = Float64Array.from({ length: 1000 }, (_, i) => 3 * Math.sin((2 * Math.PI * i) / 1000));
    const all = statistics(sine)!;
    expect(all.rms).toBeCloseTo(3 / Math.SQRT2, 6);
    expect(all.mean).toBeCloseTo(0, 9);
    expect(all.peakToPeak).toBeCloseTo(6, 4);
  });
  test('leave out what is no number, and are nothing of nothing', () => {
    expect(statistics([NaN, 2, 4])).toMatchObject({ minimum: 2, maximum: 4, mean: 3 });
    expect(statistics([NaN])).toBeNull();
  });
});

describe('step response', () => {
  const interval = 1e-4;
  // A second-order system with damping 0.5 and 100 rad/s: overshoot exp(-pi d / sqrt(1 - d^2)).
  const damping = 0.5;
  const omega = 100;
  const damped = omega * Math.sqrt(1 - damping ** 2);
  const second = (t: number) =>
    t < 0 ? 0 : 1 - Math.exp(-damping * omega * t) * (Math.cos(damped * t) + (damping / Math.sqrt(1 - damping ** 2)) * Math.sin(damped * t));
  const curve = (height: number, offset: number) => Float64Array.from({ length: 4000 }, (_, i) => offset + height * second((i - 400) * interval));

  test.each([[1, 0], [-250, 1000]])('of a second-order system, height %d from %d', (height, offset) => {
    const step = stepResponse(curve(height, offset), interval)!;
    expect(step.from).toBeCloseTo(offset, 6);
    expect(step.to).toBeCloseTo(offset + height, 3);
    expect(step.overshoot_percent).toBeCloseTo(100 * Math.exp((-Math.PI * damping) / Math.sqrt(1 - damping ** 2)), 1);
    expect(step.rise_s! * omega).toBeCloseTo(1.64, 1);
  });

  test('settles where an exponential comes within 2 %', () => {
    const tau = 0.01;
    const step = stepResponse(Float64Array.from({ length: 4000 }, (_, i) => (i < 500 ? 0 : 1 - Math.exp((-(i - 500) * interval) / tau))), interval)!;
    expect(step.rise_s).toBeCloseTo(tau * Math.log(9), 4);
    expect(step.settling_s).toBeCloseTo(tau * (Math.log(50) - Math.log(1 / 0.9)), 3);
    expect(step.overshoot_percent).toBeCloseTo(0, 3);
  });

  test('there is none in noise, in a constant, in too few samples', () => {
    expect(stepResponse(Float64Array.from({ length: 1000 }, (_, i) => Math.sin(i)), interval)).toBeNull();
    expect(stepResponse(new Float64Array(1000), interval)).toBeNull();
    expect(stepResponse([0, 1, 1], interval)).toBeNull();
  });

  test('there is none in a move there and back, which ends a little beside its start', () => {
    expect(stepResponse(Float64Array.from({ length: 3000 }, (_, i) => (i < 1000 ? 0 : i < 2000 ? 131072 : 230)), interval)).toBeNull();
  });

  test('is of the part between the cursors only', () => {
    const two = Float64Array.from({ length: 3000 }, (_, i) => (i < 500 ? 0 : i < 1500 ? 1 : 5));
    expect(stepResponse(two, interval, 0, 1000)).toMatchObject({ from: 0, to: 1 });
    expect(stepResponse(two, interval, 1000, 3000)).toMatchObject({ from: 1, to: 5 });
  });
});

test('a value between two samples lies on the line between them', () => {
  expect(valueAt([0, 10, 20], 5, 2, 8)).toBe(15);
  expect(valueAt([0, 10, 20], 5, 2, 9)).toBe(20);
  expect(valueAt([0, 10, 20], 5, 2, 4)).toBeNaN();
  expect(valueAt([0, 10, 20], 5, 2, 9.5)).toBeNaN();
});
