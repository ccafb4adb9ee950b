import type { Channel } from '../api/types';
import { formulaOf, type MathChannel, type Wave } from './formula';
import type { Samples } from './scope';

// The samples with a further channel for each math channel. A formula that does not fit the recording, for example because it
// names a channel that this recording does not have, gives no channel.
export function withMaths(samples: Samples, maths: MathChannel[]): Samples {
  const { recording, values, interval_ms } = samples;
  const waves: Wave[] = recording.channels.map(({ unit }, i) => ({ unit, values: values[i] }));
  const made = maths.flatMap(({ name, formula }) => {
    const found = formulaOf(formula, waves.length);
    return typeof found === 'function' ? [{ name, ...found({ waves, interval_s: interval_ms / 1000 }) }] : [];
  });
  if (made.length === 0) return samples;
  const channels = made.map(({ name, unit }): Channel => ({ axis: '', signal: `math ${name}`, name, unit }));
  return { ...samples, recording: { ...recording, channels: [...recording.channels, ...channels] }, values: [...values, ...made.map((wave) => wave.values)] };
}
