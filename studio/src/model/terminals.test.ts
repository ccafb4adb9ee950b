import { expect, test } from 'vitest';
import type { ObjectEntry } from '../api/types';
import { setsOfTerminals } from './terminals';

test('sets stand as people look for them, objects within as the drive lists them', () => {
  const entry = (index: string, terminal?: string) => ({ index, sub: 0, terminal }) as ObjectEntry;
  const sets = setsOfTerminals([entry('0x2010', 'Functions of the inputs'), entry('0x60B8', 'Touch probes'), entry('0x60FD', 'Inputs'), entry('0x6040'), entry('0x60B9', 'Touch probes')]);
  expect(sets.map(([set, entries]) => [set, entries.map(({ index }) => index)])).toEqual([
    ['Inputs', ['0x60FD']],
    ['Functions of the inputs', ['0x2010']],
    ['Touch probes', ['0x60B8', '0x60B9']],
  ]);
});
