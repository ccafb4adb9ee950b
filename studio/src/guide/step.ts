import type { AxisView, Geometry, Limits, ObjectEntry, ObjectValue, Units } from '../api/types';
import { rangeOf } from '../model/bases';
import { showNumber } from '../model/number';
import type { Reach } from '../model/plan';
import type { Gains } from '../model/tuning';
import { significant } from '../model/units';
import type { HomingView } from '../parts/reach';
import { lost, standingOf, type Journal, type PowerOn, type Written } from './journal';
import type { Channel } from './measured';
import { fromDrive, fromUser, toDrive, toUser, type Kind, type Mechanics, type Scale } from './mechanics';
import type { StepState } from './state';

// The type of a row of the table of steps (steps.ts), and the arguments of its functions.

export interface Facts {
  axis: AxisView;
  isVirtual: boolean;
  entries: ReadonlyMap<string, ObjectEntry>; // the dictionary, by address
  values: Record<string, ObjectValue>; // present values of the objects that the step uses
  mechanics: Mechanics;
  scale: Scale | null; // null: the size of the drive's units is not known
  units: Units | undefined;
  limits: Limits | undefined;
  geometry: Geometry | undefined;
  polarity: unknown; // 607Eh; no number: the drive does not have it
  homing: HomingView | undefined;
  gains: Gains | undefined;
  proposed: Record<string, number>; // gains that a measurement has proposed, by object
  journal: Journal;
  powerOn: PowerOn;
}

// A number of the form. It is typed in the user's units, kept in revolutions of the motor or, without a kind, in the
// drive's own units, and written to each of `objects` that the drive has.
export interface Field {
  key: string;
  label: string;
  kind?: Kind;
  unit?: string; // without a kind
  objects?: string[];
  usual: number; // NaN: none is proposed
  minimum?: number; // as kept
  maximum?: number;
  least?: { size: number; why: string }; // size of a number of either sign, as kept
  isWhole?: boolean;
  options?: (readonly [number, string, string?])[]; // value, text, and why it cannot be chosen
  mayBeEmpty?: boolean;
  group?: string; // heading above the field and those that follow
  isGain?: boolean; // written on its own: a motion can be measured before and after
}

export type Numbers = (key: string) => number; // as kept

export interface Order extends Record<string, unknown> {
  do: string;
}

export interface Motion {
  id: string;
  label: string;
  says: string; // text: the motion and its limits
  orders: (numbers: Numbers, facts: Facts) => Order[];
  begins: string[]; // jobs that come first
  commands: string[]; // objects that the jobs command
  mode: (facts: Facts) => number; // of operation, in which the jobs leave the drive
  passes?: number[]; // modes that the jobs set before that one
  reach?: (numbers: Numbers) => number[]; // the farthest positions, in revolutions from the present one
  records?: (numbers: Numbers, facts: Facts) => Records;
  isMissing?: (facts: Facts) => string; // why this drive cannot do it
}

export interface Records {
  channels: Channel[];
  level: number; // of channel 0, in the drive's units, that triggers
  duration_ms: number;
  pre_ms: number;
  end_ms?: number; // after the trigger: samples beyond it are no part of the measurement
  rate_hz: number;
  request: Record<string, number>; // in the drive's units, for the report
  sign: number;
}

export interface Step {
  id: string;
  title: string;
  why: string;
  reads: string[]; // objects, with sub-index "*" for all
  also?: (facts: Facts) => string[]; // further objects to read, of those that the drive has
  view?: 'find' | 'identify' | 'units' | 'inputs' | 'direction' | 'loop' | 'response' | 'homing' | 'store' | 'report';
  fields?: (facts: Facts, state: StepState) => Field[];
  motions?: Motion[];
  lacks?: (facts: Facts) => string; // why the step cannot be done with this drive; empty: it can
  refuses?: (facts: Facts, state: StepState) => string; // why the values of the form are not written; empty: they may be
  check: string | ((facts: Facts, state: StepState) => string); // what is true when the step is complete
  open: (facts: Facts, state: StepState) => string; // the condition that is not met yet; empty: the step is complete
}

// What bounds the moves; the units are those that the user has typed, if the drive reports none.
export const reachOf = ({ geometry, units, scale, limits, polarity }: Facts): Reach => ({
  geometry, limits, polarity, units: units?.position_per_revolution || !scale ? units : { position_per_revolution: scale.drive.position, velocity_per_rps: scale.drive.velocity, acceleration_per_rps2: scale.drive.acceleration },
});

export const placeOf = (object: string): [number, number] => [parseInt(object.slice(0, 4), 16), parseInt(object.slice(5), 16)];

export const has = (facts: Facts, object: string) => facts.entries.has(object);

export const standingIn = ({ journal, values, powerOn }: Facts, entry: Written) => standingOf(journal, entry, values[entry.object], powerOn);

// Gains that a step has written and that are not in the drive any more, for example after a power cut; empty: there are none.
export function lostGains(facts: Facts, step: string): string {
  const gone = facts.journal.filter((entry) => entry.step === step && facts.gains?.gains.some(({ object }) => object === entry.object) && [lost, 'changed by another'].includes(standingIn(facts, entry)));
  return gone.length === 0 ? '' : `Not in the drive any more: ${gone.map(({ object, after }) => `${object} = ${after}`).join(', ')}. Write it again, or undo this step.`;
}

// The first of `sets` whose objects the drive has; an empty list if it has none of the sets.
export const firstOf = (facts: Facts, sets: string[][]) => sets.find((set) => set.every((object) => has(facts, object))) ?? [];

