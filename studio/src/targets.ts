import type { ChannelRequest } from './api/types';
import { snapshot, stream } from './store';

// The remaining distance of each driven axis in its own units: target minus actual position. The axes share subscriptions,
// eight axes each, because the number of subscriptions of a connection is limited.

const axesPerSubscription = 8;
const mostSubscriptions = 6;
const rate_hz = 10;

const wanted = new Map<string, Set<(left: number | null) => void>>();
let ends: (() => void)[] = [];
let planned = false;

export function watchTarget(axis: string, tell: (left: number | null) => void): () => void {
  const listeners = wanted.get(axis) ?? new Set();
  wanted.set(axis, listeners.add(tell));
  plan();
  return () => {
    listeners.delete(tell);
    if (listeners.size === 0) wanted.delete(axis);
    plan();
  };
}

// Renews the subscriptions once, 50 ms later, for all axes that are added or removed until then.
function plan() {
  if (planned) return;
  planned = true;
  setTimeout(() => {
    planned = false;
    ends.forEach((end) => end());
    ends = [];
    const axes = [...wanted.keys()].filter((axis) => axis in snapshot().axes);
    for (let i = 0; i < axes.length && ends.length < mostSubscriptions; i += axesPerSubscription) {
      ends.push(subscribe(axes.slice(i, i + axesPerSubscription)));
    }
  }, 50);
}

function subscribe(axes: string[]): () => void {
  const channels = axes.flatMap((axis): ChannelRequest[] => [{ axis, object: '607A:00' }, { axis, object: '6064:00' }]);
  return stream.subscribe({
    channels,
    rate_hz,
    frame: (frame) => {
      axes.forEach((axis, i) => {
        const [target, actual] = [frame.channels[2 * i]?.at(-1), frame.channels[2 * i + 1]?.at(-1)];
        if (target === undefined || actual === undefined) return;
        const left = target - actual;
        wanted.get(axis)?.forEach((tell) => tell(Number.isFinite(left) ? left : null));
      });
    },
  });
}
