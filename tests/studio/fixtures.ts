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
  excused: RegExp[]; // errors that a test provokes at any time, also after its last step
  picture: (name: string) => Promise<void>;
  open: (path: string) => Promise<void>;
}

export function watch(page: Page, line: { address: string }, found: string[]) {
  page.on('console', (message) => {
    if (message.type() === 'error') found.push(`console: ${message.text()} ${message.location().url.replace(line.address, '')}`);
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
  excused: async ({ page: _ }, use) => use([]),
  watched: [
    async ({ page, line, excused }, use) => {
      const found: string[] = [];
      watch(page, line, found);
      // tips.spec.ts takes the tour. A document without an origin, an error page for example, has no storage.
      await page.addInitScript(() => {
        if (location.protocol.startsWith('http')) localStorage.setItem('servodrome.tour', 'over');
      });
      await use(found);
      await page.unrouteAll({ behavior: 'ignoreErrors' }); // a handler may still wait for a line that ends now
      expect(found.filter((message) => !excused.some((each) => each.test(message)))).toEqual([]);
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

// For `excused`. The page may ask a drive something at the moment when its power goes, and Chromium may log a request that the
// page takes back.
export const noPower = /status of 409.* \/api\/v1\/axes\//;
export const takenBack = /Failed to load resource: net::ERR_(ABORTED|FAILED)/;

// Notices stay, and the page waits for each answer as long as the test does. A busy machine may look at a notice later than the
// page's 4 or 15 s, or hold a request for longer than its 10 s. Call it before the page is opened.
export async function withoutTimeouts(page: Page) {
  await page.addInitScript(() => {
    const set = window.setTimeout.bind(window);
    const ofNotices_ms = [4000, 15_000];
    const never_ms = 2 ** 31 - 1;
    window.setTimeout = ((act: () => void, ms?: number) => set(act, ofNotices_ms.includes(ms ?? 0) ? never_ms : ms)) as typeof window.setTimeout;
    AbortSignal.timeout = () => new AbortController().signal;
  });
}

// Holds the requests of this kind, with `text` in their body, until `release` is called, which returns when the first of them has
// gone on.
export async function hold(page: Page, method: string, path: string, text = '') {
  let release = () => {};
  const released = new Promise<void>((resolve) => (release = resolve));
  let arrived = () => {};
  const held = new Promise<void>((resolve) => (arrived = resolve));
  let gone = () => {};
  const goneOn = new Promise<void>((resolve) => (gone = resolve));
  await page.route(path, async (route) => {
    const isHeld = route.request().method() === method && (route.request().postData() ?? '').includes(text);
    if (isHeld) {
      arrived();
      await released;
    }
    await route.continue().catch(() => undefined); // the page may have given it up
    if (isHeld) gone();
  });
  return { held, release: () => (release(), goneOn) };
}

// Presses the button of a jog, and waits until `moves` is true. The server halts the axis if a sign of life of the page is late
// by 500 ms, as on a busy machine: a person presses again.
export async function jogUntil(moves: () => Promise<unknown>, press: () => Promise<void>, release: () => Promise<void>) {
  await expect(async () => {
    await press();
    await expect.poll(moves, { timeout: 5000 }).toBe(true).catch(async (error: unknown) => {
      await release();
      throw error;
    });
  }).toPass({ timeout: 60_000 });
}

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