export const keptOf = (state: StepState, fields: Field[]): Numbers => (key) => state.typed[key] ?? fields.find((field) => field.key === key)?.usual ?? NaN;

export interface PlanRow {
  object: string;
  name: string;
  unit: string;
  before: number;
  after: number;
}

const inDrive = ({ scale }: Facts, kind: Kind | undefined, kept: number) => (kind === undefined ? kept : scale ? toDrive(scale, kind, kept) : NaN);

// The objects of the fields that the drive has, each with the value of the form and the value in the drive.
const targetsOf = (facts: Facts, fields: Field[], numbers: Numbers) =>
  fields.flatMap(({ key, label, kind, objects = [] }) => objects.flatMap((object) => {
    const entry = facts.entries.get(object);
    return entry ? [{ object, label, entry, before: facts.values[object], after: inDrive(facts, kind, numbers(key)) }] : [];
  }));

// The values that a step would write: those of its fields that differ from the drive's.
export const planOf = (facts: Facts, fields: Field[], numbers: Numbers): PlanRow[] =>
  targetsOf(facts, fields, numbers).flatMap(({ object, entry: { name, unit }, before, after }) =>
    typeof before !== 'number' || !Number.isFinite(after) || before === after ? [] : [{ object, name, unit, before, after }]);

// Why the drive does not have the values of the form; empty: it has them.
export function notInDrive(facts: Facts, fields: Field[], numbers: Numbers): string {
  const targets = targetsOf(facts, fields, numbers);
  const empty = targets.find(({ after }) => !Number.isFinite(after));
  if (empty) return `Not entered yet: ${empty.label}.`;
  const missing = targets.filter(({ before, after }) => before !== after);
  return missing.length === 0 ? '' : `Not in the drive: ${missing.map(({ object, after }) => `${object} = ${after}`).join(', ')}.`;
}

// The limits of a field as kept: its own ones, and those of the objects to which it is written.
function limitsOf(facts: Facts, { kind, objects = [], minimum = -Infinity, maximum = Infinity, isWhole = false }: Field) {
  const limits = { minimum, maximum, isWhole, where: '' };
  for (const object of objects) {
    const entry = facts.entries.get(object);
    if (!entry) continue;
    const range = rangeOf(entry.type);
    limits.isWhole ||= range !== undefined && kind === undefined;
    limits.minimum = Math.max(limits.minimum, keptFromDrive(facts, kind, Math.max(entry.minimum ?? -Infinity, range?.[0] ?? -Infinity)));
    limits.maximum = Math.min(limits.maximum, keptFromDrive(facts, kind, Math.min(entry.maximum ?? Infinity, range?.[1] ?? Infinity)));
    limits.where += `${limits.where ? ', ' : ' ('}${object}`;
  }
  return { ...limits, where: limits.where && `${limits.where})` };
}

// Rounds a limit inwards to ten digits, so that the number that the page shows is within the limit.
function inward(limit: number, to: 'floor' | 'ceil'): number {
  if (Number.isInteger(limit)) return limit;
  const unit = 10 ** (Math.floor(Math.log10(Math.abs(limit))) - 9);
  return Number((Math[to](limit / unit + (to === 'floor' ? 1e-5 : -1e-5)) * unit).toPrecision(10));
}

// Why the number of a field, in the units of the step, is refused; empty: it is not.
export function refusalOf(facts: Facts, field: Field, value: number): string {
  const { kind } = field;
  if (!Number.isFinite(value) || (kind !== undefined && !facts.scale)) return '';
  const shown = Number(value.toPrecision(12)); // without the rounding of the conversion
  const { minimum, maximum, isWhole, where } = limitsOf(facts, field);
  const unit = shownUnit(facts, field);
  const [least, most] = [inward(toShown(facts, kind, minimum), 'ceil'), inward(toShown(facts, kind, maximum), 'floor')];
  const text = (limit: number) => `${showNumber(limit)}${unit && ` ${unit}`}${where}.`;
  if (shown < least) return `At least ${text(least)}`;
  if (shown > most) return `At most ${text(most)}`;
  const size = field.least ? inward(toShown(facts, kind, field.least.size), 'ceil') : 0;
  if (field.least && Math.abs(shown) < size) return `At least ${showNumber(size)}${unit && ` ${unit}`}, forward or back: ${field.least.why}.`;
  return isWhole && !Number.isInteger(shown) ? `A whole number${where}.` : '';
}

// The first number of the form that is refused, with its reason; empty: none.
export function refusedIn(facts: Facts, fields: Field[], numbers: Numbers): string {
  for (const field of fields) {
    const refusal = field.options ? '' : refusalOf(facts, field, toShown(facts, field.kind, numbers(field.key)));
    if (refusal) return `${field.label}: ${refusal}`;
  }
  return '';
}

export const shownUnit = ({ scale }: Facts, { kind, unit = '' }: Field) => (kind === undefined ? unit : (scale?.unit[kind] ?? ''));
export const toShown = ({ scale }: Facts, kind: Kind | undefined, kept: number) => (kind === undefined ? kept : scale ? toUser(scale, kind, kept) : NaN);
export const fromShown = ({ scale }: Facts, kind: Kind | undefined, shown: number) => (kind === undefined ? shown : scale ? fromUser(scale, kind, shown) : NaN);
export const keptFromDrive = ({ scale }: Facts, kind: Kind | undefined, value: number) => (kind === undefined ? value : scale ? fromDrive(scale, kind, value) : NaN);
export const positionText = (facts: Facts, turns: number | null) => (turns === null || !facts.scale ? '–' : `${significant(turns * facts.scale.user.position)} ${facts.scale.unit.position}`);
