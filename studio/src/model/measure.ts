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

type Span = [number, number]; // indices: the first, and the one after the last

export const settlingBand = 0.02; // of the step's height, to each side of the end value

// The step from the level at the begin to the level at the end. Null if there are fewer than 10 samples, if the curve
// does not rest at both ends, or if the step is too low: at most twice the noise (peak to peak) of an end, or less than
// half of the curve's range.
export function stepResponse(values: ArrayLike<number>, interval_s: number, from = 0, to = values.length): Step | null {
  const samples = to - from;
  if (samples < 10) return null;
  const range = statistics(values, from, to)?.peakToPeak ?? 0;
  const height = restBand * range + noise(values, from, to);
  const most = Math.max(shortestRest, Math.floor(samples / 20));
  const first = restOf((k) => values[from + k], most, samples, range, height);
  const last = restOf((k) => values[to - 1 - k], most, samples, range, height);
  const step = stepBetween(values, interval_s, [from, from + first.level], [to - last.level, to]);
  if (!step) return null;
  // A ramp leaves the band after fewer samples than a rest.
  const rise = step.rise_s === null ? 0 : step.rise_s / interval_s;
  const shortest = Math.max(shortestRest, (3 * height * rise) / (0.8 * Math.abs(step.to - step.from)));
  return [first, last].every(({ isWhole, count }) => isWhole || count >= shortest) ? step : null;
}

const shortestRest = 3; // samples
const restBand = 0.002; // of the range of the curve, besides its noise

// How much the noise of the curve moves a level, peak to peak. The second differences contain the noise, but not a level or a ramp:
// nine of ten are below 4 standard deviations, and the noise is within 8.
function noise(values: ArrayLike<number>, from: number, to: number): number {
  const seconds: number[] = [];
  for (let i = from + 1; i < to - 1; ++i) {
    const second = Math.abs(values[i - 1] - 2 * values[i] + values[i + 1]);
    if (Number.isFinite(second)) seconds.push(second);
  }
  const sorted = Float64Array.from(seconds).sort();
  return sorted.length === 0 ? 0 : 2 * sorted[Math.floor(0.9 * (sorted.length - 1))];
}

interface Rest {
  count: number; // samples, from the end of the curve
  level: number; // number of these samples whose mean is the level
  isWhole: boolean;
}

// The samples at rest at an end of the curve: `most` of them if they are level, else those before the curve leaves a band. The curve
// leaves it slowly at first, so the level is that of the first half of them. `at(0)` is the sample at the end, `at(1)` its neighbour.
function restOf(at: (k: number) => number, most: number, samples: number, range: number, height: number): Rest {
  const values = Float64Array.from({ length: most }, (_, k) => at(k));
  if (isLevel(values, 0, most, (steady * range) / samples, (band * range) / 4)) {
    const level = lastOfLevel(values, 0, most, range);
    return { count: level, level, isWhole: true };
  }
  let count = 0;
  for (let [low, high] = [Infinity, -Infinity]; count < most && Number.isFinite(values[count]); ++count) {
    low = Math.min(low, values[count]);
    high = Math.max(high, values[count]);
    if (high - low > height) break;
  }
  return { count, level: Math.ceil(count / 2), isWhole: false };
}

