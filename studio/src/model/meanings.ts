import type { ObjectEntry } from '../api/types';
import { manufacturerSpecific, modeSpecific, type State } from './cia402';
import { addressOf } from './objects';

// What the standard says about states, bits and objects, in short, and the place in the standard or the maker's manual.

const standard = 'CiA 402-2 (IEC 61800-7-201)';

// The makers' manuals, and their tables of the statusword (docs/manuals.md).
const manuals: [RegExp, string, string][] = [
  [/^ismc/, 'ISMC servo drive CANopen Application Manual, V1.6', 'Tables 3-1 and 3-2'],
  [/^pronet/, 'ProNet CANOpen User\'s Manual, V1.04', 'ch. 6.2.2'],
  [/^ismk/, 'iSMK integrated servo user manual', 'Tables 5-2 and 5-5'],
  [/^jmc/, 'JMC EC Series Drives User\'s Manual, V1.42', 'Table 156'],
];
const manualOf = (product: string) => manuals.find(([pattern]) => pattern.test(product));

const placeOfWord = (object: string, product: string) => {
  const manual = object === '6041h' ? manualOf(product) : undefined;
  return `${standard}, ${object}${manual ? `; ${manual[1]}, ${manual[2]}` : ''}`;
};

export const stateMeanings: Record<State, string> = {
  'not ready to switch on': 'The drive initialises itself. It has no torque and takes no commands; it leaves this state by itself.',
  'switch on disabled': 'The drive can be configured. It has no torque, and the main voltage may be off. Shutdown (transition 2) leads on.',
  'ready to switch on': 'The main voltage may be applied. The drive has no torque. Switch on (transition 3) leads on.',
  'switched on': 'The main voltage is there and the power stage is ready. The drive has no torque. Enable operation (transition 4) leads on.',
  'operation enabled': 'The power stage is on: the motor has torque and obeys the mode of operation.',
  'quick stop active': 'The quick stop was commanded: the axis brakes as 605Ah says, or stands held. The power stage is on.',
  'fault reaction active': 'The drive has found a fault and brakes as 605Eh says. It goes to Fault by itself.',
  fault: 'The power stage is off. Fault reset, the rising edge of controlword bit 7, leads on when the cause is gone.',
};

export const stateTip = (state: string, product = '') => {
  const manual = manualOf(product);
  return `${stateMeanings[state as State] ?? state}\n${standard}, figure "State machine"${manual ? `; ${manual[1]}` : ''}`;
};

const statusMeanings: Record<number, string> = {
  0: 'State of the drive, with bits 1 to 3, 5 and 6: 1 from Ready to switch on upwards.',
  1: 'State of the drive: 1 from Switched on upwards.',
  2: 'State of the drive: 1 in Operation enabled, Quick stop active and Fault reaction active.',
  3: 'The drive is in Fault or Fault reaction active.',
  4: 'High voltage is applied to the power stage.',
  5: '0: the drive reacts to a quick stop. 1: no quick stop.',
  6: 'The drive is in Switch on disabled.',
  7: 'A warning is present: the state does not change.',
  8: 'Of the maker.',
  9: 'The drive obeys the controlword. 0: it is operated locally.',
  10: 'The target is reached. After halt or quick stop: the axis stands.',
  11: 'An internal limit acts, for example a software limit, a limit switch or a torque limit.',
  12: 'Its meaning depends on the mode of operation.',
  13: 'Its meaning depends on the mode of operation.',
  14: 'Of the maker.',
  15: 'Of the maker.',
};
const statusOfMode: Record<string, string> = {
  '12/1': 'Set-point acknowledge: the drive has taken the target of 607Ah and waits until controlword bit 4 is 0.',
  '13/1': 'Following error: the axis lags by more than the window 6065h for the time 6066h.',
  '12/3': 'Speed is 0.',
  '13/3': 'The slippage of an asynchronous motor is too great.',
  '12/6': 'Homing attained: home is found. With bit 10 the axis also stands.',
  '13/6': 'Homing error: home is not found.',
  '12/7': 'The drive interpolates.',
  '12/8': 'The drive follows the target. 0: it ignores 607Ah.',
  '13/8': 'Following error: the axis lags by more than the window 6065h for the time 6066h.',
  '12/9': 'The drive follows the target. 0: it ignores 60FFh.',
  '12/10': 'The drive follows the target. 0: it ignores 6071h.',
};
const controlMeanings: Record<number, string> = {
  0: 'Switch on. With bits 1 to 3 it commands the state: 06h shutdown, 07h switch on, 0Fh enable operation, 00h disable voltage.',
  1: 'Enable voltage. 0: the power stage goes off (disable voltage).',
  2: '0 commands the quick stop; 1 is no quick stop.',
  3: 'Enable operation: the motor gets torque. 0: disable operation.',
  4: 'Its meaning depends on the mode of operation.',
  5: 'Its meaning depends on the mode of operation.',
  6: 'Its meaning depends on the mode of operation.',
  7: 'Fault reset: the edge from 0 to 1 resets a fault whose cause is gone.',
  8: 'Halt: the axis brakes as 605Dh says and stays enabled.',
  9: 'Its meaning depends on the mode of operation.',
  10: 'Reserved: write 0.',
};
const controlOfMode: Record<string, string> = {
  '4/1': 'New set-point: the edge from 0 to 1 gives the target of 607Ah.',
  '5/1': 'Change set immediately: the new target replaces the present one. 0: the present move ends first.',
  '6/1': '607Ah is relative to the last target. 0: it is absolute.',
  '9/1': 'The axis passes the present target at its profile velocity before it goes to the next one.',
  '4/2': 'Enable ramp.',
  '5/2': 'Unlock ramp.',
  '6/2': 'Reference ramp.',
  '4/6': 'Start homing: the edge from 0 to 1. 0 ends it.',
  '4/7': 'Enable interpolation.',
};

const ofBit = (meanings: Record<number, string>, ofMode: Record<string, string>, bit: number, mode: number) => ofMode[`${bit}/${mode}`] ?? meanings[bit] ?? 'Of the maker.';
const isNamed = (name: string) => name !== manufacturerSpecific && name !== modeSpecific;

export const statusTip = (bit: number, name: string, mode: number, product: string) =>
  `Bit ${bit}${isNamed(name) ? `, ${name}` : ''}: ${ofBit(statusMeanings, statusOfMode, bit, mode)}\n${placeOfWord('6041h', product)}`;
export const controlTip = (bit: number, name: string, mode: number, product: string) =>
  `Bit ${bit}${isNamed(name) ? `, ${name}` : ''}: ${ofBit(controlMeanings, controlOfMode, bit, mode)}\n${placeOfWord('6040h', product)}`;

// The document that defines an object.
export function placeOfObject(index: number, product: string): string {
  const name = `${index.toString(16).toUpperCase().padStart(4, '0')}h`;
  if (index >= 0x2000 && index < 0x6000) return `${manualOf(product)?.[1] ?? 'of the maker'}, ${name}`;
  if (index >= 0x6000) return `${standard}, ${name}`;
  return `${index >= 0x1c00 ? 'ETG.1000.6' : 'CiA 301'}, ${name}`;
}

export function objectTip(entry: ObjectEntry, product: string): string {
  const range = entry.minimum !== undefined && entry.minimum !== null ? ` Range ${entry.minimum} to ${entry.maximum ?? '–'}.` : '';
  const unit = entry.unit ? ` Unit: ${entry.unit}.` : '';
  return `${addressOf(entry)} ${entry.name}: ${entry.text ?? 'No explanation is known.'}${unit}${range}\n${placeOfObject(Number(entry.index), product)}`;
}
