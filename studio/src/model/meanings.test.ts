import { expect, test } from 'vitest';
import { states, statusBits, controlBits } from './cia402';
import { controlTip, objectTip, placeOfObject, stateMeanings, statusTip } from './meanings';

test('every state and every bit has a meaning', () => {
  for (const state of states) expect(stateMeanings[state].length).toBeGreaterThan(20);
  for (const { bit, name } of statusBits(0)) expect(statusTip(bit, name, 1, 'ismk')).toMatch(/^Bit \d+.*: .+\n.*6041h; iSMK/);
  for (const { bit, name } of controlBits(0)) expect(controlTip(bit, name, 1, 'ismk')).toMatch(/^Bit \d+.*: .+\n.*6040h$/);
});

test('the mode decides about bits 12 and 4', () => {
  expect(statusTip(12, 'set-point acknowledge', 1, '')).toContain('607Ah');
  expect(statusTip(12, 'homing attained', 6, '')).toContain('home is found');
  expect(controlTip(4, 'start homing', 6, '')).toContain('Start homing');
  expect(statusTip(12, 'mode-specific', 0, '')).toContain('depends on the mode');
});

test('the place of an object', () => {
  expect(placeOfObject(0x1018, 'ismc')).toBe('CiA 301, 1018h');
  expect(placeOfObject(0x6064, 'ismc')).toContain('CiA 402-2');
  expect(placeOfObject(0x2f12, 'ismc')).toContain('ISMC servo drive');
  expect(placeOfObject(0x1c12, 'jmc_ec')).toContain('ETG.1000.6');
  const tip = objectTip({ index: '0x6081', sub: 0, name: 'Profile velocity', type: 'UNSIGNED32', access: 'rw', unit: 'vel', pdo: 'rx', saved: true, minimum: 0, maximum: 9, text: 'The speed.' }, 'x');
  expect(tip).toBe('6081:00 Profile velocity: The speed. Unit: vel. Range 0 to 9.\nCiA 402-2 (IEC 61800-7-201), 6081h');
});
