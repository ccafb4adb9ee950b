import { describe, expect, test } from 'vitest';
import { fft, peaks, spectrum, windows } from './spectrum';

const rate = 4000;
const sine = (count: number, hz: number, amplitude: number, offset = 0) =>
  Float64Array.from({ length: count }, (_, i) => offset + amplitude * Math.sin((2 * Math.PI * hz * i) / rate + 0.3));
const window = (id: string) => windows.find((each) => each.id === id)!;
const of = (values: Float64Array, id: string) => {
  const found = spectrum(values, rate, window(id));
  if (typeof found === 'string') throw new Error(found);
  return found;
};

test('the transform is the sum of its definition', () => {
  const n = 32;
  const input = Float64Array.from({ length: n }, (_, i) => ((i * 7919) % 13) - 6);
  const re = input.slice();
  const im = new Float64Array(n);
  fft(re, im);
  for (let k = 0; k < n; ++k) {
    let [x, y] = [0, 0];
    input.forEach((value, i) => {
      x += value * Math.cos((2 * Math.PI * k * i) / n);
      y -= value * Math.sin((2 * Math.PI * k * i) / n);
    });
    expect(re[k]).toBeCloseTo(x, 9);
    expect(im[k]).toBeCloseTo(y, 9);
  }
});

describe('the spectrum of a known sine', () => {
  test.each(windows.map(({ id }) => id))('has its amplitude and place, window %s', (id) => {
    const { hz, amplitude } = of(sine(4096, 250, 12.5, 3), id); // 256 whole periods
    const k = 256;
    expect(hz[k]).toBe(250);
    expect(amplitude[k]).toBeCloseTo(12.5, 6);
    expect(amplitude[0]).toBeCloseTo(3, 9);
    expect(Math.max(...amplitude.slice(k + 8))).toBeLessThan(0.01);
  });

  test('between two bins and with a length that is no power of two, by the flat top within 0.2 %', () => {
    const [line] = peaks(of(sine(3000, 251.3, 12.5), 'flattop'));
    expect(line.amplitude / 12.5).toBeGreaterThan(0.998);
    expect(line.amplitude / 12.5).toBeLessThan(1.002);
    expect(Math.abs(line.hz - 251.3)).toBeLessThan(1.5);
  });

  test('at half the rate is not doubled', () => {
    const alternating = Float64Array.from({ length: 64 }, (_, i) => (i % 2 === 0 ? 2 : -2));
    expect(of(alternating, 'none').amplitude[32]).toBeCloseTo(2, 9);
  });

  test('two lines are two peaks, the larger first', () => {
    const small = sine(4096, 1000, 0.2);
    const both = sine(4096, 250, 1).map((value, i) => value + small[i]);
    expect(peaks(of(both, 'blackman')).slice(0, 2).map(({ hz }) => hz)).toEqual([250, 1000]);
  });
});

test.each([1, 2, 2048])('the largest line is that of the plot, also at bin %d', (bin) => {
  const hz = (bin * rate) / 4096;
  const found = of(bin === 2048 ? Float64Array.from({ length: 4096 }, (_, i) => (i % 2 === 0 ? 80 : -80)) : sine(4096, hz, 80, 500), 'none');
  const plotted = found.amplitude.slice(1);
  const [line] = peaks(found);
  expect(line.amplitude).toBe(Math.max(...plotted));
  expect(line.hz).toBe(hz);
});

test('there is none of too few samples, of too many, and of a gap', () => {
  expect(spectrum(new Float64Array(15), rate, window('hann'))).toMatch(/fewer/);
  expect(spectrum(new Float64Array(2 ** 17 + 1), rate, window('hann'))).toMatch(/more/);
  const gap = sine(64, 250, 1);
  gap[40] = NaN;
  expect(spectrum(gap, rate, window('hann'))).toMatch(/gap/);
  expect(typeof spectrum(gap, rate, window('hann'), 0, 40)).toBe('object');
  expect(spectrum(new Float64Array(64).fill(NaN), rate, window('hann'))).toBe('no values');
});
