import { stepResponse } from '../model/measure';
import type { Samples } from '../model/scope';
import { fromDrive, toUser, type Kind, type Scale } from './mechanics';

// The figures of a recorded step or move, and its curves with few enough points for a report.

export interface PlotCurve {
  name: string;
  unit: string;
  values: (number | null)[];
}

export interface Measured {
  at: string; // time of the measurement, ISO 8601
  // Times are from 10 % of the way: rise to 90 %, settling until the value stays within 2 % of the way.
  rise_ms: number | null;
  overshoot_percent: number | null;
  settling_ms: number | null;
  peak_velocity: number | null; // in the user's unit
  greatest_error: number | null; // in the user's unit of position
  request: Record<string, number>; // in the drive's units
  x: number[]; // ms
  curves: PlotCurve[];
}

export interface Channel {
  object?: string;
  signal?: string;
  name: string;
  kind: Kind; // of its unit
  role: 'response' | 'demand' | 'error' | 'velocity';
}

const points = 240;

// `sign`: -1 if the way leads to smaller values.
export function measuredOf(samples: Samples, channels: Channel[], scale: Scale, request: Record<string, number>, at: string): Measured {
  const { x, values, interval_ms } = samples;
  const every = Math.max(1, Math.ceil(x.length / points));
  const user = (i: number) => values[i].map((value) => toUser(scale, channels[i].kind, fromDrive(scale, channels[i].kind, value)));
  const of = (role: Channel['role']) => channels.findIndex((channel) => channel.role === role);
  const greatest = (i: number) => (i < 0 ? null : user(i).reduce((most, value) => (Number.isFinite(value) ? Math.max(most, Math.abs(value)) : most), 0));
  const step = of('response') < 0 ? null : stepResponse(values[of('response')], interval_ms / 1000);
  const ms = (s: number | null | undefined) => (s === null || s === undefined ? null : 1000 * s);
  return {
    at,
    rise_ms: ms(step?.rise_s),
    overshoot_percent: step?.overshoot_percent ?? null,
    settling_ms: ms(step?.settling_s),
    peak_velocity: greatest(of('velocity')),
    greatest_error: greatest(of('error')),
    request,
    x: Array.from(x).filter((_, i) => i % every === 0).map((t) => Number(t.toFixed(3))),
    curves: channels.map((channel, i) => ({
      name: channel.name,
      unit: scale.unit[channel.kind],
      values: Array.from(user(i)).filter((_, k) => k % every === 0).map((value) => (Number.isFinite(value) ? Number(value.toPrecision(6)) : null)),
    })),
  };
}
