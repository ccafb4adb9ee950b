import { useSyncExternalStore } from 'react';
import type { Problem } from '../api/types';
import { listenToTexts, readText, writeText } from '../storage';
import type { Journal } from './journal';
import type { Measured } from './measured';
import { noMechanics, type Mechanics } from './mechanics';

// The state of the guide for one axis, in the storage of the page (storage.ts): it survives a reload, and all tabs share it.

export interface StepState {
  mark?: 'done' | 'skipped';
  typed: Record<string, number>; // by key of the field: revolutions of the motor, per second, per second squared; or the drive's units
  found: Found;
}

export interface Moved {
  asked: number; // revolutions of the motor
  drive: number; // by 6064h
  shaft: number | null; // true shaft of a simulated axis
}

export interface LoopFound {
  bandwidth_hz: number | null;
  phase_margin_deg: number | null;
  inertia: string;
  friction: string;
  resonance_hz: number | null;
}

export interface Proposed {
  bandwidth_hz: number | null;
  phase_margin_deg: number | null;
  values: Record<string, number>; // by object
}

export interface Found {
  agrees?: boolean; // with the nameplate, as the person says
  seen?: Record<string, [boolean, boolean]>; // inputs: seen at 0, seen at 1
  notWired?: string[]; // inputs of a drive on a bus, as the person says
  way?: 'right' | 'wrong';
  moved?: Moved;
  first?: Measured; // before a change of the gains
  last?: Measured; // the newest one after `first`
  loop?: LoopFound; // before
  loopLast?: LoopFound;
  proposed?: Proposed;
  homedBy?: number; // method
  stored?: { stored: boolean; lost: string[] };
  saved?: boolean; // the report: as a file, or as the person says
}

// A sequence of jobs that the guide began.
export interface Run {
  id: string;
  step: string;
  motion: string;
  jobs: number[]; // those that have begun
  of: number; // how many there are
  state: 'running' | 'done' | 'failed' | 'interrupted';
  error?: Problem;
  hadNoPower?: boolean; // at its end
  recording?: number;
  start?: string; // the run of the server whose numbers `jobs` and `recording` are
  from: { drive: number; shaft: number | null };
  mode?: number; // of operation, in which its jobs leave the drive
  modeBefore?: number; // 6060h before the first job
  values: Record<string, number>; // the numbers of the form when it began
}

export interface Guide {
  version: 1;
  product: string;
  mechanics: Mechanics;
  steps: Record<string, StepState | undefined>;
  journal: Journal;
  run: Run | null;
  stored?: Record<string, number>; // values of the journal's objects at the last storing in the drive
}

export const noStep: StepState = { typed: {}, found: {} };
const prefix = 'servodrome.guide.';
const fresh = (product: string): Guide => ({ version: 1, product, mechanics: noMechanics, steps: {}, journal: [], run: null });

const known = new Map<string, { text: string | null; guide: Guide }>();
// Null: the text is of another drive that had the axis's name, or of another version of the page.
function parse(text: string, product: string): Guide | null {
  try {
    const guide = JSON.parse(text) as Guide | null;
    return guide?.version === 1 && guide.product === product ? guide : null;
  } catch {
    return null;
  }
}

export function guideOf(axis: string, product: string): Guide {
  const text = readText(prefix + axis);
  const before = known.get(axis);
  if (before?.text === text && before.guide.product === product) return before.guide;
  const guide = (text === null ? null : parse(text, product)) ?? fresh(product);
  known.set(axis, { text, guide });
  return guide;
}

export function change(axis: string, product: string, to: (guide: Guide) => Guide): void {
  const guide = to(guideOf(axis, product));
  const text = JSON.stringify(guide);
  const old = readText(prefix + axis);
  if (old !== null && !parse(old, product)) writeText(`${prefix}${axis}.before`, old); // so that it is not lost
  known.set(axis, { text, guide });
  writeText(prefix + axis, text);
}

export function forgetGuide(axis: string): void {
  writeText(prefix + axis, null);
}

export const useGuide = (axis: string, product: string) => useSyncExternalStore(listenToTexts, () => guideOf(axis, product));

export const stepOf = (guide: Guide, step: string): StepState => guide.steps[step] ?? noStep;

export function changeStep(axis: string, product: string, step: string, to: (state: StepState) => StepState): void {
  change(axis, product, (guide) => ({ ...guide, steps: { ...guide.steps, [step]: to(stepOf(guide, step)) } }));
}
