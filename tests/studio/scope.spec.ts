import { readFileSync } from 'node:fs';
import type { Page } from '@playwright/test';
import { choose, expect, panel, test, type } from './fixtures';

test.use({ contextOptions: { reducedMotion: 'no-preference' } });

const setup = '?ch=reference/velocity_rpm,reference/following_error,reference/torque_nm&rate=4000&ms=1200&pre=20';

test('a move is recorded, and its overshoot read', async ({ page, open, picture }) => {
  await open(`/scope${setup}&trigger=edge&tch=0&level=5`);
  await page.getByRole('button', { name: 'Move and record' }).click();
  const measures = page.getByRole('table', { name: 'Measurements' });
  await expect(measures).toBeVisible({ timeout: 60_000 });
  await expect(measures).toContainText('of the whole recording');

  // The rise to the speed of the move, between two cursors: a step.
  // The move may begin few milliseconds after the recording: the time before the trigger is then shorter than wanted.
  await type(page, 'Cursor A', -2);
  await type(page, 'Cursor B', 90);
  await expect(measures).toContainText('between the cursors');
  const row = measures.getByRole('row', { name: /reference velocity/i });
  const cells = await row.getByRole('cell').allTextContents();
  const [rise, overshoot] = [cells.at(-3)!, cells.at(-2)!];
  expect(Number(rise)).toBeGreaterThan(10); // 600 rpm at 200 rev/s^2 take 50 ms
  expect(Number(rise)).toBeLessThan(60);
  expect(overshoot).toMatch(/^\d+\.\d\d %$/);
  await picture('scope');

  const [csv] = await Promise.all([page.waitForEvent('download'), page.getByRole('link', { name: 'CSV' }).click()]);
  const lines = readFileSync(await csv.path(), 'utf8').trim().split('\n');
  expect(lines.length).toBeGreaterThan(4000);
  const [mcap] = await Promise.all([page.waitForEvent('download'), page.getByRole('link', { name: 'MCAP' }).click()]);
  expect(readFileSync(await mcap.path()).subarray(0, 8).toString('latin1')).toBe('\x89MCAP0\r\n');
  const [png] = await Promise.all([page.waitForEvent('download'), page.getByRole('button', { name: 'PNG' }).click()]);
  expect(readFileSync(await png.path()).subarray(1, 4).toString()).toBe('PNG');
});

test('an earlier recording lies over the present one', async ({ page, open }) => {
  await open(`/scope${setup}`);
  const record = page.getByRole('button', { name: 'Move and record' });
  for (const id of [1, 2]) {
    await record.click();
    await expect(page).toHaveURL(new RegExp(`rec=${id}`));
    await expect(page.getByRole('table', { name: 'Measurements' })).toBeVisible({ timeout: 60_000 });
  }
  await page.getByRole('checkbox', { name: 'overlay' }).check();
  await expect(page.getByRole('img', { name: /recording 1/ })).toBeVisible();
});

test('a reload in the middle of a recording loses nothing', async ({ page, open, line }) => {
  await open(`/scope?ch=reference/position_counts&rate=1000&ms=600000&pre=0`); // longer than any reload
  await page.getByText('with a move').click();
  await page.getByRole('button', { name: 'Record', exact: true }).click();
  await expect(panel(page, /Recording 1/).getByRole('status')).toContainText('running');
  const samples = async () => (await line.call<{ samples: number }>('GET', '/recordings/1')).samples;
  const before = await samples();
  await page.reload();
  await expect(panel(page, /Recording 1/).getByRole('status')).toContainText('running');
  await panel(page, /Recording 1/).getByRole('button', { name: 'Stop', exact: true }).click();
  await expect(panel(page, /Recording 1/).getByRole('status')).toContainText('stopped');
  expect(await samples()).toBeGreaterThan(before);
  await expect(page.getByRole('table', { name: 'Measurements' })).toBeVisible();
});

// Pixels of the first curve's colour in a lane, below the names.
const inked = (page: Page) =>
  page.evaluate(() => {
    const canvas = document.querySelector<HTMLCanvasElement>('.lane canvas');
    if (!canvas) return 0;
    const probe = document.body.appendChild(document.createElement('span'));
    probe.style.color = 'var(--curve-0)';
    const curve = (getComputedStyle(probe).color.match(/\d+/g) ?? []).map(Number);
    probe.remove();
    const top = Math.round(22 * devicePixelRatio);
    const { data } = canvas.getContext('2d')!.getImageData(80, top, canvas.width - 90, canvas.height - top);
    let count = 0;
    for (let i = 0; i < data.length; i += 4) {
      if (data[i + 3] > 200 && curve.every((value, k) => Math.abs(data[i + k] - value) < 32)) ++count;
    }
    return count;
  });

test('live curves are drawn from the stream', async ({ page, open }) => {
  await open('/scope');
  await expect.poll(() => inked(page)).toBeGreaterThan(100);
});

