import type { Page } from '@playwright/test';
import { expect } from './fixtures';
import { lineFile } from './line';

// What the specs of the guided commissioning share.

const slow = { timeout: 120_000 }; // a busy machine is slow, and not wrong

// The line of one of the axes, so that the machine simulates no drive in vain.
export const lineOf = (name: string, clock: 'real' | 'virtual') =>
  lineFile(clock).split(/(?=\[\[axis\]\])/).filter((block) => !block.startsWith('[[axis]]') || block.includes(`name = "${name}"`)).join('');

interface Product {
  tunes: 'proposed' | 'by hand' | 'not';
  home: RegExp; // its method
  limits: boolean; // it has soft limits
  torque: boolean; // its torque can be limited
  // On its bus it does not say how many units of 6064h a revolution has.
  unitsUnknown?: boolean;
  // A gain of its velocity loop, and a value for it: object, sub-index, value.
  gain?: readonly [index: string, sub: number, value: number];
}

// What a drive of the line can do, and by which method it homes.
export const products: Record<string, Product> = {
  ismc: { tunes: 'not', home: /^7: /, limits: true, torque: true, unitsUnknown: true },
  reference: { tunes: 'proposed', home: /^7: /, limits: true, torque: true },
  pronet: { tunes: 'not', home: /^17: /, limits: false, torque: false },
  ismk: { tunes: 'proposed', home: /^33: /, limits: true, torque: true },
  jmc: { tunes: 'by hand', home: /^7: /, limits: true, torque: true, gain: ['0x2001', 4, 15] },
};

export const next = (page: Page) => page.getByRole('button', { name: 'Done, next step' });
export const figures = (page: Page) => page.getByRole('table', { name: 'Measured, before and after' });
export const plan = (page: Page, what: 'Values' | 'Gains' = 'Values') => page.getByRole('table', { name: `${what} to write` });

// Writes what the step proposes.
export async function write(page: Page, what: 'Values' | 'Gains' = 'Values') {
  const table = plan(page, what);
  await page.locator('.guide-plan').filter({ has: table }).getByRole('button', { name: /^Write th/ }).click();
  await expect(table).toHaveCount(0, slow);
}
