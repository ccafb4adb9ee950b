// The amplitude spectrum of a part of a curve, in the unit of the curve.

export interface Window {
  id: string;
  name: string;
  cosines: number[]; // coefficients a0 - a1 cos(x) + a2 cos(2 x) - ..., x from 0 to 2 pi
  use: string;
}

// Coefficients of the flat top: ISO 18431-2.
export const windows: Window[] = [
  { id: 'hann', name: 'Hann', cosines: [0.5, 0.5], use: 'for most signals' },
  { id: 'flattop', name: 'Flat top', cosines: [0.21557895, 0.41663158, 0.277263158, 0.083578947, 0.006947368], use: 'exact amplitudes' },
  { id: 'blackman', name: 'Blackman-Harris', cosines: [0.35875, 0.48829, 0.14128, 0.01168], use: 'small lines beside large ones' },
  { id: 'none', name: 'Rectangle', cosines: [1], use: 'whole periods' },
];

export const mostSamples = 2 ** 17;

// In place; the length is a power of two.
export function fft(re: Float64Array, im: Float64Array) {
  const n = re.length;
  for (let i = 1, j = 0; i < n; ++i) {
    let bit = n >> 1;
    for (; j & bit; bit >>= 1) j ^= bit;
    j ^= bit;
    if (i < j) {
      [re[i], re[j]] = [re[j], re[i]];
      [im[i], im[j]] = [im[j], im[i]];
    }
  }
  for (let size = 2; size <= n; size <<= 1) {
    const half = size >> 1;
    for (let k = 0; k < half; ++k) {
      const cos = Math.cos((-2 * Math.PI * k) / size);
      const sin = Math.sin((-2 * Math.PI * k) / size);
      for (let a = k; a < n; a += size) {
        const b = a + half;
        const x = re[b] * cos - im[b] * sin;
        const y = re[b] * sin + im[b] * cos;
        re[b] = re[a] - x;
        im[b] = im[a] - y;
        re[a] += x;
        im[a] += y;
      }
    }
  }
}

export interface Spectrum {
  hz: Float64Array;
  amplitude: Float64Array; // of a sine: its amplitude; at 0 Hz the mean
}

// Transforms the samples from `from` to before `to`, padded with zeros to a power of two. Returns a text if there is no
// spectrum: the reason.
export function spectrum(values: Float64Array, rate_hz: number, { cosines }: Pick<Window, 'cosines'>, from = 0, to = values.length): Spectrum | string {
  const count = to - from;
  if (count < 16) return 'fewer than 16 samples';
  if (count > mostSamples) return `more than ${mostSamples} samples: show a shorter part`;
  const part = values.subarray(from, to);
  if (!part.some(Number.isFinite)) return 'no values';
  if (!part.every(Number.isFinite)) return 'values are missing, by a gap in the samples or a division by 0: show a part without a gap';
  const mean = part.reduce((sum, value) => sum + value, 0) / count;
  const size = 2 ** Math.ceil(Math.log2(count));
  const re = new Float64Array(size);
  const im = new Float64Array(size);
  let gain = 0;
  for (let i = 0; i < count; ++i) {
    const weight = cosines.reduce((sum, a, k) => sum + (k % 2 === 0 ? a : -a) * Math.cos((2 * Math.PI * k * i) / count), 0);
    gain += weight;
    re[i] = (part[i] - mean) * weight;
  }
  fft(re, im);
  const bins = size / 2 + 1;
  const hz = Float64Array.from({ length: bins }, (_, k) => (k * rate_hz) / size);
  // Half of a sine's amplitude is at the negative frequency. The last bin is its own counterpart.
  const amplitude = hz.map((_, k) => (Math.hypot(re[k], im[k]) * (k === size / 2 ? 1 : 2)) / gain);
  amplitude[0] = Math.abs(mean);
  return { hz, amplitude };
}

export interface Line {
  hz: number;
  amplitude: number;
}

// The largest lines, the largest first: local maxima above 1 % of the largest, at least `apart` bins from a larger one. The bin at
// 0 Hz is the mean and no line.
export function peaks({ hz, amplitude }: Spectrum, most = 3, apart = 8): Line[] {
  const found: number[] = [];
  const of = (k: number) => (k < 1 || k >= amplitude.length ? 0 : amplitude[k]);
  const candidates = [...amplitude.keys()].filter((k) => of(k) > of(k - 1) && of(k) >= of(k + 1));
  candidates.sort((a, b) => amplitude[b] - amplitude[a]);
  for (const k of candidates) {
    if (found.length === most || amplitude[k] < 0.01 * amplitude[candidates[0]]) break;
    if (found.every((other) => Math.abs(other - k) >= apart)) found.push(k);
  }
  return found.map((k) => ({ hz: hz[k], amplitude: amplitude[k] }));
}