test('a curve without values at its beginning is drawn', async ({ page, open, line }) => {
  await line.call('POST', '/axes/reference/power', { action: 'off' });
  const { id } = await line.call<{ id: number }>('POST', '/recordings', { channels: [{ axis: 'reference', object: '6064:00' }], rate_hz: 1000, duration_ms: 2000 });
  const recorded = async () => (await line.call<{ samples: number }>('GET', `/recordings/${id}`)).samples;
  await expect.poll(recorded).toBeGreaterThan(100);
  await line.call('POST', '/axes/reference/power', { action: 'on' });
  await open(`/scope?rec=${id}`);
  await expect(page.getByRole('table', { name: 'Measurements' })).toBeVisible();
  await expect.poll(() => inked(page)).toBeGreaterThan(100);
});

test('a channel is added by its object and taken away', async ({ page, open }) => {
  await open('/scope');
  const channels = panel(page, 'Channels');
  await channels.getByLabel('Signal or object').fill('6077:00');
  await channels.getByRole('button', { name: 'Add' }).click();
  await expect(page).toHaveURL(/6077/);
  await expect(channels).toContainText('3 of 16');
  await channels.getByRole('button', { name: /Remove .*6077/ }).click();
  await expect(channels).toContainText('2 of 16');
});

test('what waits for a trigger that does not come is stopped, and read', async ({ page, open }) => {
  await open('/scope?ch=reference/position_counts&rate=1000&ms=400&trigger=fault&taxis=*');
  await page.getByText('with a move').click();
  await page.getByRole('button', { name: 'Record', exact: true }).click();
  await expect(panel(page, /Recording 1/).getByRole('status')).toContainText('armed');
  await panel(page, /Recording 1/).getByRole('button', { name: 'Stop', exact: true }).click();
  await expect(panel(page, /Recording 1/).getByRole('status')).toContainText('stopped');
  await expect(page.getByRole('table', { name: 'Measurements' })).toBeVisible();
});

test('a recording and a bus that do not exist are said to be missing', async ({ page, open, line, watched }) => {
  await open('/scope?rec=999');
  const missing = panel(page, 'Recording 999');
  await expect(missing.getByRole('alert')).toContainText('there is no recording "999"');
  await missing.getByRole('button', { name: 'Live' }).click();
  await expect(panel(page, 'Live')).toBeVisible();
  expect(watched.splice(0).join()).toContain('404'); // the browser itself logs it
  await page.goto(`${line.address}/bus?bus=zz`);
  await expect(page.getByRole('main').getByRole('alert')).toContainText('There is no bus "zz".');
  await page.getByRole('main').getByRole('link', { name: 'ecat', exact: true }).click();
  await expect(page.getByRole('button', { name: /Bus/ })).toContainText('ecat');
});

test('a cursor outside the recording is refused', async ({ page, open, line }) => {
  const { id } = await line.call<{ id: number }>('POST', '/recordings', { channels: [{ axis: 'reference', signal: 'velocity_rpm' }], rate_hz: 1000, duration_ms: 200 });
  await open(`/scope?rec=${id}`);
  await expect(page.getByRole('table', { name: 'Measurements' })).toBeVisible();
  for (const text of ['-50', '99999']) {
    const field = page.getByRole('textbox', { name: 'Cursor A' });
    await field.fill(text);
    await field.press('Tab');
    await expect(page.locator('.cursors .refusal')).toHaveText(/^From 0 to (199|200)\.$/);
    await expect(page).not.toHaveURL(/[?&]a=/);
  }
  await page.getByRole('textbox', { name: 'Cursor A' }).fill('100');
  await page.getByRole('textbox', { name: 'Cursor A' }).press('Tab');
  await expect(page).toHaveURL(/[?&]a=100/);
  await expect(page.locator('.cursors .refusal')).toHaveCount(0);
});

test('an immediate trigger has no time before it', async ({ page, open }) => {
  await open('/scope');
  const field = page.getByRole('textbox', { name: 'Pre-trigger time', exact: true });
  await expect(field).toBeDisabled();
  await expect(field).toHaveAccessibleDescription('none: an immediate recording begins at once');
  await choose(page, /Trigger/, 'edge', panel(page, 'Channels'));
  await expect(field).toBeEnabled();
  await expect(field).toHaveAccessibleDescription('');
  await choose(page, /Trigger/, 'immediate', panel(page, 'Channels'));
  await expect(field).toBeDisabled();
});

test('zooms from the keyboard', async ({ page, open }) => {
  await open('/scope?ch=reference/position_counts&rate=1000&ms=1000&pre=0');
  await page.getByText('with a move').click();
  await page.getByRole('button', { name: 'Record', exact: true }).click();
  const zoom = page.getByRole('group', { name: 'Zoom' });
  await zoom.getByRole('button', { name: 'Zoom in' }).press('Enter');
  const shown = () => ['from', 'to'].map((key) => 10 * Math.round(Number(new URL(page.url()).searchParams.get(key)) / 10));
  await expect.poll(shown).toEqual([250, 750]);
  await zoom.getByRole('button', { name: 'Later' }).press('Enter');
  await expect.poll(shown).toEqual([500, 1000]);
  await type(page, 'Cursor A', 600);
  await type(page, 'Cursor B', 300);
  await zoom.getByRole('button', { name: 'A to B' }).press('Enter');
  await expect.poll(shown).toEqual([300, 600]);
  await zoom.getByRole('button', { name: 'All' }).press('Enter');
  await expect.poll(shown).toEqual([0, 0]);
});

