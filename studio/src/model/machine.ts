import type { AxisView, Mechanics } from '../api/types';
import { isFault } from './cia402';

// The machine of the line file: the load of each axis, and the axes of a large line that are shown.

// The angle in turns, from 0 to below 1: of the motor of a rotary axis, of the arm, or of the crank.
export function turnsOf({ kind, counts_per_revolution, cycle_revolutions, cycle_offset_turns }: Mechanics, position_counts: number): number {
  const revolutions = position_counts / counts_per_revolution;
  const turns = kind === 'arm' || kind === 'crank' ? revolutions / cycle_revolutions + cycle_offset_turns : revolutions;
  return turns - Math.floor(turns);
}

// The place of the slider of a crank in its stroke, from 0 (near) to 1 (far), at an angle in turns. With a ratio of 0 the rod is
// infinitely long, and the slider's motion is a sine.
export function sliderAt(turns: number, ratio: number): number {
  const angle = 2 * Math.PI * turns;
  if (ratio === 0) return (1 + Math.cos(angle)) / 2;
  const rod = 1 / ratio;
  return (Math.cos(angle) + Math.sqrt(rod ** 2 - Math.sin(angle) ** 2) - (rod - 1)) / 2;
}

export function describe({ kind, hangs, belt, elastic }: Mechanics): string {
  const coupling = belt ? 'by a belt' : elastic ? 'elastic coupling' : '';
  return [kind, coupling, hangs && 'hanging load'].filter(Boolean).join(', ');
}

export const coupledWith = ({ coupled = [] }: AxisView) => (coupled.length > 0 ? `coupled with ${coupled.join(', ')}` : '');

// The coupled axes in pairs, each pair once, in the order of the line.
export function pairsOf(order: string[], axes: Record<string, AxisView>): [string, string][] {
  return order.flatMap((name, i) => (axes[name]?.coupled ?? []).filter((other) => order.indexOf(other) > i).map((other): [string, string] => [name, other]));
}

// The sides of a gantry turn in opposite directions if the motors face each other: then one of the two rails is drawn mirrored.
export const isMirrored = (mechanics: Mechanics | undefined) => (mechanics?.coupling?.ratio ?? 1) < 0;

export const manyAxes = 16; // a line with at least this number of axes is shown in rows

export const stateFilters = [
  ['', 'Any state'], ['enabled', 'Enabled'], ['ready', 'Not enabled'], ['moving', 'In motion'], ['fault', 'Fault'], ['off', 'No power'], ['silent', 'No answer'],
] as const;
export type StateFilter = (typeof stateFilters)[number][0];

const inState: Record<StateFilter, (axis: AxisView) => boolean> = {
  '': () => true,
  enabled: ({ powered, state }) => powered && state === 'operation enabled',
  ready: ({ powered, state }) => powered && state !== 'operation enabled',
  moving: ({ in_motion }) => in_motion === true,
  fault: ({ powered, state }) => powered && isFault(state),
  off: ({ powered, problem }) => !powered && problem === undefined,
  silent: ({ problem }) => problem !== undefined,
};

export interface Filter {
  text: string;
  state: StateFilter;
  bus: string; // '': any
}

export function filterOf(query: URLSearchParams): Filter {
  const state = stateFilters.find(([id]) => id === query.get('state'))?.[0] ?? '';
  return { text: query.get('q') ?? '', state, bus: query.get('bus') ?? '' };
}

// The names of the axes that match the filters, in the order of the line.
export function fitting(order: string[], axes: Record<string, AxisView>, { text, state, bus }: Filter): string[] {
  const words = text.toLowerCase().split(/\s+/).filter(Boolean);
  return order.filter((name) => {
    const axis = axes[name];
    if (!axis || !inState[state](axis) || (bus !== '' && axis.bus !== bus && axis.serial?.bus !== bus)) return false;
    const all = `${name} ${axis.product} ${axis.bus ?? ''} ${axis.serial?.bus ?? ''}`.toLowerCase();
    return words.every((word) => all.includes(word));
  });
}

// The visible part of a list of rows of equal height, with some rows above and below it.
export function visibleRows(top: number, height: number, row_px: number, count: number, beyond = 6): [number, number] {
  const first = Math.max(0, Math.min(count, Math.floor(top / row_px) - beyond));
  return [first, Math.max(first, Math.min(count, Math.ceil((top + height) / row_px) + beyond))];
}
