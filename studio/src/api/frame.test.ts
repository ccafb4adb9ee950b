import { expect, test } from 'vitest';
import { decodeFrame } from './frame';

function frame(id: number, stride: number, tick: bigint, channels: number[][]): ArrayBuffer {
  const samples = channels[0]?.length ?? 0;
  const buffer = new ArrayBuffer(24 + 8 * samples * channels.length);
  const view = new DataView(buffer);
  view.setUint32(0, id, true);
  view.setUint32(4, stride, true);
  view.setBigUint64(8, tick, true);
  view.setUint32(16, samples, true);
  view.setUint32(20, channels.length, true);
  channels.flat().forEach((value, i) => view.setFloat64(24 + 8 * i, value, true));
  return buffer;
}

test('a frame is its channels one after the other', () => {
  const decoded = decodeFrame(frame(7, 16, 123456n, [[1, 2, 3], [-0.5, 1e300, NaN]]));
  expect(decoded).toMatchObject({ id: 7, stride: 16, tick: 123456 });
  expect([...decoded.channels[0]]).toEqual([1, 2, 3]);
  expect([...decoded.channels[1]]).toEqual([-0.5, 1e300, NaN]);
});

test('ticks beyond 32 bits keep every bit', () => {
  expect(decodeFrame(frame(1, 1, 2n ** 40n + 3n, [[0]])).tick).toBe(2 ** 40 + 3);
});

test('a frame of the wrong length is refused', () => {
  const good = frame(1, 1, 0n, [[1, 2]]);
  expect(() => decodeFrame(good.slice(0, 30))).toThrow('1 channels and 2 samples has 30 bytes');
  expect(() => decodeFrame(good.slice(0, 10))).toThrow('no header');
});

test('no samples and no channels is a frame too', () => {
  expect(decodeFrame(frame(1, 1, 5n, [])).channels).toEqual([]);
});
