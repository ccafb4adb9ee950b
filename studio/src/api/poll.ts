import { get } from './client';
import type { AxisView, Clock } from './types';

// For a server without the stream: the same views, asked for.
export function poll(take: (axes: AxisView[], clock: Clock) => void, lost: () => void) {
  const ask = async () => {
    try {
      const [{ axes }, clock] = await Promise.all([get<{ axes: AxisView[] }>('/axes'), get<Clock>('/clock')]);
      take(axes, clock);
    } catch {
      lost();
    }
    setTimeout(() => void ask(), 100);
  };
  void ask();
}
