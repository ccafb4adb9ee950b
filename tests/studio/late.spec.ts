import type { Page } from '@playwright/test';
import { expect, test } from './fixtures';
import type { Line } from './line';

// A slow network: a halt or STOP comes between two requests of a sequence, or reaches the server before an earlier request.
// The last command of the person counts. (The monkey, monkey.spec.ts, looks for more of these.)

interface Job {
  axis: string;
  do: string;
  state: string;
}

const jobs = async (line: Line) => (await line.call<{ jobs: Job[] }>('GET', '/jobs')).jobs.map((job) => job.do);
const takenBack = (page: Page) => page.waitForEvent('requestfailed', { predicate: (request) => request.url().endsWith('/axes/reference/jobs'), timeout: 8000 }); // before the page's own timeout, 10 s

// Holds the requests of this kind until `release` is called, which returns when the first of them has gone on.
async function hold(page: Page, method: string, path: string) {
  let release = () => {};
  const released = new Promise<void>((resolve) => (release = resolve));
  let arrived = () => {};
  const held = new Promise<void>((resolve) => (arrived = resolve));
  let gone = () => {};
  const goneOn = new Promise<void>((resolve) => (gone = resolve));
  await page.route(path, async (route) => {
    if (route.request().method() === method) {
      arrived();
      await released;
    }
    await route.continue().catch(() => undefined); // the page may have given it up
    gone();
  });
  return { held, release: () => (release(), goneOn) };
}

for (const [button, kind] of [['Move and record', 'move'], ['Sweep and record', 'sweep']] as const) {
  test(`"${button}" begins no ${kind} after a halt that came before the recording`, async ({ page, open, line, watched }) => {
    await open('/scope?ch=reference/velocity_rpm');
    const recording = await hold(page, 'POST', '**/api/v1/recordings');
    await page.getByRole('button', { name: button }).click();
    await recording.held;
    await line.call('POST', '/axes/reference/jobs', { do: 'stop' });
    await expect.poll(async () => (await jobs(line)).at(-1)).toBe('stop');
    const answered = page.waitForResponse((response) => response.url().endsWith('/jobs') && response.request().method() === 'POST');
    await recording.release();
    expect((await answered).status()).toBe(409);
    expect(await jobs(line)).toEqual(['enable', 'stop']);
    for (const message of watched.splice(0)) expect(message).toContain('409');
  });
}

test('STOP and Halt act when they are pressed, not when they are released', async ({ page, open, line }) => {
  await open('/axis/reference');
  await line.call('POST', '/axes/reference/jobs', { do: 'enable' }); // Halt is there for an enabled axis
  for (const [name, path] of [['Halt', '**/api/v1/axes/reference/jobs'], ['STOP', '**/api/v1/stop']] as const) {
    const button = page.getByRole('button', { name, exact: true }).first();
    await button.hover();
    const sent = page.waitForRequest(path);
    await page.mouse.down();
    await sent;
    await page.mouse.move(5, 500); // the pointer leaves the button, and is released elsewhere
    await page.mouse.up();
  }
  expect(await jobs(line)).toEqual(['enable', 'stop']);
});

for (const [what, button] of [['STOP', /^STOP$/], ['a controlword', /^2 shutdown/], ['a power cycle', /^Power cycle$/]] as const) {
  test(`${what} takes back the command whose request is still on its way, and what was to follow`, async ({ page, open, line, watched }) => {
    await open('/axis/reference');
    const enabling = await hold(page, 'POST', '**/axes/reference/jobs');
    await page.getByRole('button', { name: 'Move +' }).click();
    await enabling.held;
    const failed = takenBack(page);
    await page.getByRole('button', { name: button }).click();
    await failed;
    await enabling.release();
    expect(await jobs(line)).toEqual([]);
    watched.splice(0); // Chromium may log the request that was given up
  });
}

test('a controlword ends what was to follow', async ({ page, open, line, watched }) => {
  await open('/axis/reference');
  await page.route('**/axes/reference/jobs', async (route) => {
    const response = await route.fetch();
    // The enabling is over before the page knows that it has begun.
    await expect.poll(async () => (await line.call<{ state: string }>('GET', '/axes/reference')).state).toBe('operation enabled');
    await page.getByRole('button', { name: /^5 disable operation/ }).click();
    await expect.poll(async () => (await line.call<{ state: string }>('GET', '/axes/reference')).state).toBe('switched on');
    await route.fulfill({ response });
  }, { times: 1 });
  const written = page.waitForResponse((response) => response.url().endsWith('/objects/6040/0') && response.request().method() === 'PUT');
  await page.getByRole('button', { name: 'Move +' }).click();
  await written;
  await expect(page.getByText('taken back').first()).toBeVisible();
  expect(await jobs(line)).toEqual(['enable']);
  watched.splice(0);
});

test('a halt takes back the command whose request is still on its way', async ({ page, open, line, watched }) => {
  await open('/tuning/reference');
  const tuning = await hold(page, 'POST', '**/axes/reference/jobs');
  await page.getByRole('button', { name: 'Measure and propose' }).click();
  await tuning.held;
  await page.getByRole('link', { name: 'Line', exact: true }).click();
  await line.call('POST', '/axes/reference/jobs', { do: 'enable' }); // the page offers a halt
  const card = page.getByRole('article', { name: 'reference' });
  const failed = takenBack(page);
  await card.getByRole('button', { name: 'Halt' }).click();
  await failed;
  await tuning.release();
  await expect.poll(() => jobs(line)).toEqual(['enable', 'stop']);
  watched.splice(0);
});
