import { describe, expect, test } from 'vitest';
import { eventful, findStep, statistics, stepResponse, valueAt } from './measure';

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

describe('the step of a curve without cursors', () => {
  const interval = 1e-3;
  const noise = (i: number) => (((i * 7919) % 101) / 101 - 0.5) * 2;
  // A move at 600 rpm: at rest, up in 50 ms, on, down, at rest.
  const move = (before: number, on: number, after: number) =>
    Float64Array.from({ length: before + 50 + on + 50 + after }, (_, i) => 600 * Math.max(0, Math.min(1, (i - before) / 50, (before + 100 + on - i) / 50)) + noise(i));

  test.each([[20, 300, 800], [200, 100, 40], [100, 2000, 100]])('that begins and ends at rest (%d, %d, %d samples)', (before, on, after) => {
    const values = move(before, on, after);
    expect(stepResponse(values, interval)).toBeNull();
    const step = findStep(values, interval)!;
    expect(Math.abs(step.from)).toBeLessThan(5);
    expect(step.to / 600).toBeCloseTo(1, 2);
    expect(step.rise_s).toBeCloseTo(0.04, 2);
    expect(step.overshoot_percent).toBeLessThan(1);
    expect(step.settling_s).toBeCloseTo(0.044, 2);
    expect(step.begin).toBe(0);
    expect(step.end).toBeGreaterThan(before + 50 + on - 10);
    expect(step.end).toBeLessThan(before + 50 + on + 10);
  });

  test('has the overshoot of a second-order system', () => {
    const damping = 0.5;
    const omega = 100;
    const damped = omega * Math.sqrt(1 - damping ** 2);
    const up = (t: number) => (t < 0 ? 0 : 1 - Math.exp(-damping * omega * t) * (Math.cos(damped * t) + (damping / Math.sqrt(1 - damping ** 2)) * Math.sin(damped * t)));
    const there = Float64Array.from({ length: 2000 }, (_, i) => 50 * (up((i - 300) * interval) - up((i - 1300) * interval)));
    const step = findStep(there, interval)!;
    expect([step.from, step.to].map(Math.round)).toEqual([0, 50]);
    expect(step.overshoot_percent).toBeCloseTo(16.3, 0);
    expect(step.end).toBeLessThan(1320);
  });

  test('is that of the whole curve if it has one only', () => {
    const once = Float64Array.from({ length: 1000 }, (_, i) => (i < 400 ? 1 : 3));
    expect(findStep(once, interval)).toMatchObject({ from: 1, to: 3, begin: 0, end: 1000, overshoot_percent: 0 });
  });

  test('is none in a sine, noise, and nothing', () => {
    expect(findStep(Float64Array.from({ length: 1000 }, (_, i) => Math.sin(i / 20)), interval)).toBeNull();
    expect(findStep(Float64Array.from({ length: 1000 }, (_, i) => noise(i)), interval)).toBeNull();
    expect(findStep(new Float64Array(1000), interval)).toBeNull();
    expect(findStep(new Float64Array(1000).fill(NaN), interval)).toBeNull();
  });

  test('is found beside a gap', () => {
    const values = move(100, 300, 200);
    values.fill(NaN, 0, 60);
    expect(findStep(values, interval)!.rise_s).toBeCloseTo(0.04, 2);
  });

  test('does not take seconds for a long curve', () => {
    const long = Float64Array.from({ length: 262144 }, (_, i) => (i > 80000 && i < 160000 ? 600 : 0) + noise(i));
    expect(findStep(long, interval)!.to / 600).toBeCloseTo(1, 2);
  });

  test('what happens is fitted, with a margin', () => {
    const values = move(500, 300, 1500);
    const [from, to] = eventful([values, new Float64Array(values.length)])!;
    expect(from).toBeGreaterThan(420);
    expect(from).toBeLessThan(500);
    expect(to).toBeGreaterThan(900);
    expect(to).toBeLessThan(980);
    expect(eventful([new Float64Array(100)])).toBeNull();
    expect(eventful([])).toBeNull();
  });
});

// A move by the distance 1 with trapezoidal velocity: `ramp_s` up and down, `way_s` in all. Sampled at 1 kHz after `rest_s`.
describe('the step of a recorded move', () => {
  const [ramp_s, way_s] = [0.05, 0.15];
  const speed = 1 / (way_s - ramp_s);
  const place = (t: number) => {
    if (t <= 0) return 0;
    if (t >= way_s) return 1;
    if (t < ramp_s) return (speed * t * t) / 2 / ramp_s;
    if (t > way_s - ramp_s) return 1 - (speed * (way_s - t) ** 2) / 2 / ramp_s;
    return speed * (t - ramp_s / 2);
  };
  const rise_ms = 86.75; // from 31.6 ms to 118.4 ms
  const recorded = (rest_s: number, seconds: number, from: number, height: number, noisy = 0) =>
    Float64Array.from({ length: Math.round(1000 * seconds) }, (_, i) => from + height * (place(i / 1000 - rest_s) + noisy * Math.sin(i * i * 1.7)));
  const isTheMove = (values: Float64Array, from: number, height: number, share = 0.0005) => {
    const step = findStep(values, 1e-3)!;
    expect(Math.abs(step.from - from) / Math.abs(height)).toBeLessThan(share);
    expect(Math.abs(step.to - from - height) / Math.abs(height)).toBeLessThan(share);
    expect(Math.abs(step.rise_s! * 1000 - rise_ms)).toBeLessThan(share < 0.005 ? 1 : 2);
  };

  test.each([[0], [0.004], [0.01], [0.03], [0.09], [0.1], [0.11], [1]])('begins at its rest of %d s', (rest_s) => {
    isTheMove(recorded(rest_s, 2, 131083, 131072), 131083, 131072);
    isTheMove(recorded(rest_s, 2, 2200, -131072), 2200, -131072);
  });
  test.each([[0.01], [0.03], [0.09], [1]])('begins at its rest of %d s in noise', (rest_s) => isTheMove(recorded(rest_s, 2, 500, 1000, 0.003), 500, 1000, 0.006));
  test.each([[0.004], [0.05]])('ends at its rest of %d s', (rest_s) => isTheMove(recorded(1, 1 + way_s + rest_s, 0, 500), 0, 500));

  test('is not there if the curve does not rest at an end', () => {
    for (const late of [0.02, 0.05, 0.08, 0.12]) {
      expect(findStep(recorded(-late, 2, 0, 131072), 1e-3), `begins ${late} s after the start`).toBeNull();
      expect(findStep(recorded(1, 1 + way_s - late, 0, 131072), 1e-3), `ends ${late} s before the end`).toBeNull();
      expect(findStep(recorded(-late, 2, 0, 131072, 0.002), 1e-3), `begins ${late} s after the start, in noise`).toBeNull();
    }
    expect(findStep(Float64Array.from({ length: 2000 }, (_, i) => 50 * (1 - Math.exp(-i / 30))), 1e-3)).toBeNull();
  });

  test('there and back is one of the two ways', () => {
    const back = recorded(0.5, 2, 0, 1000).map((value, i) => value - 1000 * place(i / 1000 - 1.2));
    expect(stepResponse(back, 1e-3)).toBeNull();
    const step = findStep(back, 1e-3)!;
    expect([step.from, step.to].map(Math.round)).toEqual([0, 1000]);
    expect(Math.abs(step.rise_s! * 1000 - rise_ms)).toBeLessThan(1);
  });
});
