import type { BodePoint } from './bode';

// The results of the server's jobs "tune" and "tune_itself" (docs/bench-api.md, "Jobs").

export interface GainLine {
  object: string; // "60F9:01"
  set: string;
  does: string;
}

export interface Gains {
  gains: GainLine[];
  measures: boolean; // the server can sample this drive at a fixed rate
  writes: boolean; // the server can write the proposed gains into this drive
  tunes_itself: boolean;
  velocity_mode: number; // of operation, in which the job "tune" measures
  full_torque: string; // what the torque limit is a percentage of: "rated torque", "peak current"
}

// Why the job "tune" cannot measure this drive; empty: it can. `has` tells whether the drive has an object.
export function missingForTune(gains: Gains, product: string, has: (object: string) => boolean): string {
  if (!gains.measures) return 'The measurement needs process data at a fixed rate, which this connection does not have: use the drive’s CAN or EtherCAT port.';
  if (!gains.writes && !has('6076:00')) return `${product} has no object 6076h (rated torque), which the measurement needs: measure a step instead.`;
  return '';
}

export interface GainChange {
  object: string;
  name: string;
  unit: string;
  before: number;
  after: number;
}

export interface LoopMeasured {
  bandwidth_hz: number | null;
  crossover_hz: number | null;
  phase_margin_deg: number | null;
  gain_margin_db: number | null;
  inertia: number;
  inertia_unit: string;
  friction: number;
  constant_load: number;
  torque_unit: string;
  loop_delay_ms: number;
  antiresonance_hz?: number;
  resonance_hz?: number;
  open_loop: BodePoint[];
  closed_loop: BodePoint[];
}

export interface StepMeasured {
  rise_ms: number;
  overshoot_percent: number;
  settling_ms: number;
  sample_ms: number;
  velocity: number[];
}

export interface Tuned {
  changes?: string; // what became better and what became worse
  note?: string; // what a proposal would make slower, or that nothing was measured
  position_gain?: { before: number | null; after: number; unit: string };
  result: 'proposed' | 'applied' | 'tuned by the drive itself';
  gains: GainChange[];
  promised_bandwidth_hz?: number;
  predicted?: { bandwidth_hz: number; phase_margin_deg: number | null };
  si?: { velocity_kp: number; velocity_ki: number; position_kp: number };
  before?: LoopMeasured;
  after?: LoopMeasured;
  step_before?: StepMeasured;
  step_after?: StepMeasured;
}

export const placeOf = (object: string): [number, number] => {
  const [index, sub] = object.split(':');
  return [parseInt(index, 16), parseInt(sub, 16)];
};

// Groups gains by their set; the sets are in the order of their first gain.
export function setsOf(gains: GainLine[]): [string, GainLine[]][] {
  const sets = new Map<string, GainLine[]>();
  for (const gain of gains) sets.set(gain.set, [...(sets.get(gain.set) ?? []), gain]);
  return [...sets];
}

export interface Figure {
  label: string;
  unit: string;
  digits: number;
  before: number | null | undefined;
  promised?: number | null | undefined;
  after: number | null | undefined;
}

// The rows of the comparison of before and after. Rows without any number are omitted.
export function figuresOf({ result, before, after, step_before, step_after, predicted, promised_bandwidth_hz, position_gain }: Tuned): Figure[] {
  const rows: Figure[] = [
    { label: 'Bandwidth, closed loop, -3 dB', unit: 'Hz', digits: 1, before: before?.bandwidth_hz, promised: promised_bandwidth_hz, after: after?.bandwidth_hz },
    { label: 'Crossover, open loop, 0 dB', unit: 'Hz', digits: 1, before: before?.crossover_hz, after: after?.crossover_hz },
    { label: 'Phase margin', unit: '°', digits: 0, before: before?.phase_margin_deg, promised: predicted?.phase_margin_deg, after: after?.phase_margin_deg },
    { label: 'Gain margin', unit: 'dB', digits: 1, before: before?.gain_margin_db, after: after?.gain_margin_db },
    { label: 'Step: rise time', unit: 'ms', digits: 1, before: step_before?.rise_ms, after: step_after?.rise_ms },
    { label: 'Step: overshoot', unit: '%', digits: 0, before: step_before?.overshoot_percent, after: step_after?.overshoot_percent },
    { label: 'Step: settling time (5 %)', unit: 'ms', digits: 0, before: step_before?.settling_ms, after: step_after?.settling_ms },
    { label: 'Position gain', unit: position_gain?.unit ?? '', digits: 1, before: position_gain?.before, promised: position_gain?.after, after: result === 'applied' ? position_gain?.after : undefined },
  ];
  return rows.filter((row) => [row.before, row.promised, row.after].some((value) => typeof value === 'number'));
}
