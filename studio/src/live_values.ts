import { useCallback, useSyncExternalStore } from 'react';
import { get } from './api/client';
import type { ChannelRequest, ObjectValue, Problem } from './api/types';
import { channelOf } from './model/scope';
import { axisPath } from './commands';
import { stream } from './store';

// The present values of signals and objects, for all widgets together. They come over the stream, in few subscriptions. Values
// that the stream does not carry (texts, objects above its limit) are polled, at a lower rate.

export interface LiveValue {
  value: ObjectValue | undefined; // undefined: not known yet; null: the drive has no power, or cannot be read now
  problem?: Problem;
}

const nothing: LiveValue = { value: undefined };
const perSubscription = 16;
const mostSubscriptions = 4; // of the 8 that the server gives to a page; plots need the others
const rate_hz = 10;
const poll_ms = 500;
const settle_ms = 30; // debounce: a page that opens or changes requests many values at once

export class LiveValues {
  private readonly wanted = new Map<string, Set<() => void>>();
  private readonly values = new Map<string, LiveValue>();
  private readonly unfit = new Map<string, Problem>(); // values that the stream refused
  private ends: (() => void)[] = [];
  private polled: string[] = [];
  private timer: ReturnType<typeof setTimeout> | undefined;
  private polling: ReturnType<typeof setInterval> | undefined;
  private busy = false;

  constructor(
    private readonly subscribe: (subscription: Parameters<typeof stream.subscribe>[0]) => () => void,
    private readonly read: (axis: string, objects: string[]) => Promise<Record<string, ObjectValue>>,
  ) {}

  of = (text: string): LiveValue => this.values.get(text) ?? nothing;

  listen(text: string, listener: () => void): () => void {
    const listeners = this.wanted.get(text) ?? new Set();
    this.wanted.set(text, listeners);
    listeners.add(listener);
    if (listeners.size === 1) this.arrange();
    return () => {
      listeners.delete(listener);
      if (listeners.size > 0) return;
      this.wanted.delete(text);
      this.values.delete(text);
      this.unfit.delete(text);
      this.arrange();
    };
  }

  private arrange() {
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.renew(), settle_ms);
  }

  private renew() {
    for (const end of this.ends) end();
    this.ends = [];
    const all = [...this.wanted.keys()];
    const streamed = all.filter((text) => !this.unfit.has(text)).slice(0, perSubscription * mostSubscriptions);
    for (let i = 0; i < streamed.length; i += perSubscription) this.open(streamed.slice(i, i + perSubscription));
    this.polled = all.filter((text) => !streamed.includes(text));
    clearInterval(this.polling);
    if (this.polled.length === 0) return;
    void this.poll();
    this.polling = setInterval(() => void this.poll(), poll_ms);
  }

  private open(texts: string[]) {
    const end = this.subscribe({
      channels: texts.map((text): ChannelRequest => channelOf(text)!),
      rate_hz,
      // The server refuses a whole subscription if it does not have one of the values. Halving the subscription finds that value.
      refused: (problem) => {
        end();
        this.ends = this.ends.filter((each) => each !== end);
        if (texts.length > 1) {
          const middle = Math.ceil(texts.length / 2);
          this.open(texts.slice(0, middle));
          this.open(texts.slice(middle));
          return;
        }
        this.unfit.set(texts[0], problem);
        this.arrange();
      },
      frame: ({ channels }) => {
        texts.forEach((text, i) => {
          const values = channels[i];
          const last = values?.[values.length - 1];
          if (last !== undefined) this.set(text, { value: Number.isNaN(last) ? null : last });
        });
      },
    });
    this.ends.push(end);
  }

  // One round at a time, so that requests do not queue up on a slow bus.
  private async poll() {
    if (this.busy || (typeof document !== 'undefined' && document.hidden)) return;
    this.busy = true;
    const axes = new Map<string, string[]>();
    for (const text of this.polled) {
      const { axis, object } = channelOf(text)!;
      if (object) axes.set(axis, [...(axes.get(axis) ?? []), object]);
      else this.set(text, { value: null, problem: this.unfit.get(text) ?? { what: 'too many signals at once' } });
    }
    for (const [axis, objects] of axes) {
      try {
        const values = await this.read(axis, objects);
        for (const object of objects) this.set(`${axis}/${object}`, { value: values[object] ?? null });
      } catch {
        for (const object of objects) this.set(`${axis}/${object}`, { value: null, problem: this.unfit.get(`${axis}/${object}`) ?? { what: 'no answer' } });
      }
    }
    this.busy = false;
  }

  private set(text: string, to: LiveValue) {
    const before = this.values.get(text);
    if (before && before.value === to.value && before.problem?.what === to.problem?.what) return;
    if (!this.wanted.has(text)) return;
    this.values.set(text, to);
    this.wanted.get(text)?.forEach((listener) => listener());
  }
}

const atATime = 100; // objects of a request: the server takes 128

async function readMany(axis: string, objects: string[]): Promise<Record<string, ObjectValue>> {
  const all: Record<string, ObjectValue> = {};
  for (let i = 0; i < objects.length; i += atATime) {
    const part = objects.slice(i, i + atATime).join(',');
    Object.assign(all, (await get<{ values: Record<string, ObjectValue> }>(`${axisPath(axis)}/values?objects=${part}`)).values);
  }
  return all;
}

const shared = new LiveValues((subscription) => stream.subscribe(subscription), readMany);

// `text`: AXIS/SIGNAL or AXIS/6064:00. The component is rendered when the value changes.
export function useLiveValue(text: string): LiveValue {
  // React subscribes again whenever it gets another function.
  const subscribe = useCallback((listener: () => void) => shared.listen(text, listener), [text]);
  return useSyncExternalStore(subscribe, () => shared.of(text));
}
