// The binary frame of the stream and of a recording's data. Layout, little endian: u32 id, u32 stride, u64 tick,
// u32 samples, u32 channels, then channels * samples f64, channel by channel.

export interface Frame {
  id: number;
  stride: number; // ticks from one sample to the next
  tick: number; // tick of the first sample
  channels: Float64Array[];
}

export const tick_us = 62.5;
export const ticksPerSecond = 16_000;
const header_bytes = 24;

export function decodeFrame(buffer: ArrayBuffer): Frame {
  if (buffer.byteLength < header_bytes) throw new RangeError(`a frame of ${buffer.byteLength} bytes has no header`);
  const view = new DataView(buffer);
  const samples = view.getUint32(16, true);
  const count = view.getUint32(20, true);
  if (buffer.byteLength !== header_bytes + 8 * samples * count) {
    throw new RangeError(`a frame of ${count} channels and ${samples} samples has ${buffer.byteLength} bytes`);
  }
  const channels: Float64Array[] = [];
  for (let channel = 0; channel < count; ++channel) {
    channels.push(float64(buffer, header_bytes + 8 * samples * channel, samples));
  }
  // A double is exact up to 2^53 ticks, which are 17,000 years.
  return { id: view.getUint32(0, true), stride: view.getUint32(4, true), tick: Number(view.getBigUint64(8, true)), channels };
}

const littleEndian = new Uint8Array(new Uint16Array([1]).buffer)[0] === 1;

function float64(buffer: ArrayBuffer, offset: number, length: number): Float64Array {
  if (littleEndian) return new Float64Array(buffer, offset, length);
  const view = new DataView(buffer, offset);
  return Float64Array.from({ length }, (_, i) => view.getFloat64(8 * i, true));
}
