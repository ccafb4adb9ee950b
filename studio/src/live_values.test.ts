import { afterEach, beforeEach, describe, expect, test, vi } from 'vitest';
import type { Frame } from './api/frame';
import type { Subscription } from './api/stream';
import type { ObjectValue } from './api/types';
import { LiveValues } from './live_values';

// A server that refuses a subscription with a channel of `unfit`.
function server(unfit: string[] = []) {
  const open: Subscription[] = [];
  const asked: [string, string[]][] = [];
  const values = new LiveValues(
    (subscription) => {
      open.push(subscription);
      const bad = subscription.channels.find(({ signal, object }) => unfit.includes(signal ?? object ?? ''));
      if (bad) setTimeout(() => subscription.refused?.({ what: `${bad.signal ?? bad.object ?? ''} is no number` }), 5);
      return () => void (open.includes(subscription) && open.splice(open.indexOf(subscription), 1));
    },
    (axis, objects) => {
      asked.push([axis, objects]);
      return Promise.resolve(Object.fromEntries(objects.map((object): [string, ObjectValue] => [object, `text of ${object}`])));
    },
  );
  const send = (n: number, ...channels: number[]) => open[n].frame({ id: 1, stride: 1, tick: 0, channels: channels.map((value) => Float64Array.of(0, value)) } as Frame);
  return { values, open, asked, send };
}
const settle = (ms = 200) => vi.advanceTimersByTimeAsync(ms);

describe('live values', () => {
  beforeEach(() => void vi.useFakeTimers());
  afterEach(() => void vi.useRealTimers());

  test('of many widgets share a subscription, and tell only changes', async () => {
    const { values, open, asked, send } = server();
    const seen = [vi.fn(), vi.fn()];
    values.listen('x/velocity_rpm', seen[0]);
    values.listen('x/velocity_rpm', seen[1]);
    values.listen('y/6041:00', vi.fn());
    await settle();
    expect(open.map(({ channels }) => channels)).toEqual([[{ axis: 'x', signal: 'velocity_rpm' }, { axis: 'y', object: '6041:00' }]]);
    send(0, 5, NaN);
    send(0, 5, NaN);
    expect(values.of('x/velocity_rpm')).toEqual({ value: 5 });
    expect(values.of('y/6041:00')).toEqual({ value: null });
    expect(seen.map((each) => each.mock.calls.length)).toEqual([1, 1]);
    await settle(5000);
    expect(asked).toEqual([]);
  });

  test('are subscribed anew only when the wanted ones change', async () => {
    const { values, open } = server();
    const end = values.listen('x/a', vi.fn());
    values.listen('x/b', vi.fn());
    await settle();
    const [first] = open;
    values.listen('x/a', vi.fn());
    await settle();
    expect(open).toEqual([first]);
    end();
    await settle();
    expect(open).toEqual([first]); // another widget still wants it
  });

  test('that the stream refuses are polled, and the others streamed', async () => {
    const { values, open, asked, send } = server(['1008:00', 'nonsense']);
    for (const text of ['x/6041:00', 'x/1008:00', 'x/velocity_rpm', 'x/nonsense']) values.listen(text, vi.fn());
    await settle(1000);
    expect(open.flatMap(({ channels }) => channels.map(({ signal, object }) => signal ?? object))).toEqual(['6041:00', 'velocity_rpm']);
    send(0, 592, 7);
    expect(values.of('x/6041:00').value).toBe(592);
    expect(values.of('x/1008:00').value).toBe('text of 1008:00');
    expect(values.of('x/nonsense')).toMatchObject({ value: null, problem: { what: 'nonsense is no number' } });
    const before = asked.length;
    await settle(2000);
    expect(asked.slice(before).every(([axis, objects]) => axis === 'x' && objects.join() === '1008:00')).toBe(true);
    expect(asked.length - before).toBeLessThanOrEqual(4); // at most each 500 ms
  });

  test('beyond four subscriptions are polled', async () => {
    const { values, open, asked } = server();
    for (let i = 0; i < 70; ++i) values.listen(`x/${(0x2000 + i).toString(16).toUpperCase()}:00`, vi.fn());
    await settle();
    expect(open.map(({ channels }) => channels.length)).toEqual([16, 16, 16, 16]);
    expect(asked.at(-1)![1]).toHaveLength(6);
  });

  test('that nobody wants any more are neither streamed nor polled', async () => {
    const { values, open, asked } = server(['1008:00']);
    const ends = ['x/1008:00', 'x/6041:00'].map((text) => values.listen(text, vi.fn()));
    await settle(1000);
    ends.forEach((end) => end());
    await settle();
    const before = asked.length;
    await settle(3000);
    expect([open.length, asked.length - before]).toEqual([0, 0]);
  });
});
