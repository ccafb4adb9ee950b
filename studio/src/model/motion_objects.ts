import type { ObjectValue } from '../api/types';

// Objects by which a write alone can move an enabled axis (CiA 402-2): targets, offsets and the mode of operation.
const motionObjects = [0x607a, 0x60ff, 0x6071, 0x6042, 0x60b1, 0x60b2, 0x6060];

export const isMotionObject = (index: number) => motionObjects.includes(index);

// A controlword whose low four bits are Fh commands "enable operation".
export const commandsMotion = (index: number, value: ObjectValue) => isMotionObject(index) || (index === 0x6040 && typeof value === 'number' && (value & 0xf) === 0xf);

const heldStates = ['switched on', 'operation enabled', 'quick stop active', 'fault reaction active'];

// In these states the power stage is on, so a written mode or limit acts on the shaft.
export const hasPowerStage = (state: string | undefined) => heldStates.includes(state ?? '');
