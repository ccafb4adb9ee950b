import type { ObjectEntry } from '../api/types';
import { manufacturerSpecific, modeSpecific, type State } from './cia402';
import { addressOf } from './objects';

// What states, bits and objects mean, in short, and the place in the standard or in the product's manual.

const standard = 'CiA 402-2 (IEC 61800-7-201)';

// The manuals (docs/manuals.md), and where they explain controlword and statusword.
interface Manual {
  of: RegExp; // the products
  title: string;
  controlword: string;
  statusword: string;
}
const manuals: Manual[] = [
  { of: /^ismc/, title: 'ISMC servo drive CANopen Application Manual, V1.6', controlword: 'Table 3-4', statusword: 'Table 3-7' },
  { of: /^pronet/, title: 'ProNet CANOpen User\'s Manual, V1.04', controlword: 'ch. 6.2.1', statusword: 'ch. 6.2.2' },
  { of: /^ismk/, title: 'iSMK integrated servo user manual', controlword: 'Table 5-4', statusword: 'Table 5-5' },
  { of: /^jmc/, title: 'JMC EC Series Drives User\'s Manual, V1.42', controlword: 'Table 153', statusword: 'Tables 156, 222, 239, 250 and 264, Chart 273' },
];
const manualOf = (product: string) => manuals.find(({ of }) => of.test(product));

export const stateMeanings: Record<State, string> = {
  'not ready to switch on': 'The drive initialises itself. It has no torque and takes no commands; it leaves this state by itself.',
  'switch on disabled': 'The drive can be configured. It has no torque, and the main voltage may be off. Shutdown (transition 2) leads to Ready to switch on.',
  'ready to switch on': 'The main voltage may be applied. The drive has no torque. Switch on (transition 3) leads to Switched on.',
  'switched on': 'The main voltage is there and the power stage is ready. The drive has no torque. Enable operation (transition 4) leads to Operation enabled.',
  'operation enabled': 'The power stage is on: the motor has torque and obeys the mode of operation.',
  'quick stop active': 'The quick stop was commanded: the axis brakes as 605Ah says, or is held at rest. The power stage is on.',
  'fault reaction active': 'The drive has found a fault and brakes as 605Eh says. It goes to Fault by itself.',
  fault: 'The power stage is off. Fault reset, the rising edge of controlword bit 7, leads to Switch on disabled when the cause is gone.',
};

// States that are different on a product.
const ownStates: [RegExp, State, string][] = [
  [/^jmc/, 'switched on', 'The power stage is on and the brake is open: the motor holds its position. Enable operation (transition 4) leads to Operation enabled.'],
];

export const stateTip = (state: string, product: string) => {
  const manual = manualOf(product);
  const own = ownStates.find(([of, name]) => of.test(product) && name === state)?.[2];
  return `${own ?? stateMeanings[state as State] ?? state}\n${standard}, figure "State machine"${manual ? `; ${manual.title}` : ''}`;
};

// A bit is explained by the name that it has on this product in this mode. `standard`: where CiA 402 has this name, as BIT or
// BIT/MODE; elsewhere only the product's manual is cited.
type Meanings = Record<string, { text: string; standard: string } | undefined>;

// The names of bits that have no name of their own.
const neutral: Meanings = {
  [manufacturerSpecific]: { text: 'Manufacturer-specific.', standard: '' },
  [modeSpecific]: { text: 'Its meaning depends on the mode of operation.', standard: '' },
};

export const statusMeanings: Meanings = {
  'ready to switch on': { text: 'State of the drive, with bits 1 to 3, 5 and 6. CiA 402: 1 in Ready to switch on, Switched on, Operation enabled, Quick stop active and Fault reaction active.', standard: '0' },
  'switched on': { text: 'State of the drive. CiA 402: 1 in Switched on, Operation enabled, Quick stop active and Fault reaction active.', standard: '1' },
  'operation enabled': { text: 'State of the drive. CiA 402: 1 in Operation enabled, Quick stop active and Fault reaction active.', standard: '2' },
  fault: { text: 'The drive is in Fault or Fault reaction active.', standard: '3' },
  'voltage enabled': { text: 'High voltage is applied to the power stage.', standard: '4' },
  'no quick stop': { text: '0: the drive reacts to a quick stop. 1: no quick stop.', standard: '5' },
  'switch on disabled': { text: 'State of the drive. CiA 402: 1 in Switch on disabled.', standard: '6' },
  warning: { text: 'A warning is present: the state does not change.', standard: '7' },
  remote: { text: 'The drive obeys the controlword. 0: it is operated locally.', standard: '9' },
  'target reached': { text: 'The target is reached. After halt or quick stop: the axis stands.', standard: '10' },
  'internal limit active': { text: 'An internal limit acts, for example a software limit, a limit switch or a torque limit.', standard: '11' },
  'set-point acknowledge': { text: 'The drive has taken the target of 607Ah. It takes the next one when this bit is 0.', standard: '12/1' },
  'speed is zero': { text: 'The axis stands.', standard: '12/3' },
  'homing attained': { text: 'Home is found. With bit 10 the axis also stands.', standard: '12/6' },
  'interpolation active': { text: 'The drive interpolates between the targets.', standard: '12/7' },
  'drive follows the command value': { text: 'The drive follows the target of its mode (607Ah, 60FFh or 6071h). 0: it ignores the target.', standard: '12/8 12/9 12/10' },
  'following error': { text: 'The axis lags by more than the window of 6065h.', standard: '13/1 13/8' },
  'max slippage error': { text: 'The slippage of an asynchronous motor is too great.', standard: '13/3' },
  'homing error': { text: 'Homing has failed: home is not found.', standard: '13/6' },
  // iSMK
  'commutation found': { text: 'The drive knows the angle of its rotor, so it can be enabled.', standard: '' },
  'home found': { text: 'Homing is done and the reference point is known. 0: homing is not done, or has not ended.', standard: '' },
  // JMC
  halt: { text: 'Controlword bit 8 commands a halt: bit 10 then means that the axis stands.', standard: '' },
  'software limit active': { text: 'The position, or its demand, is beyond the software limits of 607Dh.', standard: '' },
  'command is being executed': { text: 'The drive follows the velocity command. 0: the demand does not move.', standard: '' },
};

