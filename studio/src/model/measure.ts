// Measurements on a curve: statistics, and the figures of a step response as in control engineering.

export interface Statistics {
  minimum: number;
  maximum: number;
  mean: number;
  rms: number;
  peakToPeak: number;
}

export function statistics(values: ArrayLike<number>, from = 0, to = values.length): Statistics | null {
  let minimum = Infinity;
  let maximum = -Infinity;
  let sum = 0;
  let squares = 0;
  let count = 0;
  for (let i = from; i < to; ++i) {
    const value = values[i];
    if (!Number.isFinite(value)) continue;
    minimum = Math.min(minimum, value);
    maximum = Math.max(maximum, value);
    sum += value;
    squares += value * value;
    ++count;
  }
  if (count === 0) return null;
  return { minimum, maximum, mean: sum / count, rms: Math.sqrt(squares / count), peakToPeak: maximum - minimum };
}

export interface Step {
  from: number;
  to: number;
  rise_s: number | null; // 10 % to 90 % of the step
  overshoot_percent: number; // how far the curve exceeds the end value, in percent of the step's height
  settling_s: number | null; // from the 10 % crossing until the curve stays within `settlingBand`
}

export const settlingBand = 0.02; // of the step's height, to each side of the end value

// The step from the level at the begin to the level at the end; each level is the mean of a twentieth of the samples. Null
// if there are fewer than 10 samples, or if the step is not higher than twice the noise (peak to
// peak) of an end, or lower than half of the curve's range.
export function stepResponse(values: ArrayLike<number>, interval_s: number, from = 0, to = values.length): Step | null {
  const samples = to - from;
  if (samples < 10) return null;
  const end = Math.max(1, Math.floor(samples / 20));
  const first = statistics(values, from, from + end);
  const last = statistics(values, to - end, to);
  const all = statistics(values, from, to);
  if (!first || !last || !all) return null;
  const height = last.mean - first.mean;
  if (Math.abs(height) <= 2 * Math.max(first.peakToPeak, last.peakToPeak) || height === 0) return null;
  // An oscillation overshoots by less than the height; a curve with a wider range went there and back.
  if (2 * Math.abs(height) < all.peakToPeak) return null;

  const part = (i: number) => (values[i] - first.mean) / height;
  let crossed10 = -1;
  let crossed90 = -1;
  let highest = 1;
  let outside = -1;
  for (let i = from; i < to; ++i) {
    const p = part(i);
    if (crossed10 < 0 && p >= 0.1) crossed10 = between(i, p, 0.1, part, from);
    if (crossed90 < 0 && p >= 0.9) crossed90 = between(i, p, 0.9, part, from);
    highest = Math.max(highest, p);
    if (Math.abs(p - 1) > settlingBand) outside = i;
  }
  const risen = crossed10 >= 0 && crossed90 >= 0;
  return {
    from: first.mean,
    to: last.mean,
    rise_s: risen ? (crossed90 - crossed10) * interval_s : null,
    overshoot_percent: (highest - 1) * 100,
    settling_s: risen && outside + 1 < to ? Math.max(0, outside + 1 - crossed10) * interval_s : null,
  };
}

// The place between the samples i-1 and i, as a fractional index, at which the curve crosses `level`.
function between(i: number, p: number, level: number, part: (i: number) => number, from: number): number {
  if (i === from) return i;
  const before = part(i - 1);
  return p === before ? i : i - (p - level) / (p - before);
}

// The value at `x`, linearly interpolated, of samples that begin at `x0` at intervals of `step`. NaN outside.
export function valueAt(values: ArrayLike<number>, x0: number, step: number, x: number): number {
  const at = (x - x0) / step;
  const i = Math.floor(at + 1e-9);
  if (i < 0 || i >= values.length) return NaN;
  if (i + 1 >= values.length) return at - i < 1e-6 ? values[i] : NaN;
  const share = Math.max(0, at - i);
  return values[i] + (values[i + 1] - values[i]) * share;
}