// The step from the level of the samples `before` to that of the samples `after`.
function stepBetween(values: ArrayLike<number>, interval_s: number, before: Span, after: Span): Step | null {
  const [from, to] = [before[0], after[1]];
  const first = statistics(values, ...before);
  const last = statistics(values, ...after);
  const all = statistics(values, from, to);
  if (!first || !last || !all) return null;
  const height = last.mean - first.mean;
  if (Math.abs(height) <= 2 * Math.max(first.peakToPeak, last.peakToPeak) || height === 0) return null;
  // An oscillation overshoots by less than the height; a curve with a wider range moves to a level and back.
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

export interface FoundStep extends Step {
  begin: number; // the samples from which the step was read
  end: number;
}

const band = 0.04; // of the range of the curve: a level stays within it
const steady = 0.2; // of the slope from end to end: a level rises more slowly

// The highest step of a curve, without cursors: of the whole part if that is one step, else between two neighbouring levels,
// as of a move that begins and ends at rest. Null if the curve has no levels, for example if it only rises.
export function findStep(values: ArrayLike<number>, interval_s: number, from = 0, to = values.length): FoundStep | null {
  const whole = stepResponse(values, interval_s, from, to);
  if (whole) return { ...whole, begin: from, end: to };
  const levels = levelsOf(values, from, to);
  let highest: FoundStep | null = null;
  for (let i = 1; i < levels.length; ++i) {
    const step = stepBetween(values, interval_s, levels[i - 1], lastOf(levels[i]));
    if (step && Math.abs(step.to - step.from) > 1.05 * Math.abs(highest ? highest.to - highest.from : 0)) {
      highest = { ...step, begin: levels[i - 1][0], end: levels[i][1] };
    }
  }
  return highest;
}

// Overshoot is in the first part of a level, so its value is read from the last half.
const lastOf = ([from, to]: Span): Span => [Math.floor((from + to) / 2), to];

// The parts in which the curve stays at one level: the longest that fit in the band, one after the other.
function levelsOf(values: ArrayLike<number>, from: number, to: number): Span[] {
  const all = statistics(values, from, to);
  if (!all || all.peakToPeak === 0) return [];
  const shortest = Math.max(8, Math.floor((to - from) * 0.015));
  const height = band * all.peakToPeak;
  const levels: Span[] = [];
  // Queues of indices whose values fall (rise): the first one is the maximum (minimum) of the window.
  let highs: number[] = [];
  let lows: number[] = [];
  let begin = from;
  let count = 0;
  const end = (i: number) => {
    const last = lastOfLevel(values, begin, i, all.peakToPeak);
    if (last - begin >= shortest && isLevel(values, begin, last, (steady * all.peakToPeak) / (to - from), height / 4)) levels.push([begin, last]);
  };
  for (let i = from; i < to; ++i) {
    const isGap = !Number.isFinite(values[i]);
    if (!isGap) {
      while (highs.length > 0 && values[highs[highs.length - 1]] <= values[i]) highs.pop();
      while (lows.length > 0 && values[lows[lows.length - 1]] >= values[i]) lows.pop();
      highs.push(i);
      lows.push(i);
      if (values[highs[0]] - values[lows[0]] <= height) continue;
    }
    end(i);
    const taken = levels.length > count;
    count = levels.length;
    if (isGap || taken) {
      begin = isGap ? i + 1 : i;
      highs = isGap ? [] : [i];
      lows = isGap ? [] : [i];
    } else {
      while (values[highs[0]] - values[lows[0]] > height) {
        begin = Math.min(highs[0], lows[0]) + 1;
        if (highs[0] < begin) highs.shift();
        if (lows[0] < begin) lows.shift();
      }
    }
  }
  end(to);
  return levels;
}

// A window also contains the first samples of the ramp after the level: their values are outside the range of its middle.
function lastOfLevel(values: ArrayLike<number>, from: number, to: number, range: number): number {
  const quarter = Math.floor((to - from) / 4);
  const middle = statistics(values, from + quarter, to - quarter);
  if (!middle) return to;
  const margin = middle.peakToPeak / 4 + 0.002 * range;
  let end = to;
  while (end > from && !(values[end - 1] >= middle.minimum - margin && values[end - 1] <= middle.maximum + margin)) --end;
  return end;
}

// Compares means, so that noise does not count: of the two halves (a ramp is not steady), and of the middle and the two ends
// (the top of a sine is bent).
function isLevel(values: ArrayLike<number>, from: number, to: number, slope: number, bend: number): boolean {
  const quarter = Math.floor((to - from) / 4);
  const mean = (begin: number, end: number) => statistics(values, begin, end)?.mean ?? NaN;
  const quarters = [0, 1, 2, 3].map((k) => mean(from + k * quarter, k === 3 ? to : from + (k + 1) * quarter));
  const [a, b, c, d] = quarters;
  return Math.abs((c + d - a - b) / 2) <= (slope * (to - from)) / 2 && Math.abs((b + c - a - d) / 2) <= bend;
}

// The part in which a curve changes: from the first sample that differs from the first value to the last one that differs from
// the last value, with a margin. Null if the curve does not change.
export function eventful(curves: ArrayLike<number>[]): [number, number] | null {
  let from = Infinity;
  let to = -Infinity;
  for (const values of curves) {
    const all = statistics(values);
    if (!all || all.peakToPeak === 0) continue;
    const end = Math.max(1, Math.floor(values.length / 50));
    const [first, last] = [statistics(values, 0, end), statistics(values, values.length - end)];
    if (!first || !last) continue;
    const away = Math.max(0.02 * all.peakToPeak, 2 * first.peakToPeak, 2 * last.peakToPeak);
    let begin = 0;
    while (begin < values.length && !(Math.abs(values[begin] - first.mean) > away)) ++begin;
    let after = values.length - 1;
    while (after >= begin && !(Math.abs(values[after] - last.mean) > away)) --after;
    if (begin > after) continue;
    from = Math.min(from, begin);
    to = Math.max(to, after);
  }
  if (from > to) return null;
  const margin = Math.max(4, Math.round((to - from) * 0.08));
  return [Math.max(0, from - margin), to + margin];
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
