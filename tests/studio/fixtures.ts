import { test as base, expect, type Page } from '@playwright/test';
import { mkdirSync } from 'node:fs';
import { join } from 'node:path';
import { Line, lineFile } from './line';

// `line`: a fresh line for each test. `page` is watched: an error on its console or a request to anywhere but its own
// server fails the test. STUDIO_PICTURES: a folder that keeps the pictures.

const pictures = process.env.STUDIO_PICTURES;

interface Fixtures {
  lineText: string; // the line file
  line: Line;
  watched: string[]; // what it has found so far; a test that provokes an error takes it out
  picture: (name: string) => Promise<void>;
  open: (path: string) => Promise<void>;
}

export function watch(page: Page, line: { address: string }, found: string[]) {
  page.on('console', (message) => {
    if (message.type() === 'error') found.push(`console: ${message.text()}`);
  });
  page.on('pageerror', (error) => found.push(`error: ${error.message}`));
  page.on('request', (request) => {
    const url = request.url();
    if (!url.startsWith(line.address) && !url.startsWith('blob:') && !url.startsWith('data:')) found.push(`request outside: ${url}`);
  });
}

export const test = base.extend<Fixtures>({
  lineText: [lineFile(), { option: true }],
  line: async ({ lineText }, use) => {
    const line = await new Line(lineText).start();
    await use(line);
    await line.end();
  },
  watched: [
    async ({ page, line }, use) => {
      const found: string[] = [];
      watch(page, line, found);
      // tips.spec.ts takes the tour. A document without an origin, an error page for example, has no storage.
      await page.addInitScript(() => {
        if (location.protocol.startsWith('http')) localStorage.setItem('servodrome.tour', 'over');
      });
      await use(found);
      expect(found).toEqual([]);
    },
    { auto: true },
  ],
  open: async ({ page, line }, use) => {
    await use(async (path) => {
      await page.goto(line.address + path);
      await expect(page.getByText('Waiting for the server')).toHaveCount(0);
      await expect(page.locator('main .panel').first()).toBeVisible();
    });
  },
  picture: async ({ page }, use) => {
    await use(async (name) => {
      if (!pictures) return;
      mkdirSync(pictures, { recursive: true });
      await page.screenshot({ path: join(pictures, `${name}.png`) });
    });
  },
});

export { expect };

// Of a select of react-aria: opens it and takes the option whose text begins so. It does not open before its options have
// arrived from the drive: a person tries again.
export async function choose(page: Page, label: string | RegExp, option: string | RegExp, within = page.locator('body')) {
  const wanted = page.getByRole('option', { name: option }).first();
  await expect(async () => {
    if (!(await wanted.isVisible())) await within.getByRole('button', { name: label }).first().click({ timeout: 5000 });
    await expect(wanted).toBeVisible({ timeout: 5000 });
  }).toPass();
  await wanted.click();
}

// Into a number field, as a person types it.
export async function type(page: Page, label: string, value: number, within = page.locator('body')) {
  const field = within.getByRole('textbox', { name: label, exact: true });
  await field.fill(String(value));
  await field.press('Tab');
}

export const card = (page: Page, axis: string) => page.getByRole('article', { name: axis });
export const panel = (page: Page, title: string | RegExp) => page.getByRole('region', { name: title });
