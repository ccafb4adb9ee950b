import { axes } from '../line';

// What the monkey does, drawn from a seed.

export interface Step {
  kind: string;
  u: [number, number, number]; // in 0 .. 1: which of the controls, which value, how long
}

export interface Sequence {
  seed: number;
  start: string; // address
  isEnabled: boolean; // all axes are enabled at the beginning
  before_ms: number; // slow network
  after_ms: number;
  steps: Step[];
}

// A small generator of random numbers in 0 .. 1 (mulberry32).
export function random(seed: number): () => number {
  let state = seed >>> 0;
  return () => {
    state = (state + 0x6d2b79f5) >>> 0;
    let t = state;
    t = Math.imul(t ^ (t >>> 15), t | 1);
    t ^= t + Math.imul(t ^ (t >>> 7), t | 61);
    return ((t ^ (t >>> 14)) >>> 0) / 2 ** 32;
  };
}

const weights: Record<string, number> = {
  motion: 26, command: 12, any: 14, hold: 9, release: 3, stop: 4, 'stop key': 3, go: 8, back: 2, type: 6, key: 10, focus: 4, wait: 8, blur: 2, reload: 0.7, tab: 1.5,
};

function pick<T>(u: number, table: readonly (readonly [T, number])[]): T {
  let left = u * table.reduce((sum, [, weight]) => sum + weight, 0);
  for (const [value, weight] of table) {
    left -= weight;
    if (left < 0) return value;
  }
  return table[table.length - 1][0];
}

export const of = (u: number, count: number) => Math.min(count - 1, Math.floor(u * count));

const guideSteps = ['find', 'units', 'inputs', 'direction', 'torque', 'velocity', 'position', 'homing', 'limits', 'cycle', 'store', 'report'];
const movingSteps = ['direction', 'velocity', 'position', 'homing', 'cycle'];

// The job `tune` needs the rated torque, 6076h, which ISMC and ProNet do not have: there it fails before it moves.
const measurable = ['reference', 'ismk', 'jmc'];

export function address(u: () => number): string {
  const { name } = axes[of(u(), axes.length)];
  const more = u();
  return pick(u(), [
    ['/', 8], [`/axis/${name}`, 10], [`/axis/${name}?do=velocity`, 9], [`/axis/${name}?do=torque`, 5], [`/axis/${name}?do=jog`, 12], [`/axis/${name}?do=home`, 8],
    ['/boards', 12], [`/tuning/${name}`, 2], [`/tuning/${measurable[of(more, measurable.length)]}`, 3], [`/commission/${name}?step=${movingSteps[of(more, movingSteps.length)]}`, 12], [`/commission/${name}?step=${guideSteps[of(more, guideSteps.length)]}`, 2],
    ['/scope', 10], [`/faults/${name}`, 2], [`/objects/${name}`, 2], [`/objects/${name}?view=parameters`, 1], [`/objects/${name}?view=pdos`, 1], [`/plant/${name}`, 2], ['/bus', 1], ['/bus/traffic', 1],
  ]);
}

// All of a sequence is drawn before it begins, so its beginning is the same for any number of its steps.
export function draw(seed: number): Sequence {
  const u = random(seed);
  const table = Object.entries(weights);
  return {
    seed,
    start: address(u),
    isEnabled: u() < 0.7,
    before_ms: pick(u(), [[0, 6], [60, 1], [150, 1]]),
    after_ms: pick(u(), [[0, 6], [60, 1], [150, 1]]),
    steps: Array.from({ length: 5 + of(u(), 8) }, () => ({ kind: pick(u(), table), u: [u(), u(), u()] })),
  };
}
