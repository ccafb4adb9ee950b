import type { AxisView, Geometry, Limits, Units } from '../api/types';
import { fixed } from './units';

// A move before it starts: the end position of the shaft, and whether the travel permits it.

export interface Ghost {
  to: number; // counts of the shaft
  text: string; // peak speed and time
}

// The end of a move in counts of the shaft. `value`: revolutions; 'to' counts from the zero of 6064h. Null: not known.
export function endOf(axis: AxisView, geometry: Geometry | undefined, units: Units | undefined, how: 'by' | 'to', value: number): number | null {
  const turn = geometry?.index_every;
  const { position_actual: actual } = axis;
  const perTurn = units?.position_per_revolution;
  if (!turn || !perTurn || !Number.isFinite(value) || (how === 'to' && actual === undefined)) return null;
  return axis.position_counts + (how === 'by' ? value : value - (actual ?? 0) / perTurn) * turn;
}

// The reason why the axis cannot reach the target: a limit of the travel or of 607Dh that is nearer. Empty: it can.
export function hindrance(axis: AxisView, geometry: Geometry | undefined, units: Units | undefined, limits: Limits | undefined, to: number): string {
  const turn = geometry?.index_every;
  if (!geometry || !turn) return '';
  const perTurn = units?.position_per_revolution;
  const { position_counts: from, position_actual: actual } = axis;
  const software = (user: number | null | undefined) =>
    user === null || user === undefined || !perTurn || actual === undefined ? null : from + ((user - actual) * turn) / perTurn;
  const forward = to > from;
  const ends: [number | null, string][] = forward
    ? [[software(limits?.highest_position), 'the software limit (607Dh)'], [geometry.positive_limit, 'the positive limit switch'], [geometry.positive_stop, 'the positive stop']]
    : [[software(limits?.lowest_position), 'the software limit (607Dh)'], [geometry.negative_limit, 'the negative limit switch'], [geometry.negative_stop, 'the negative stop']];
  const sign = forward ? 1 : -1;
  const nearest = ends.filter((end): end is [number, string] => end[0] !== null && (to - end[0]) * sign > 0).sort((a, b) => (a[0] - b[0]) * sign)[0] as [number, string] | undefined;
  if (!nearest) return '';
  const room = Math.max(0, (nearest[0] - from) * sign) / turn;
  return `The move of ${fixed(Math.abs(to - from) / turn, 2)} rev is longer than the ${fixed(room, 2)} rev to ${nearest[1]}.`;
}
