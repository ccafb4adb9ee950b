import type { Frame } from '../api/frame';
import { ticksPerSecond } from '../api/frame';
import type { Channel, ChannelRequest, Recording, Trigger } from '../api/types';
import { valueAt } from './measure';

// How a recording is set up; all of it in the address, so that a reload or a colleague has the same scope.

export interface Setup {
  channels: ChannelRequest[];
  rate_hz: number;
  duration_ms: number;
  pre_ms: number;
  trigger: Trigger;
}

// Of a trigger, in the address: every axis, every state.
export const any = '*';
export const mostChannels = 16;
export const rates = [100, 500, 1000, 2000, 4000, 8000, 16000];

// "ismc/velocity_rpm" and "ismc/6064:00"
export const textOfChannel = ({ axis, signal, object }: ChannelRequest) => `${axis}/${signal ?? object ?? ''}`;

export function channelOf(text: string): ChannelRequest | null {
  const cut = text.lastIndexOf('/');
  const what = text.slice(cut + 1);
  if (cut < 1 || what === '') return null;
  const axis = text.slice(0, cut);
  return /^[0-9a-f]{4}:[0-9a-f]{1,2}$/i.test(what) ? { axis, object: what.toUpperCase() } : { axis, signal: what };
}

const number = (text: string | null, otherwise: number) => (text !== null && Number.isFinite(Number(text)) ? Number(text) : otherwise);

export function setupOf(query: URLSearchParams, firstAxis: string, second = 'velocity_rpm'): Setup {
  const channels = (query.get('ch') ?? '').split(',').map(channelOf).filter((channel) => channel !== null).slice(0, mostChannels);
  const kinds: Trigger['kind'][] = ['now', 'edge', 'level', 'state', 'fault'];
  const kind = kinds.find((each) => each === query.get('trigger')) ?? 'now';
  const trigger: Trigger = { kind };
  if (kind === 'edge' || kind === 'level') {
    trigger.channel = number(query.get('tch'), 0);
    trigger.level = number(query.get('level'), 0);
    trigger.slope = query.get('slope') === 'falling' ? 'falling' : 'rising';
  }
  const axis = query.get('taxis') ?? firstAxis;
  const state = query.get('tstate') ?? 'operation enabled';
  if (kind === 'state' || (kind === 'fault' && axis !== any)) trigger.axis = axis;
  if (kind === 'state' && state !== any) trigger.state = state;
  return {
    channels: channels.length > 0 ? channels : [{ axis: firstAxis, signal: 'position_counts' }, { axis: firstAxis, signal: second }],
    rate_hz: number(query.get('rate'), 1000),
    duration_ms: number(query.get('ms'), 2000),
    pre_ms: number(query.get('pre'), 100),
    trigger,
  };
}

export function queryOf({ channels, rate_hz, duration_ms, pre_ms, trigger }: Setup): Record<string, string | null> {
  return {
    ch: channels.map(textOfChannel).join(','),
    rate: String(rate_hz),
    ms: String(duration_ms),
    pre: String(pre_ms),
    trigger: trigger.kind === 'now' ? null : trigger.kind,
    tch: trigger.channel ? String(trigger.channel) : null,
    level: trigger.level === undefined ? null : String(trigger.level),
    slope: trigger.slope === 'falling' ? 'falling' : null,
    taxis: trigger.axis ?? (trigger.kind === 'fault' ? any : null),
    tstate: trigger.state ?? (trigger.kind === 'state' ? any : null),
  };
}

// A trigger goes on looking at the channel it looked at, as long as that is there.
export function without(setup: Setup, gone: number): Setup {
  const { channels, trigger } = setup;
  const { channel } = trigger;
  const moved = channel === undefined ? {} : { channel: channel === gone ? 0 : channel > gone ? channel - 1 : channel };
  return { ...setup, channels: channels.filter((_, i) => i !== gone), trigger: { ...trigger, ...moved } };
}

// What is shown when `range` of `x` (null: all of it) is made `factor` as long about its middle, or moved on by `share` of
// its length. Never more than there is; null again, when that is all.
export function zoomed(x: ArrayLike<number>, range: [number, number] | null, factor: number, share = 0): [number, number] | null {
  if (x.length < 2) return null;
  const [first, last] = [x[0], x[x.length - 1]];
  const [from, to] = range ?? [first, last];
  const length = Math.min((to - from) * factor, last - first);
  if (length >= last - first) return null;
  const begin = Math.max(first, Math.min(last - length, (from + to - length) / 2 + share * length));
  return [begin, begin + length];
}

// A recording's samples with their times, in ms after the trigger (after its begin if it had none).
export interface Samples {
  recording: Recording;
  x: Float64Array;
  interval_ms: number;
  values: Float64Array[];
}

export function samplesOf(recording: Recording, frame: Frame): Samples {
  const zero = recording.trigger_tick ?? recording.first_tick ?? frame.tick;
  const interval_ms = (1000 * frame.stride) / ticksPerSecond;
  const begin = (1000 * (frame.tick - zero)) / ticksPerSecond;
  const x = Float64Array.from({ length: frame.channels[0]?.length ?? 0 }, (_, i) => begin + i * interval_ms);
  return { recording, x, interval_ms, values: frame.channels };
}

export const same = (a: Channel, b: Channel) => a.axis === b.axis && a.name === b.name;
export const labelOf = ({ axis, name }: Channel) => `${axis} ${name}`;

// An earlier recording's curve at the times of another, so that both lie over each other; NaN where it has none.
export function alongside(x: Float64Array, other: Samples, values: Float64Array): Float64Array {
  return x.map((at) => valueAt(values, other.x[0], other.interval_ms, at));
}

// The samples from..to (not included) that lie between two times.
export function span(x: Float64Array, from: number, to: number): [number, number] {
  const first = lowerBound(x, Math.min(from, to));
  return [first, Math.max(first, lowerBound(x, Math.max(from, to) + 1e-9))];
}

function lowerBound(x: Float64Array, at: number): number {
  let low = 0;
  let high = x.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (x[middle] < at) low = middle + 1;
    else high = middle;
  }
  return low;
}
