import { ticksPerSecond } from '../api/frame';
import type { Channel } from '../api/types';
import type { Samples } from './scope';

// A recording as a Parquet file: a row for each sample, with the columns of the CSV file and those of the math channels.

const columnOf = ({ axis, object, name, unit }: Channel) => [axis, object, name, unit && `[${unit}]`].filter(Boolean).join(' ');

export async function parquetOf({ recording, x, interval_ms, values }: Samples): Promise<ArrayBuffer> {
  // Loaded when it is needed: most visitors never need it.
  const { parquetWriteBuffer } = await import('hyparquet-writer');
  const first = recording.first_tick ?? 0;
  const stride = Math.round((interval_ms * ticksPerSecond) / 1000);
  const ticks = Array.from(x, (_, i) => first + i * stride);
  return parquetWriteBuffer({
    columnData: [
      { name: 'tick', data: ticks.map(BigInt), type: 'INT64' },
      { name: 'time_s', data: ticks.map((tick) => tick / ticksPerSecond), type: 'DOUBLE' },
      // As in the CSV file, a value that is no number is empty.
      ...recording.channels.map((channel, i) => ({ name: columnOf(channel), data: Array.from(values[i], (value) => (Number.isNaN(value) ? null : value)), type: 'DOUBLE' as const, nullable: true })),
    ],
    kvMetadata: [
      { key: 'servodrome.recording', value: recording.name },
      { key: 'servodrome.note', value: recording.note ?? '' },
      { key: 'servodrome.trigger_tick', value: String(recording.trigger_tick ?? '') },
    ],
  });
}