export const controlMeanings: Meanings = {
  'switch on': { text: 'With bits 1 to 3 it commands the state: 06h shutdown, 07h switch on, 0Fh enable operation, 00h disable voltage.', standard: '0' },
  'enable voltage': { text: '0: the power stage goes off (disable voltage).', standard: '1' },
  'quick stop (0: stop)': { text: '0 commands the quick stop; 1 is no quick stop.', standard: '2' },
  'enable operation': { text: 'The motor gets torque. 0: disable operation.', standard: '3' },
  'fault reset': { text: 'The edge from 0 to 1 resets a fault whose cause is gone.', standard: '7' },
  halt: { text: 'The axis brakes as 605Dh says and stays enabled.', standard: '8' },
  reserved: { text: 'Write 0.', standard: '10' },
  'new set-point': { text: 'The edge from 0 to 1 gives the target of 607Ah.', standard: '4/1' },
  'change immediately': { text: 'The new target replaces the present one. 0: the present move ends first.', standard: '5/1' },
  relative: { text: '607Ah is relative to the last target. 0: it is absolute.', standard: '6/1' },
  'change on set-point': { text: 'The axis passes the present target at its profile velocity before it goes to the next one.', standard: '9/1' },
  'enable ramp': { text: 'The velocity follows the output of the ramp. 0: it does not.', standard: '4/2' },
  'unlock ramp': { text: 'The ramp runs. 0: its output keeps its value.', standard: '5/2' },
  'reference ramp': { text: 'The input of the ramp is the target of 6042h. 0: it is zero.', standard: '6/2' },
  'start homing': { text: 'The edge from 0 to 1 starts homing. 0 ends it.', standard: '4/6' },
  'enable interpolation': { text: 'The drive interpolates between the targets of 607Ah. 0: it does not.', standard: '4/7' },
  // iSMK
  'follow the target': { text: 'While bit 4 is 1 the axis follows each new value of 607Ah. 0: a new target needs the edge of bit 4.', standard: '' },
  'no effect in this mode': { text: 'A halt is not possible in this mode.', standard: '' },
};

function bitTip(word: 'controlword' | 'statusword', meanings: Meanings, bit: number, name: string, mode: number, product: string): string {
  const isNamed = !(name in neutral);
  const { text, standard: places } = (isNamed ? meanings : neutral)[name] ?? { text: 'No explanation is known.', standard: '' };
  const manual = manualOf(product);
  const isStandard = !isNamed || places.split(' ').some((place) => place === `${bit}` || place === `${bit}/${mode}`);
  const sources = [isStandard && `${standard}, ${word === 'statusword' ? '6041h' : '6040h'}`, manual && `${manual.title}, ${manual[word]}`].filter(Boolean);
  return `Bit ${bit}${isNamed ? `, ${name}` : ''}: ${text}\n${sources.join('; ')}`;
}

// `name`: the bit's, from statusBits or controlBits.
export const statusTip = (bit: number, name: string, mode: number, product: string) => bitTip('statusword', statusMeanings, bit, name, mode, product);
export const controlTip = (bit: number, name: string, mode: number, product: string) => bitTip('controlword', controlMeanings, bit, name, mode, product);

// The document that defines an object.
export function placeOfObject(index: number, product: string): string {
  const name = `${index.toString(16).toUpperCase().padStart(4, '0')}h`;
  if (index >= 0x2000 && index < 0x6000) return `${manualOf(product)?.title ?? 'manufacturer-specific'}, ${name}`;
  if (index >= 0x6000) return `${standard}, ${name}`;
  return `${index >= 0x1c00 ? 'ETG.1000.6' : 'CiA 301'}, ${name}`;
}

export function objectTip(entry: ObjectEntry, product: string): string {
  const range = entry.minimum !== undefined && entry.minimum !== null ? ` Range ${entry.minimum} to ${entry.maximum ?? '–'}.` : '';
  const unit = entry.unit ? ` Unit: ${entry.unit}.` : '';
  return `${addressOf(entry)} ${entry.name}: ${entry.text ?? 'No explanation is known.'}${unit}${range}\n${placeOfObject(Number(entry.index), product)}`;
}
