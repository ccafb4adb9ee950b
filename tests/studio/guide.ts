import type { Page } from '@playwright/test';
import { expect as shortly, panel } from './fixtures';
import { type Line, lineFile } from './line';

// What the specs of the guided commissioning share.

const expect = shortly.configure({ timeout: 120_000 }); // a busy machine is slow, and not wrong

// The line of one of the axes, so that the machine simulates no drive in vain.
export const lineOf = (name: string, clock: 'real' | 'virtual') =>
  lineFile(clock).split(/(?=\[\[axis\]\])/).filter((block) => !block.startsWith('[[axis]]') || block.includes(`name = "${name}"`)).join('');

interface Product {
  tunes: 'proposed' | 'by hand' | 'not';
  home: RegExp; // its method
  limits: boolean; // it has soft limits
  // On its bus it does not say how many units of 6064h a revolution has.
  unitsUnknown?: boolean;
  bits: Record<string, string>; // terminals of the inputs that 60FDh shows: name of the bit, terminal
  // The function of an input that has none from the factory: the label of its field, an option, and its object and value.
  input?: readonly [field: string, option: RegExp, object: string, value: number];
  // A gain of its velocity loop, and a value for it: object, sub-index, value.
  gain?: readonly [index: string, sub: number, value: number];
}

const terminals = (count: number) => Object.fromEntries(Array.from({ length: count }, (_, i) => [`DI${i}`, `DI${i}`]));

// What a drive of the line can do, and by which method it homes.
export const products: Record<string, Product> = {
  ismc: { tunes: 'not', home: /^7: /, limits: true, unitsUnknown: true, bits: terminals(6) },
  reference: {
    tunes: 'proposed', home: /^7: /, limits: true,
    bits: { 'negative limit switch': 'DI0', 'positive limit switch': 'DI1', 'home switch': 'DI2', ...terminals(8) },
  },
  pronet: { tunes: 'not', home: /^17: /, limits: false, bits: { 'negative limit switch': 'DI3', 'positive limit switch': 'DI2', 'home switch': 'DI4' } },
  ismk: { tunes: 'proposed', home: /^33: /, limits: true, bits: { 'home switch': 'DI2' }, input: ['Din3_Function', /^64: /, '2010:05', 64] },
  jmc: {
    tunes: 'by hand', home: /^7: /, limits: true, gain: ['0x2001', 4, 15],
    bits: { 'negative limit switch': 'DI2', 'positive limit switch': 'DI0', 'home switch': 'DI1', 'touch probe 1': 'DI3', 'touch probe 2': 'DI4' },
  },
};

export const next = (page: Page) => page.getByRole('button', { name: 'Done, next step' });
export const figures = (page: Page) => page.getByRole('table', { name: 'Measured, before and after' });
export const plan = (page: Page, what: 'Values' | 'Gains' = 'Values') => page.getByRole('table', { name: `${what} to write` });

// Writes what the step proposes.
export async function write(page: Page, what: 'Values' | 'Gains' = 'Values') {
  const table = plan(page, what);
  await page.locator('.guide-plan').filter({ has: table }).getByRole('button', { name: /^Write th/ }).click();
  await expect(table).toHaveCount(0);
}

// The step shows the motor or the encoder, and a limit. It is complete when a person has compared them with the nameplate.
export async function identify(page: Page) {
  await expect(panel(page, 'Identify')).toBeVisible();
  const read = page.getByRole('table', { name: 'Values read from the drive' });
  await expect(read.getByRole('row', { name: /\b(motor|encoder)\b/i })).not.toHaveCount(0);
  await expect(read.getByRole('row', { name: /\b(limit|max|maximum|Pn401)\b/i })).not.toHaveCount(0);
  await expect(read.getByText('undefined')).toHaveCount(0);
  await expect(page.getByText('Compare the values with the nameplate.')).toBeVisible();
  await expect(next(page)).toBeDisabled();
  await page.getByText('The values agree with the nameplate').click();
  await next(page).click();
}

// Presses a button that moves the axis, and polls `seen` until it is true. If the computer stalls for 100 ms, the drive may report
// the loss of its master, or the page may end its sequence. The fault is then cleared, and the button pressed again. `before` is
// called before each try; the function returns the last result of `before`.
export async function moveInTime<T>(page: Page, button: string, seen: () => Promise<boolean>, before: () => Promise<T>): Promise<T> {
  const main = page.getByRole('main');
  const clear = main.getByRole('button', { name: 'Clear fault' });
  const failed = main.getByRole('alert').locator('strong');
  const press = main.getByRole('button', { name: button, exact: true });
  for (let tries = 8; ; --tries) {
    const from = await before();
    await press.click();
    await expect.poll(async () => (await seen()) || (await clear.isVisible()) || (await failed.count()) > 0, { timeout: 300_000 }).toBe(true);
    if (await seen()) return from;
    const why = (await main.getByRole('alert').allTextContents()).join(' ');
    expect(why).toMatch(/watchdog|heartbeat|lost|left OP|no answer|does not answer|page slept/i);
    expect(tries, `"${button}": ${why}`).toBeGreaterThan(0);
    await expect(async () => {
      if (await clear.isVisible()) await clear.click();
      await shortly(press).toBeEnabled({ timeout: 5000 });
    }).toPass({ timeout: 120_000 });
  }
}

// The step before has left a low limit: the step is complete when the drive has that of the form.
export async function torque(page: Page) {
  await expect(panel(page, 'Torque limit')).toBeVisible();
  await expect(page.getByText(/^Not in the drive: /)).toBeVisible();
  await expect(next(page)).toBeDisabled();
  await write(page);
  await expect(page.getByText('✓ The drive has the limit.')).toBeVisible();
  await next(page).click();
}

interface Change {
  object: string;
  before: unknown;
  after: unknown;
  who: string;
}

const storing = ['1010:01', '2FF0:01', '2FF0:03']; // commands, no values

// The guide's list of what it has written is what the server has logged.
export async function journalIsLogged(page: Page, server: Pick<Line, 'call'>, axis: string) {
  const { changes } = await server.call<{ changes: Change[] }>('GET', `/changes?axis=${axis}&limit=1000`);
  const byPage = changes.filter(({ who, object }) => who === 'API (page)' && !storing.includes(object));
  const journal = await page.evaluate((name) => (JSON.parse(localStorage.getItem(`servodrome.guide.${name}`)!) as { journal: (Change & { step: string })[] }).journal, axis);
  const written = journal.filter(({ object }) => object !== '6060:00'); // the jobs set the mode
  const listed = [...new Set(written.map(({ object }) => object))];
  expect(listed.length).toBeGreaterThan(3);
  expect(listed.sort()).toEqual([...new Set(byPage.map(({ object }) => object))].sort());
  for (const object of listed) {
    const [ofObject, ofLog] = [written.filter((each) => each.object === object), byPage.filter((each) => each.object === object)];
    expect([object, ofObject[0].before, ofObject.at(-1)!.after]).toEqual([object, ofLog[0].before, ofLog.at(-1)!.after]);
  }
}
