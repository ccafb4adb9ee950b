import type { Units } from '../api/types';

// The machine behind the motor, and the conversion between the user's units, revolutions of the motor, and the drive's units.

export const machines = [
  ['revolutions', 'Rotary, in revolutions'],
  ['degrees', 'Rotary, in degrees'],
  ['spindle', 'Spindle, in mm'],
  ['belt', 'Belt or rack, in mm'],
] as const;
export type Machine = (typeof machines)[number][0];

export interface Mechanics {
  machine: Machine;
  feed_mm: number; // spindle: lead; belt or rack: way of one revolution of the pulley or pinion
  motor_turns: number; // gear: revolutions of the motor ...
  load_turns: number; // ... for revolutions of the spindle, pulley or table
  units_per_turn: number | null; // typed, if the drive does not report it: units of 6064h per revolution of the motor
}

export const noMechanics: Mechanics = { machine: 'revolutions', feed_mm: 10, motor_turns: 1, load_turns: 1, units_per_turn: null };

export const isRotary = ({ machine }: Mechanics) => machine === 'revolutions' || machine === 'degrees';

export type Kind = 'position' | 'velocity' | 'acceleration';

export interface Scale {
  unit: Record<Kind, string>;
  user: Record<Kind, number>; // the user's units for one revolution of the motor, per second, per second squared
  drive: Record<Kind, number>; // the drive's units for the same
}

// Null: the size of the drive's units is not known.
export function scaleOf(mechanics: Mechanics, units: Units | undefined): Scale | null {
  const { machine, feed_mm, motor_turns, load_turns, units_per_turn } = mechanics;
  const typed = units_per_turn ?? 0;
  const position = units?.position_per_revolution ?? typed;
  const velocity = units?.velocity_per_rps ?? typed; // CiA 402: position units per second
  const acceleration = units?.acceleration_per_rps2 ?? typed;
  if (!(position > 0 && velocity > 0 && acceleration > 0)) return null;
  const load = load_turns / motor_turns;
  const way = machine === 'revolutions' ? load : machine === 'degrees' ? 360 * load : feed_mm * load;
  if (!(way > 0) || !Number.isFinite(way)) return null;
  const name = machine === 'revolutions' ? 'rev' : machine === 'degrees' ? '°' : 'mm';
  return {
    unit: { position: name, velocity: machine === 'revolutions' ? 'rpm' : `${name}/s`, acceleration: `${name}/s²` },
    user: { position: way, velocity: machine === 'revolutions' ? 60 * load : way, acceleration: way },
    drive: { position, velocity, acceleration },
  };
}

export const toUser = (scale: Scale, kind: Kind, turns: number) => turns * scale.user[kind];
export const fromUser = (scale: Scale, kind: Kind, value: number) => value / scale.user[kind];
export const toDrive = (scale: Scale, kind: Kind, turns: number) => Math.round(turns * scale.drive[kind]);
export const fromDrive = (scale: Scale, kind: Kind, value: number) => value / scale.drive[kind];
