import type { Page } from '@playwright/test';
import { inEveryLook, slow_ms } from './accessible';
import { expect, test, withoutTimeouts } from './fixtures';

// Every page, in every look: opens, has no serious accessibility violation, no error, no request outside, and fits.

const pages: Record<string, string> = {
  line: '/', axis: '/axis/reference', homing: '/axis/ismc?do=home', scope: '/scope', boards: '/boards', faults: '/faults/reference', misbehaviour: '/misbehaviour/reference', objects: '/objects/reference',
  plant: '/plant/reference', bus: '/bus', traffic: '/bus/traffic?bus=can0', parameters: '/objects/reference?view=parameters', pdos: '/objects/reference?view=pdos', changes: '/objects/reference?view=changes', tuning: '/tuning/ismk',
  inputs: '/commission/ismk?step=inputs', report: '/commission/pronet?step=report',
};

for (const [name, path] of Object.entries(pages)) {
  test(`${name} in every size and colour`, async ({ page, open, picture }) => {
    test.setTimeout(slow_ms);
    await open(path);
    await inEveryLook(page, name, picture);
  });
}

// Tables that are wider than the window and have no box of their own that scrolls.
const unboxed = (page: Page) =>
  page.evaluate(() => [...document.querySelectorAll('main table')].filter((table) => {
    if (table.scrollWidth <= table.parentElement!.clientWidth) return false;
    const box = table.closest('.scroll');
    return box === null || !/auto|scroll/.test(getComputedStyle(box).overflowX) || box.getBoundingClientRect().right > innerWidth;
  }).map((table) => table.getAttribute('aria-label') ?? table.textContent?.slice(0, 40)));

test('on a telephone wide tables scroll in their own boxes, and not the page', async ({ page, open, line }) => {
  test.setTimeout(300_000);
  await page.setViewportSize({ width: 390, height: 844 });
  const fits = async (what: string) => {
    expect.soft(await unboxed(page), what).toEqual([]);
    expect.soft(await page.evaluate(() => Math.max(...[document.documentElement, document.querySelector('.page')!].map(({ scrollWidth, clientWidth }) => scrollWidth - clientWidth))), what).toBeLessThanOrEqual(0);
  };
  const measured = { at: '2026-01-01T12:00:00Z', rise_ms: 12.34, overshoot_percent: 23.4, settling_ms: 123.45, peak_velocity: 1234.5, greatest_error: 0.12345, request: {}, x: [0, 1], curves: [] };
  const loop = { bandwidth_hz: 123.4, phase_margin_deg: 45, inertia: '1 kg m2', friction: '1 Nm', resonance_hz: 432 };
  const steps = Object.fromEntries(['velocity', 'cycle'].map((id) => [id, { typed: {}, found: { first: measured, last: measured, loop, loopLast: loop, proposed: { bandwidth_hz: 234.5, phase_margin_deg: 50, values: {} } } }]));
  const mechanics = { machine: 'revolutions', feed_mm: 10, motor_turns: 1, load_turns: 1, units_per_turn: null };
  const journal = [{ step: 'velocity', object: '6081:00', name: 'Profile velocity', unit: 'units/s', before: 1310720, after: 2621440 }];
  await page.addInitScript((text) => localStorage.setItem('servodrome.guide.reference', text), JSON.stringify({ version: 1, product: 'generic402', mechanics, steps, journal, run: null }));
  for (const step of ['velocity', 'cycle', 'report']) {
    await open(`/commission/reference?step=${step}`);
    await expect(page.getByRole('table', { name: 'Measured, before and after' }).first()).toBeVisible();
    await fits(step);
  }
  await line.call('PUT', '/axes/reference/objects/6083/0', { value: 123456789 });
  for (const path of ['/plant/reference', '/plant/ismc', '/objects/reference?view=changes', '/bus', '/tuning/reference']) {
    await open(path);
    await expect(page.getByRole('table').first()).toBeVisible();
    await fits(path);
  }
  await open('/objects/reference?view=parameters');
  await page.getByRole('button', { name: 'Compare with factory defaults' }).click();
  await expect(page.getByRole('table').first()).toBeVisible();
  await fits('differences');
  await open('/misbehaviour/reference');
  await page.getByRole('button', { name: 'Arm' }).click();
  await expect(page.getByRole('table').first()).toBeVisible();
  await fits('rules');
  const channels = ['position_counts', 'velocity_rpm', 'following_error'].map((signal) => ({ axis: 'reference', signal }));
  const { id } = await line.call<{ id: number }>('POST', '/recordings', { name: 'tables', channels, rate_hz: 1000, duration_ms: 300, pre_ms: 0, trigger: { kind: 'now' } });
  for (const plot of ['', '&plot=fft', '&plot=bode', '&plot=xy']) {
    await open(`/scope?ch=reference/velocity_rpm&rec=${id}${plot}`);
    if (plot !== '&plot=xy') await expect(page.getByRole('table').first()).toBeVisible();
    await fits(`recording ${plot}`);
  }
});

test('controls are not drawn anew each time that an axis moves', async ({ page, open, line }) => {
  await line.call('POST', '/axes/reference/jobs', { do: 'enable' });
  const metrics = await page.context().newCDPSession(page);
  await metrics.send('Performance.enable');
  const script = async () => (await metrics.send('Performance.getMetrics')).metrics.find(({ name }) => name === 'ScriptDuration')!.value;
  const costs = async (path: string) => {
    await open(path);
    await page.waitForTimeout(2000);
    const before = await script();
    await page.waitForTimeout(4000);
    return (await script()) - before;
  };
  // Against the page that draws every axis 20 times a second, on the same machine: it was 20 times as much.
  const line_page = await costs('/');
  expect(await costs('/plant/reference')).toBeLessThan(5 * line_page);
});

test('the keyboard reaches every page, and stops the line', async ({ page, open }) => {
  await withoutTimeouts(page);
  await open('/');
  await page.keyboard.press('Tab');
  await expect(page.getByText('Skip to the content')).toBeFocused();
  await page.getByRole('link', { name: 'Axis', exact: true }).focus();
  await page.keyboard.press('Enter');
  await expect(page).toHaveURL(/\/axis\//);
  await page.keyboard.press('Control+Space');
  await expect(page.getByText('all axes stopped')).toBeVisible();
});

test('the choice of colours survives a reload', async ({ page, open }) => {
  await page.emulateMedia({ colorScheme: 'light' });
  await open('/');
  const ground = () => page.evaluate(() => getComputedStyle(document.body).backgroundColor);
  const light = await ground();
  await page.getByRole('button', { name: 'Colours' }).click();
  await page.getByRole('option', { name: 'Dark' }).click();
  await expect.poll(ground).not.toBe(light);
  const dark = await ground();
  await page.reload();
  await expect.poll(ground).toBe(dark);
});
