import { expect, test } from 'vitest';
import { longestBefore } from './scope';

test('with the longest pre-trigger time the server has fewer samples before the trigger than in all', () => {
  for (const [duration_ms, rate_hz] of [[500, 1000], [1, 16000], [1000, 1], [0.5, 1000], [37, 100]] as const) {
    const samples = Math.max(1, Math.round((duration_ms * rate_hz) / 1000));
    expect(Math.round((longestBefore(duration_ms, rate_hz) * rate_hz) / 1000)).toBeLessThan(samples);
  }
});