const channels = (page: Page) => panel(page, 'Channels').locator('.channels .name');

test('another axis takes over the channels, and a sweep leaves them', async ({ page, open }) => {
  await open('/scope?ch=reference/velocity_rpm,reference/6064:00&trigger=edge&tch=0&level=5&ms=700&rate=2000');
  await choose(page, 'Axis', 'ismc', panel(page, 'Record'));
  await expect(channels(page)).toHaveText(['ismc velocity_rpm', 'ismc 6064:00']);
  await choose(page, 'Axis', 'reference', panel(page, 'Record'));
  await expect(channels(page)).toHaveText(['reference velocity_rpm', 'reference 6064:00']);
  await type(page, 'Sweep duration', 1);
  await page.getByRole('button', { name: 'Sweep and record' }).click();
  await expect(page.getByRole('table', { name: 'Response' })).toBeVisible({ timeout: 60_000 });
  await page.getByRole('button', { name: 'Live', exact: true }).click();
  await expect(channels(page)).toHaveText(['reference velocity_rpm', 'reference 6064:00']);
  await expect(page.getByRole('button', { name: /^edge Trigger|Trigger/ })).toContainText('edge');
  await expect(page.getByRole('textbox', { name: 'Duration', exact: true })).toHaveValue('700');
});

test('every choice of an axis follows a layout, and acts after it', async ({ page, open }) => {
  await page.addInitScript(() => localStorage.setItem('servodrome.scope.layouts', JSON.stringify([{ name: 'Bench', query: { ch: 'ismc/velocity_rpm,ismc/6064:00' } }])));
  await open('/scope?ch=reference/velocity_rpm');
  const [record, excite, add] = [panel(page, 'Record'), panel(page, 'Sweep or step'), panel(page, 'Channels')];
  const chosen = async (axis: string) => {
    for (const [where, label] of [[record, 'Axis'], [excite, 'Axis to excite'], [add, 'Axis']] as const) {
      await expect(where.getByRole('button', { name: new RegExp(`${label}$`) })).toContainText(axis);
    }
  };
  await chosen('reference');
  await choose(page, 'Axis to excite', 'pronet', excite); // one that lasts until the axis of the setup changes
  await page.getByRole('button', { name: 'Bench', exact: true }).click();
  await expect(channels(page)).toHaveText(['ismc velocity_rpm', 'ismc 6064:00']);
  await chosen('ismc');
  await choose(page, 'Axis', 'reference', record);
  await expect(channels(page)).toHaveText(['reference velocity_rpm', 'reference 6064:00']);
  await chosen('reference');
});

test('an object is added by its bare index', async ({ page, open }) => {
  await open('/scope?ch=reference/velocity_rpm');
  await page.getByLabel('Signal or object').fill('6064');
  await panel(page, 'Channels').getByRole('button', { name: 'Add' }).click();
  await expect(channels(page)).toHaveText(['reference velocity_rpm', 'reference 6064:00']);
});

test('a recording with a move that the travel does not permit is refused, with the reason', async ({ page, open }) => {
  await open('/scope');
  const record = page.getByRole('button', { name: 'Move and record' });
  await expect(record).toBeEnabled();
  await type(page, 'Distance', 30, panel(page, 'Record'));
  await expect(page.getByText('The move of 30.00 rev is longer than the 10.00 rev to the positive limit switch.')).toBeVisible();
  await expect(record).toBeDisabled();
  await type(page, 'Distance', 1, panel(page, 'Record'));
  await expect(record).toBeEnabled();
});

// The answer comes when the person looks at another page, whose address is its own.
test('a recording that begins after the page was left changes no other page', async ({ page, open, line }) => {
  await open('/scope');
  let answer = () => {};
  const held = new Promise<void>((resolve) => (answer = resolve));
  await page.route('**/api/v1/recordings', async (route) => {
    if (route.request().method() === 'POST') await held;
    await route.continue();
  });
  await page.getByRole('button', { name: 'Move and record' }).click();
  await expect.poll(async () => (await line.call<{ state: string }>('GET', '/axes/ismc')).state).toBe('operation enabled');
  await page.getByRole('link', { name: 'Bus', exact: true }).click();
  await expect(page).toHaveURL(/\/bus$/);
  answer();
  await expect.poll(async () => (await line.call<{ jobs: { do: string; state: string }[] }>('GET', '/jobs')).jobs.map((job) => `${job.do} ${job.state}`)).toContain('move done');
  await expect(page).toHaveURL(/\/bus$/);
});
