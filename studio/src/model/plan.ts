import type { AxisView, Geometry, Limits, Units } from '../api/types';
import { fixed } from './units';

// A move before it starts: where it ends, and whether the way there is long enough. Moves are in revolutions of 6064h.

export interface Ghost {
  to: number; // counts of the shaft
  text: string; // peak speed and time
}

// What bounds the moves of an axis.
export interface Reach {
  geometry?: Geometry | undefined; // places of the switches and stops along the shaft; of a simulated axis
  units?: Units | undefined;
  limits?: Limits | undefined;
  polarity?: unknown; // 607Eh; no number: the drive does not have it
}

export type Move = { by: number } | { to: number };

// True if 6064h counts opposite to the shaft: bit 7 of 607Eh (CiA 402), or 1 in a drive whose 607Eh is 0 or 1.
export const isReversed = (polarity: unknown) => typeof polarity === 'number' && (polarity === 1 || (polarity & 0x80) !== 0);
export const slack = 0.01; // rev: a move to a switch itself may stand some counts beyond it, as on the server
const signOf = ({ polarity }: Reach) => (isReversed(polarity) ? -1 : 1);

// A position of 6064h in revolutions from the present one. Of a drive on a bus only 6064h is known, in `position_counts`.
function fromHere({ position_actual, position_counts }: AxisView, { geometry, units }: Reach, position: number | null | undefined): number | null {
  const now = position_actual ?? (geometry ? undefined : position_counts);
  const perTurn = units?.position_per_revolution;
  return now === undefined || !perTurn || typeof position !== 'number' ? null : (position - now) / perTurn;
}

// An absolute target of an axis that wraps around is reached within the range, as the drive does it.
function within(position: number, range: [number, number] | null | undefined): number {
  if (!range) return position;
  const length = range[1] - range[0] + 1;
  return range[0] + ((((position - range[0]) % length) + length) % length);
}

function distanceOf(axis: AxisView, reach: Reach, move: Move): number | null {
  const perTurn = reach.units?.position_per_revolution;
  const distance = !perTurn ? null : 'by' in move ? move.by : fromHere(axis, reach, within(move.to * perTurn, reach.limits?.wraps_within));
  return distance !== null && Number.isFinite(distance) ? distance : null;
}

// The end of a move in counts of the shaft. Null: not known.
export function endOf(axis: AxisView, reach: Reach, move: Move): number | null {
  const distance = distanceOf(axis, reach, move);
  const turn = reach.geometry?.index_every;
  return distance === null || !turn ? null : axis.position_counts + signOf(reach) * distance * turn;
}

// A place of the shaft as a position of 6064h, in revolutions. Null: not known.
export function positionAt(axis: AxisView, reach: Reach, counts: number): number | null {
  const turn = reach.geometry?.index_every;
  const zero = fromHere(axis, reach, 0);
  return zero === null || !turn ? null : -zero + (signOf(reach) * (counts - axis.position_counts)) / turn;
}

// The reason why the axis cannot make the move: a limit of 607Dh or of the travel that is nearer. Empty: it can.
// `text` gives a distance in the units of the page.
export function hindrance(axis: AxisView, reach: Reach, move: Move, text = (turns: number) => `${fixed(turns, 2)} rev`): string {
  const { limits } = reach;
  const geometry = limits?.wraps_within ? undefined : reach.geometry;
  const distance = distanceOf(axis, reach, move);
  if (distance === null || distance === 0) return '';
  const turn = geometry?.index_every;
  const onShaft = (counts: number | null | undefined) => (turn && typeof counts === 'number' ? (signOf(reach) * (counts - axis.position_counts)) / turn : null);
  const side = distance * signOf(reach) > 0 ? 'positive' : 'negative'; // of the shaft
  const ends: [number | null, string, number][] = [
    [fromHere(axis, reach, distance > 0 ? limits?.highest_position : limits?.lowest_position), 'the software limit (607Dh)', 0],
    [onShaft(geometry?.[`${side}_limit`]), `the ${side} limit switch`, slack],
    [onShaft(geometry?.[`${side}_stop`]), `the ${side} stop`, slack],
  ];
  const sign = Math.sign(distance);
  const isPassed = (end: (typeof ends)[number]): end is [number, string, number] => end[0] !== null && (distance - end[0]) * sign > end[2];
  const nearest = ends.filter(isPassed).sort((a, b) => (a[0] - b[0]) * sign)[0] as [number, string, number] | undefined;
  const length = `The move of ${text(Math.abs(distance))}`;
  if (nearest) return `${length} is longer than the ${text(Math.max(0, nearest[0] * sign))} to ${nearest[1]}.`;
  // An axis beyond a software limit moves back, but only to within the limits: the drive shortens or refuses other targets.
  const limitBehind = fromHere(axis, reach, distance > 0 ? limits?.lowest_position : limits?.highest_position);
  const isShort = limitBehind !== null && (distance - limitBehind) * sign < -1e-9;
  return isShort ? `${length} is shorter than the ${text(limitBehind * sign)} back to the software limit (607Dh).` : '';
}
