import type { Page } from '@playwright/test';
import { expect, panel, test, type } from './fixtures';

interface Job {
  id: number;
  do: string;
  state: string;
  found?: { after?: { bandwidth_hz: number }; gains: { object: string; after: number }[] };
}

// Pixels of a plot's first lane that are strongly coloured: curves are, axes and grid are not.
const inkIn = (page: Page, label: string) =>
  page.locator(`.lanes[aria-label^="${label}"] canvas`).first().evaluate((canvas: HTMLCanvasElement) => {
    const { data } = canvas.getContext('2d')!.getImageData(0, 0, canvas.width, canvas.height);
    let coloured = 0;
    for (let i = 0; i < data.length; i += 4) if (data[i + 3] > 50 && Math.max(data[i], data[i + 1], data[i + 2]) - Math.min(data[i], data[i + 1], data[i + 2]) > 60) ++coloured;
    return coloured;
  });

test('an axis is tuned, its gains are written, measured, and put back', async ({ page, open, line, picture }) => {
  test.setTimeout(300_000);
  const gain = async () => (await line.call<{ value: number }>('GET', '/axes/reference/objects/2010/2')).value;
  const before = await gain();
  await open('/tuning/reference');
  const tune = panel(page, 'Tune the velocity loop');
  await type(page, 'Target bandwidth (blank: at least 60 % of maximum)', 60, tune);
  await tune.getByRole('button', { name: 'Tune', exact: true }).click();
  const progress = page.getByRole('progressbar', { name: 'Progress of the tuning' });
  await expect(progress).toBeVisible({ timeout: 30_000 });
  await expect.poll(async () => Number(await progress.getAttribute('value')), { timeout: 60_000 }).toBeGreaterThan(0);
  await expect(tune.getByRole('button', { name: 'Measure and propose' })).toBeDisabled();

  const found = panel(page, 'Tuning results');
  await expect(found).toBeVisible({ timeout: 240_000 });
  const figures = found.getByRole('table', { name: 'Before and after' });
  const bandwidth = await figures.getByRole('row', { name: /^Bandwidth/ }).getByRole('cell').allTextContents();
  expect(Number(bandwidth[1])).toBe(60);
  expect(Math.abs(Number(bandwidth[2]) - 60)).toBeLessThanOrEqual(9);
  await expect(figures.getByRole('row', { name: /Step: rise time/ })).toBeVisible();
  await expect(found.getByRole('img', { name: /Open velocity loop/ })).toBeVisible();
  await expect(found.getByRole('img', { name: /Step of the velocity/ })).toBeVisible();
  const { jobs } = await line.call<{ jobs: Job[] }>('GET', '/jobs');
  const job = await line.call<Job>('GET', `/jobs/${jobs.at(-1)!.id}`);
  expect(await gain()).toBe(job.found!.gains[0].after);
  // The table below has the drive's numbers.
  const gains = page.getByRole('table', { name: 'Gains', exact: true });
  await expect(gains.getByRole('textbox', { name: 'Velocity loop proportional gain' })).toHaveValue(String(job.found!.gains[0].after));

  // What was found is there after a reload.
  await page.setViewportSize({ width: 1280, height: 1480 });
  await page.reload();
  await expect(found.getByRole('img', { name: /Step of the velocity/ })).toBeVisible();
  await expect(gains).toBeVisible();
  await expect.poll(() => inkIn(page, 'Open velocity loop')).toBeGreaterThan(2000);
  await picture('tuning');
  await found.getByRole('button', { name: 'Restore the old gains' }).click();
  await expect.poll(gain).toBe(before);
});

test('a gain is turned by hand, and what the drive refuses is said', async ({ page, open, line }) => {
  const value = async (object: string) => (await line.call<{ value: number }>('GET', `/axes/ismk/objects/${object}`)).value;
  await open('/tuning/ismk');
  const kvp = page.getByRole('textbox', { name: 'Kvp[0]' });
  await expect(kvp).toHaveValue('4');
  await expect(page.getByRole('table', { name: 'Gain set 3' })).toBeVisible();
  await kvp.fill('6');
  await kvp.press('Enter');
  await expect.poll(async () => value('60F9/1')).toBe(6);
  await expect(page.getByText(/stiffer/).first()).toBeVisible();

  // By another client.
  await line.call('PUT', '/axes/ismk/objects/60F9/1', { value: 5 });
  await expect(kvp).toHaveValue('5', { timeout: 10_000 });
});

test('a tuning is ended, and the axis stands', async ({ page, open, line }) => {
  await open('/tuning/jmc');
  const tune = panel(page, 'Tune the velocity loop');
  await expect(tune.getByRole('button', { name: 'Tune', exact: true })).toHaveCount(0);
  await expect(tune).toContainText('in SI units');
  await tune.getByRole('button', { name: 'Measure and propose' }).click();
  await tune.getByRole('button', { name: 'End' }).click();
  await expect(tune.getByRole('alert')).toContainText('interrupted', { timeout: 30_000 });
  await expect.poll(async () => (await line.call<{ state: string }>('GET', '/axes/jmc')).state).not.toBe('operation enabled');
  // After a reload that is the outcome of the axis's latest job, no news.
  await page.reload();
  await expect(tune.getByRole('status')).toContainText(/^tune: cancelled · .*interrupted/);
  await expect(tune.getByRole('alert')).toHaveCount(0);
  // A later command makes its outcome out of date.
  await page.getByRole('link', { name: 'Axis', exact: true }).click();
  await page.getByRole('button', { name: 'Power cycle' }).click();
  await page.getByRole('link', { name: 'Tuning' }).click();
  await expect(tune.getByRole('button', { name: 'Measure and propose' })).toBeEnabled();
  await expect(tune.getByRole('status')).toHaveCount(0);
  // After a reload too, if that command was a job, of any client.
  await line.call('POST', '/axes/jmc/jobs', { do: 'reset_fault' });
  await page.reload();
  await page.waitForLoadState('networkidle'); // the page has the list of the jobs
  await expect(tune.getByRole('button', { name: 'Measure and propose' })).toBeEnabled();
  await expect(tune.getByRole('status')).toHaveCount(0);
  await expect(tune.getByRole('alert')).toHaveCount(0);
});

test('a drive tunes itself', async ({ page, open }) => {
  await open('/tuning/ismk');
  await page.getByRole('button', { name: 'Let the drive tune itself' }).click();
  const table = page.getByRole('table', { name: 'Gains before and after' });
  await expect(table).toBeVisible({ timeout: 90_000 });
  await expect(table.getByRole('row', { name: /Kvp\[0\]/ })).not.toContainText('unchanged');
});

test('a drive whose manual prints no gains says so', async ({ page, open }) => {
  await open('/tuning/ismc');
  await expect(page.getByText('The manual of this drive documents no gains')).toBeVisible();
  await expect(page.getByText('has no object 6076h (rated torque)')).toBeVisible();
  await expect(page.getByRole('button', { name: 'Measure and propose' })).toHaveCount(0);
});
