import { execFile } from 'node:child_process';
import { readFileSync } from 'node:fs';
import { promisify } from 'node:util';
import { accessible } from './accessible';
import { choose, expect, panel, test } from './fixtures';
import { lineFile, servodrome } from './line';

// The traffic of a bus: heartbeats of a drive, set by its own service port, and what a master on the bus does.

const run = promisify(execFile);

test.use({ lineText: lineFile().replace('type = "can"\n', 'type = "can"\nlinks = ["socketcand:127.0.0.1:0/can0"]\n') });

test('frames are shown in words, filtered, looked at and saved', async ({ page, open, line, picture }) => {
  const can0 = await line.call<{ links: { name: string }[] }>('GET', '/buses/can0');
  const link = can0.links[0].name;
  await open('/bus');
  await page.getByRole('link', { name: 'Traffic' }).click();
  await expect(page).toHaveURL(/\/bus\/traffic/);
  await expect(panel(page, 'Traffic').getByRole('button', { name: 'Stop recording' })).toBeVisible();
  const frames = page.getByRole('listbox', { name: 'Frames' });

  await run(servodrome, ['get', '--bus', link, '--node', '2', '6041']);
  await run(servodrome, ['get', '--bus', link, '--node', '2', '5555']).catch(() => undefined); // refused: an error to be seen
  await line.call('PUT', '/axes/reference/objects/1017/00', { value: 200 });
  await expect(frames.getByRole('option').filter({ hasText: 'SDO read 6041:00 Statusword' }).first()).toBeVisible();
  await expect(frames.getByRole('option').filter({ hasText: 'SDO abort' }).first()).toHaveClass('wrong');
  await expect(frames.getByRole('option').filter({ hasText: 'heartbeat' }).first()).toBeVisible();
  await frames.getByRole('option').filter({ hasText: 'SDO 6041:00 Statusword is' }).first().click();
  await expect(panel(page, /^Frame \d/)).toContainText('reference, about node 2');
  // Rows, an error and a chosen frame in both schemes.
  for (const colorScheme of ['dark', 'light'] as const) {
    await page.emulateMedia({ colorScheme });
    await accessible(page, colorScheme);
  }
  await picture('traffic');

  // The filter is in the address, and asks the server for what was before as well.
  await choose(page, 'Kind', /^sdo$/);
  await expect(frames.getByRole('option').filter({ hasText: 'heartbeat' })).toHaveCount(0);
  await expect(frames.getByRole('option').filter({ hasText: 'SDO read 6041:00 Statusword' }).first()).toBeVisible();
  await expect(page).toHaveURL(/kind=sdo/);
  await page.getByRole('searchbox', { name: 'Filter by text' }).fill('abort');
  await expect(frames.getByRole('option').filter({ hasNotText: 'abort' })).toHaveCount(0);
  await expect(frames.getByRole('option').filter({ hasText: 'SDO abort' }).first()).toBeVisible();
  await choose(page, 'Kind', /^all$/);
  await page.getByRole('searchbox', { name: 'Filter by text' }).fill('');

  // The keyboard walks through the frames.
  await frames.focus();
  await page.keyboard.press('Home');
  const first = await page.getByRole('heading', { name: /^Frame/ }).textContent();
  await page.keyboard.press('ArrowDown');
  await expect(page.getByRole('heading', { name: /^Frame/ })).not.toHaveText(first ?? '');

  // Pause: the table stands still while the server goes on. Then everything is there.
  await page.getByRole('button', { name: 'Pause' }).click();
  await expect(page.getByText('display paused')).toBeVisible();
  await page.getByRole('button', { name: 'Resume' }).click();
  await page.getByRole('button', { name: 'Clear' }).click();
  await expect(frames.getByRole('option').filter({ hasText: 'SDO read' })).toHaveCount(0);

  const saving = page.waitForEvent('download');
  await page.getByRole('link', { name: 'Save candump' }).click();
  const saved = readFileSync(await (await saving).path(), 'utf8');
  expect(saved).toContain(' can0 602#4041600000000000');
});

test('more frames than anybody can read do not stop the page', async ({ page, open, line }) => {
  for (const axis of ['ismc', 'reference', 'pronet', 'ismk']) await line.call('PUT', `/axes/${axis}/objects/1017/00`, { value: 1 });
  await open('/bus/traffic?bus=can0');
  const frames = page.getByRole('listbox', { name: 'Frames' });
  await expect(page.getByText('rows skipped or lost')).toBeVisible({ timeout: 60_000 });
  // However many there are, those that are seen are drawn.
  expect(await frames.getByRole('option').count()).toBeLessThan(100);
  await page.getByRole('button', { name: 'Stop recording' }).click();
  await expect(page.getByText('recording is off')).toBeVisible({ timeout: 60_000 });
  // The place of what is left out is marked in the table.
  await expect(async () => {
    await frames.evaluate(async (box) => {
      box.scrollTop -= box.clientHeight;
      for (let i = 0; i < 2; ++i) await new Promise(requestAnimationFrame); // the rows of the new place are drawn
    });
    expect(await frames.getByRole('option').filter({ hasText: 'skipped: too many to display' }).count()).toBeGreaterThan(0);
  }).toPass({ timeout: 60_000, intervals: [50] });
});

test('a segment of EtherCAT and a phone', async ({ page, open, line }) => {
  await page.setViewportSize({ width: 390, height: 844 });
  await open('/bus/traffic?bus=ecat');
  await expect(page.getByText('0 frames recorded')).toBeVisible();
  await expect(page.getByRole('link', { name: 'Save pcap' })).toBeVisible();
  expect(await page.evaluate(() => Math.max(...[document.documentElement, document.querySelector('.page')!].map(({ scrollWidth, clientWidth }) => scrollWidth - clientWidth)))).toBeLessThanOrEqual(0);
  expect((await line.call<{ recording: boolean }>('GET', '/buses/ecat/traffic')).recording).toBe(true);
});
