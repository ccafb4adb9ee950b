import type { Frame } from '../api/frame';
import { ticksPerSecond } from '../api/frame';
import type { Channel, ChannelRequest, Recording, Trigger } from '../api/types';
import { valueAt } from './measure';

// The settings of a recording. All are in the address of the page, so a reload or a copied link gives the same settings.

export interface Setup {
  channels: ChannelRequest[];
  rate_hz: number;
  duration_ms: number;
  pre_ms: number;
  trigger: Trigger;
}

// In the address: every axis, or every state of a trigger.
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

// The longest pre-trigger time: the server requires at least one sample that is not before the trigger.
export const longestBefore = (duration_ms: number, rate_hz: number) => Math.max(0, duration_ms - 1000 / rate_hz);

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

// The axis of a setup is that of its first channel.
export const axisOf = ({ channels }: Setup) => channels[0].axis;

// The same channels and trigger for another axis. Manufacturer-specific objects (below 6000h) exist on one product only: they are
// left out, and so are channels that would be there twice.
export function ofAxis(setup: Setup, to: string): Setup {
  const from = axisOf(setup);
  const isLeftOut = ({ axis, object }: ChannelRequest) => axis === from && object !== undefined && object < '6000';
  const kept: ChannelRequest[] = [];
  const places = setup.channels.map((channel) => {
    const moved = channel.axis === from ? { ...channel, axis: to } : channel;
    const text = textOfChannel(moved);
    const known = kept.findIndex((each) => textOfChannel(each) === text);
    if (isLeftOut(channel)) return null;
    return known >= 0 ? known : kept.push(moved) - 1;
  });
  const before: ChannelRequest[] = kept[0]?.axis === to ? [] : [{ axis: to, signal: 'position_counts' }];
  const { channel, axis } = setup.trigger;
  const place = channel === undefined ? null : places[channel];
  const trigger = {
    ...setup.trigger,
    ...(channel === undefined ? {} : { channel: typeof place === 'number' ? before.length + place : 0 }),
    ...(axis === from ? { axis: to } : {}),
  };
  return { ...setup, channels: [...before, ...kept].slice(0, mostChannels), trigger };
}

// The same signal of every axis, up to the greatest number of channels. Manufacturer-specific objects (below 6000h) exist on one product
// only.
export function ofAllAxes(setup: Setup, channel: ChannelRequest, axes: string[]): Setup {
  const known = new Set(setup.channels.map(textOfChannel));
  const more = axes.map((axis) => ({ ...channel, axis })).filter((each) => !known.has(textOfChannel(each)));
  return { ...setup, channels: [...setup.channels, ...more].slice(0, mostChannels) };
}

// The object of a typed address: "6064", "6064h", "0x6064", "6064:0". Null if the text is no address.
export function objectOf(text: string): string | null {
  const found = /^(?:0x)?([0-9a-f]{4})h?(?::([0-9a-f]{1,2})h?)?$/i.exec(text.trim());
  return found ? `${found[1].toUpperCase()}:${(found[2] ?? '0').toUpperCase().padStart(2, '0')}` : null;
}

// Removes the channel `gone`. The trigger keeps its channel; if that is the removed one, it uses channel 0.
export function without(setup: Setup, gone: number): Setup {
  const { channels, trigger } = setup;
  const { channel } = trigger;
  const moved = channel === undefined ? {} : { channel: channel === gone ? 0 : channel > gone ? channel - 1 : channel };
  return { ...setup, channels: channels.filter((_, i) => i !== gone), trigger: { ...trigger, ...moved } };
}

// The new visible range of `x` if `range` (null: all of `x`) becomes `factor` times as long about its middle and moves by
// `share` of its new length. The result stays within `x`; null if it is all of `x`.
export function zoomed(x: ArrayLike<number>, range: [number, number] | null, factor: number, share = 0): [number, number] | null {
  if (x.length < 2) return null;
  const [first, last] = [x[0], x[x.length - 1]];
  const [from, to] = range ?? [first, last];
  const length = Math.min((to - from) * factor, last - first);
  if (length >= last - first) return null;
  const begin = Math.max(first, Math.min(last - length, (from + to - length) / 2 + share * length));
  return [begin, begin + length];
}

// A recording's samples. `x` has their times in ms after the trigger, or after the begin of a recording without one.
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

export const isOver = ({ state }: Recording) => state === 'done' || state === 'stopped';
export const titleOf = ({ name, fault, id }: Recording) => name || (fault ? `Fault of ${fault.axis}` : `Recording ${id}`);

// The name of a file with the recording, without its ending: the name of the recording, with a hyphen for what some file system refuses.
export function fileNameOf({ name, id }: Pick<Recording, 'name' | 'id'>): string {
  const safe = name.normalize('NFC').replace(/[^\p{L}\p{M}\p{N}._]+/gu, '-').slice(0, 60).replace(/^[-.]+|[-.]+$/g, '');
  const isDevice = /^(con|prn|aux|nul|com\d|lpt\d)(\.|$)/i.test(safe); // Windows
  return safe === '' || isDevice ? `recording-${id}` : safe;
}

export const same = (a: Channel, b: Channel) => a.axis === b.axis && a.name === b.name;
export const labelOf = ({ axis, name }: Channel) => (axis === '' ? name : `${axis} ${name}`);

// The values of another recording, interpolated at the times `x`, for an overlay. NaN outside that recording.
export function alongside(x: Float64Array, other: Samples, values: Float64Array): Float64Array {
  return x.map((at) => valueAt(values, other.x[0], other.interval_ms, at));
}

// The indices of the samples between two times: the first, and the one after the last.
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
