// CiA 402-2 (IEC 61800-7-201): power states and the names of the bits of controlword and statusword.
import type { AxisView, Words } from '../api/types';

export const states = [
  'not ready to switch on',
  'switch on disabled',
  'ready to switch on',
  'switched on',
  'operation enabled',
  'quick stop active',
  'fault reaction active',
  'fault',
] as const;
export type State = (typeof states)[number];

export interface Edge {
  number: number;
  from: State | 'start';
  to: State;
  name: string; // name of the command; empty: a transition that the drive makes by itself
}

// Figure "State machine of the power drive system". Transition 15 is the fault reset; the drive also makes 12 by itself.
export const edges: Edge[] = [
  { number: 0, from: 'start', to: 'not ready to switch on', name: '' },
  { number: 1, from: 'not ready to switch on', to: 'switch on disabled', name: '' },
  { number: 2, from: 'switch on disabled', to: 'ready to switch on', name: 'shutdown' },
  { number: 3, from: 'ready to switch on', to: 'switched on', name: 'switch on' },
  { number: 4, from: 'switched on', to: 'operation enabled', name: 'enable operation' },
  { number: 5, from: 'operation enabled', to: 'switched on', name: 'disable operation' },
  { number: 6, from: 'switched on', to: 'ready to switch on', name: 'shutdown' },
  { number: 7, from: 'ready to switch on', to: 'switch on disabled', name: 'disable voltage' },
  { number: 8, from: 'operation enabled', to: 'ready to switch on', name: 'shutdown' },
  { number: 9, from: 'operation enabled', to: 'switch on disabled', name: 'disable voltage' },
  { number: 10, from: 'switched on', to: 'switch on disabled', name: 'disable voltage' },
  { number: 11, from: 'operation enabled', to: 'quick stop active', name: 'quick stop' },
  { number: 12, from: 'quick stop active', to: 'switch on disabled', name: 'disable voltage' },
  { number: 13, from: 'operation enabled', to: 'fault reaction active', name: '' },
  { number: 14, from: 'fault reaction active', to: 'fault', name: '' },
  { number: 15, from: 'fault', to: 'switch on disabled', name: 'fault reset' },
  { number: 16, from: 'quick stop active', to: 'operation enabled', name: 'enable operation' },
];

export const isFault = (state: string | undefined) => state === 'fault' || state === 'fault reaction active';

// The reason why no motion may begin; empty: none. Every button that begins one is disabled then, and shows the reason.
export function motionHindrance(axis: Pick<AxisView, 'powered' | 'state' | 'problem'> | undefined): string {
  if (!axis) return 'There is no such axis.';
  if (axis.problem) return 'The drive does not answer.';
  if (!axis.powered) return 'The drive has no power: switch it on first.';
  return isFault(axis.state) ? 'The drive has a fault: clear it first.' : '';
}

// A transition by which the drive stops following its targets: the button of such a command acts when it is pressed.
export const isStop = (from: string | undefined, to: string) =>
  (from === 'operation enabled' || from === 'quick stop active') && to !== 'operation enabled';

export interface Bit {
  bit: number;
  name: string;
  on: boolean;
}

export const manufacturerSpecific = 'manufacturer-specific';
export const modeSpecific = 'mode-specific';

const controlNames = [
  'switch on', 'enable voltage', 'quick stop (0: stop)', 'enable operation', modeSpecific, modeSpecific, modeSpecific, 'fault reset', 'halt', modeSpecific, 'reserved',
];

// The mode of operation determines the meaning of bits 4 to 6 and 9 of the controlword.
const controlOfMode: Record<number, [string, string, string, string]> = {
  1: ['new set-point', 'change immediately', 'relative', 'change on set-point'],
  2: ['enable ramp', 'unlock ramp', 'reference ramp', ''],
  6: ['start homing', '', '', ''],
  7: ['enable interpolation', '', '', ''],
};

// Bits that are different on a product in a mode: product, mode, bit and name.
const controlOfProduct: [RegExp, number, number, string][] = [
  [/^ismk/, 1, 12, 'follow the target'], // iSMK manual, Table 5-4
  [/^ismk/, 4, 8, 'no effect in this mode'],
];

// `words`: the product's names, undefined until they are known. A bit that has a name in other modes only is mode-specific.
export function statusBits(word: number, mode = 0, words?: Words): Bit[] {
  const rows = words?.statusword ?? [];
  const nameOf = (bit: number) => {
    const ofBit = rows.filter((row) => row.bit === bit);
    const name = ofBit.find((row) => row.mode === mode || row.mode === undefined)?.name;
    return name || (ofBit.length > 0 || bit === 12 || bit === 13 ? modeSpecific : manufacturerSpecific);
  };
  return bits(word, Array.from({ length: 16 }, (_, bit) => nameOf(bit)));
}

export function controlBits(word: number, mode = 0, product = ''): Bit[] {
  const names = [...controlNames];
  const [bit4, bit5, bit6, bit9] = controlOfMode[mode] ?? ['', '', '', ''];
  names[4] = bit4 || modeSpecific;
  names[5] = bit5 || modeSpecific;
  names[6] = bit6 || modeSpecific;
  names[9] = bit9 || modeSpecific;
  names.push(...Array<string>(5).fill(manufacturerSpecific));
  for (const [of, inMode, bit, name] of controlOfProduct) if (inMode === mode && of.test(product)) names[bit] = name;
  return bits(word, names);
}

function bits(word: number, names: string[]): Bit[] {
  return names.map((name, bit) => ({ bit, name, on: ((word >> bit) & 1) === 1 }));
}

export const modeText = (mode: number | undefined, words?: Words) =>
  mode === undefined ? '' : (words?.modes[mode] ?? (mode < 0 ? `manufacturer-specific mode −${-mode}` : `mode ${mode}`));

export const hex = (value: number, digits: number) => value.toString(16).toUpperCase().padStart(digits, '0') + 'h';

// How urgent a state is for the user. Colour has no other meaning on the page.
export type Tone = 'quiet' | 'ready' | 'live' | 'warn' | 'bad';
export function toneOf(state: string | undefined): Tone {
  switch (state) {
    case 'operation enabled': return 'live';
    case 'switched on':
    case 'ready to switch on': return 'ready';
    case 'quick stop active': return 'warn';
    case 'fault reaction active':
    case 'fault': return 'bad';
    default: return 'quiet';
  }
}
