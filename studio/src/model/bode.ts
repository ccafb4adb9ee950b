import type { Channel, ChannelRequest } from '../api/types';

// Frequency responses that the server computes from a recording (docs/bench-api.md, "Bode plots").

export interface BodePoint {
  hz: number;
  gain_db: number;
  phase_deg: number;
  coherence?: number;
}

export interface Bode {
  recording: number;
  input: Channel;
  output: Channel;
  points: BodePoint[];
  bandwidth_hz?: number | null; // of a closed loop, which is one whose input and output have the same unit
  open_loop?: {
    points: BodePoint[];
    crossover_hz: number | null;
    phase_margin_deg: number | null;
    gain_margin_hz: number | null;
    gain_margin_db: number | null;
  };
}

// Least coherence of a valid response; the server uses the same limit for bandwidth and margins.
export const leastCoherence = 0.7;
export const isCoherent = ({ coherence }: BodePoint) => coherence === undefined || coherence >= leastCoherence;

// The values of a curve: NaN, a gap, where noise dominates.
export const coherentValues = (points: readonly (BodePoint | null)[], of: (point: BodePoint) => number) => points.map((point) => (point && isCoherent(point) ? of(point) : NaN));

// What the page says of a plot with gaps; empty: it has none.
export const gapNote = (points: readonly BodePoint[]) => (points.every(isCoherent) ? '' : `Gain and phase are shown where the coherence is at least ${leastCoherence}: elsewhere noise dominates.`);

// The response at a frequency: linear interpolation over log(frequency). Null outside the points.
export function at(points: BodePoint[], hz: number): BodePoint | null {
  const after = points.findIndex((point) => point.hz >= hz);
  if (after < 0 || points.length === 0) return null;
  if (points[after].hz === hz) return points[after];
  if (after === 0) return null;
  const [a, b] = [points[after - 1], points[after]];
  const share = Math.log(hz / a.hz) / Math.log(b.hz / a.hz);
  const between = (from: number, to: number) => from + (to - from) * share;
  return {
    hz,
    gain_db: between(a.gain_db, b.gain_db),
    phase_deg: between(a.phase_deg, b.phase_deg),
    ...(a.coherence !== undefined && b.coherence !== undefined ? { coherence: between(a.coherence, b.coherence) } : {}),
  };
}

export type Excited = 'velocity' | 'torque' | 'position';

// Channels of a recording. The excited target is first, because the trigger uses the first channel. The others, which show
// the response, are used if the drive has them.
const wanted: Record<Excited, string[]> = {
  velocity: ['60FF:00', '606B:00', '606C:00', '6077:00', '6078:00'],
  torque: ['6071:00', '6074:00', '6077:00', '6078:00', '606C:00'],
  position: ['607A:00', '6062:00', '6064:00', '606C:00', '6077:00'],
};
const answers: Record<Excited, string> = { velocity: '606C:00', torque: '606C:00', position: '6064:00' };

export function channelsOf(axis: string, of: Excited, has: (object: string) => boolean): ChannelRequest[] {
  return wanted[of].filter(has).map((object) => ({ axis, object }));
}

// The channels that a plot shows at first: the excited target and its response, or else the recording's first two.
export function firstPlot(channels: ChannelRequest[]): [number, number] {
  for (const of of ['velocity', 'torque', 'position'] as const) {
    const input = channels.findIndex(({ object }) => object === wanted[of][0]);
    const output = channels.findIndex(({ object }) => object === answers[of]);
    if (input >= 0 && output >= 0) return [input, output];
  }
  return [0, Math.min(1, channels.length - 1)];
}

// One row for each frequency, with a column for the coherence if any point has a value for it.
export function csvOf(points: BodePoint[]): string {
  const coherent = points.some(({ coherence }) => coherence !== undefined);
  const rows = points.map(({ hz, gain_db, phase_deg, coherence }) => [hz, gain_db, phase_deg, ...(coherent ? [coherence ?? ''] : [])].join(','));
  return [`frequency_hz,gain_db,phase_deg${coherent ? ',coherence' : ''}`, ...rows, ''].join('\n');
}
