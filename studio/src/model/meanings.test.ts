import { expect, test } from 'vitest';
import productWords from '../../../tests/data/words.json';
import type { Words } from '../api/types';
import { controlBits, manufacturerSpecific, modeSpecific, states, statusBits } from './cia402';
import { controlMeanings, controlTip, objectTip, placeOfObject, stateMeanings, stateTip, statusMeanings, statusTip } from './meanings';

// The names that the server gives for each product; a test of the server compares them.
const products = Object.entries(productWords as Record<string, Words>);
const isNamed = (name: string) => name !== manufacturerSpecific && name !== modeSpecific;
// A tip without its sources.
const said = (tip: string) => tip.split('\n')[0];

test('every state has a meaning', () => {
  for (const state of states) expect(stateMeanings[state].length).toBeGreaterThan(20);
  expect(stateTip('switched on', 'generic402')).toContain('no torque');
  expect(stateTip('switched on', 'jmc_ec')).toContain('the motor holds its position');
});

test('each bit of each product is explained by the name that it has there', () => {
  const used = new Set<string>();
  for (const [product, words] of products) {
    for (const mode of Object.keys(words.modes).map(Number)) {
      for (const { bit, name } of statusBits(0, mode, words)) {
        const tip = statusTip(bit, name, mode, product);
        const where = `${product}, mode ${mode}`;
        used.add(name);
        if (isNamed(name)) {
          expect(said(tip), where).toBe(`Bit ${bit}, ${name}: ${statusMeanings[name]?.text}`);
        } else {
          for (const each of Object.values(statusMeanings)) expect(tip, where).not.toContain(each!.text);
        }
      }
      for (const { bit, name } of controlBits(0, mode, product)) {
        const tip = controlTip(bit, name, mode, product);
        if (isNamed(name)) expect(said(tip), `${product}, mode ${mode}`).toBe(`Bit ${bit}, ${name}: ${controlMeanings[name]?.text}`);
      }
    }
  }
  expect(Object.keys(statusMeanings).filter((name) => !used.has(name))).toEqual([]);
  const texts = Object.values(statusMeanings).map((each) => each!.text);
  expect(new Set(texts).size).toBe(texts.length); // no two names have one explanation
});

test('the standard is cited for its own names only', () => {
  const standardOf = (tip: string) => tip.includes('CiA 402-2');
  const cia402 = productWords.generic402 as Words;
  const nameOf = (words: Words, bit: number, mode: number) => statusBits(0, mode, words)[bit].name;
  for (const [product, words] of products) {
    for (const mode of Object.keys(words.modes).map(Number)) {
      for (const { bit, name } of statusBits(0, mode, words)) {
        if (isNamed(name)) expect(standardOf(statusTip(bit, name, mode, product)), `${product}, mode ${mode}, bit ${bit}`).toBe(nameOf(cia402, bit, mode) === name);
      }
    }
  }
  expect(statusTip(15, 'home found', 6, 'ismk')).toMatch(/\niSMK integrated servo user manual, Table 5-5$/);
  expect(statusTip(3, 'fault', 6, 'ismk')).toContain('6041h; iSMK');
});

test('a failed homing of an iSMK is explained as one', () => {
  const bits = statusBits(0, 6, productWords.ismk as Words);
  const tips = [10, 12, 13, 15].map((bit) => said(statusTip(bit, bits[bit].name, 6, 'ismk')));
  expect(tips[0]).toBe('Bit 10: Its meaning depends on the mode of operation.');
  expect(tips[1]).toBe('Bit 12, homing error: Homing has failed: home is not found.');
  expect(tips[2]).toContain('6065h');
  expect(tips[3]).toContain('reference point is known');
});

test('bits of the controlword that a product has on its own', () => {
  const tipOf = (bit: number, mode: number, product: string) => controlTip(bit, controlBits(0, mode, product)[bit].name, mode, product);
  expect(tipOf(4, 6, '')).toContain('starts homing');
  expect(tipOf(12, 1, 'ismk')).toContain('each new value of 607Ah');
  expect(tipOf(12, 1, 'ismk')).toMatch(/\niSMK .*Table 5-4$/);
  expect(tipOf(12, 1, 'ismc')).toContain('Manufacturer-specific.');
  expect(tipOf(8, 4, 'ismk')).toContain('not possible in this mode');
  expect(tipOf(8, 4, 'ismc')).toContain('605Dh');
});

test('without the names of the product nothing is claimed', () => {
  for (const { bit, name } of statusBits(0)) expect(statusTip(bit, name, 6, '')).toMatch(/Manufacturer-specific\.|depends on the mode/);
  expect(statusTip(15, 'a name of tomorrow', 6, 'ismk')).toContain('No explanation is known.');
});

test('the place of an object', () => {
  expect(placeOfObject(0x1018, 'ismc')).toBe('CiA 301, 1018h');
  expect(placeOfObject(0x6064, 'ismc')).toContain('CiA 402-2');
  expect(placeOfObject(0x2f12, 'ismc')).toContain('ISMC servo drive');
  expect(placeOfObject(0x2f12, 'generic402')).toBe('manufacturer-specific, 2F12h');
  expect(placeOfObject(0x1c12, 'jmc_ec')).toContain('ETG.1000.6');
  const tip = objectTip({ index: '0x6081', sub: 0, name: 'Profile velocity', type: 'UNSIGNED32', access: 'rw', unit: 'vel', pdo: 'rx', saved: true, minimum: 0, maximum: 9, text: 'The speed.' }, 'x');
  expect(tip).toBe('6081:00 Profile velocity: The speed. Unit: vel. Range 0 to 9.\nCiA 402-2 (IEC 61800-7-201), 6081h');
});
