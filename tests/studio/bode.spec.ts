import { readFileSync } from 'node:fs';
import { expect, panel, test, type } from './fixtures';

interface Answer {
  points: { hz: number; gain_db: number; coherence: number }[];
  bandwidth_hz: number | null;
}

test('a sweep is recorded with one click, and read as a Bode plot', async ({ page, open, line, picture }) => {
  await open('/scope');
  const excite = panel(page, 'Sweep or step');
  await excite.getByRole('button', { name: /Axis to excite/ }).click();
  await page.getByRole('option', { name: 'reference' }).click();
  await type(page, 'Sweep duration', 3, excite);
  await excite.getByRole('button', { name: 'Sweep and record' }).click();
  await expect(page.getByRole('button', { name: 'Bode' })).toHaveAttribute('aria-pressed', 'true', { timeout: 60_000 });
  const response = page.getByRole('table', { name: 'Response' });
  await expect(response).toBeVisible({ timeout: 90_000 });
  await expect(page.getByRole('img', { name: /Bode plot: gain, phase, coherence/ })).toBeVisible();

  // A loop follows what is slow, and lags behind what is fast.
  const plot = panel(page, /sweep of the velocity/);
  await type(page, 'Cursor A', 5, plot);
  await type(page, 'Cursor B', 150, plot);
  const row = async (cursor: string) => (await response.getByRole('row', { name: new RegExp(`^${cursor} `) }).getByRole('cell').allTextContents()).map((text) => Number(text.replace('\u2212', '-').replaceAll('\u2009', '')));
  await expect.poll(async () => Math.abs((await row('A'))[1])).toBeLessThan(1);
  expect((await row('B'))[3]).toBeLessThan(-20);
  const margins = page.getByLabel('Margins');
  await expect(margins).toContainText('Phase margin');
  await picture('bode');

  const [csv] = await Promise.all([page.waitForEvent('download'), plot.getByRole('button', { name: 'CSV' }).click()]);
  const [head, ...rows] = readFileSync(await csv.path(), 'utf8').trim().split('\n');
  expect(head).toBe('frequency_hz,gain_db,phase_deg,coherence');
  expect(rows.length).toBeGreaterThan(25);
  expect(rows.every((each) => each.split(',').every((cell) => Number.isFinite(Number(cell))))).toBe(true);
  const [png] = await Promise.all([page.waitForEvent('download'), plot.getByRole('button', { name: 'PNG' }).click()]);
  expect(readFileSync(await png.path()).subarray(1, 4).toString()).toBe('PNG');

  const answer = await line.call<Answer>('GET', '/recordings/1/bode?input=0&output=2&from_hz=3&to_hz=150');
  expect(answer.points.length).toBeGreaterThan(25);
  expect(answer.points.every(({ hz, coherence }) => hz >= 3 && hz <= 151 && coherence <= 1.000001)).toBe(true);
  await page.getByText('open loop').click();
  await expect(page.getByRole('img', { name: /Bode plot: gain, phase$/ })).toBeVisible();
});

test('a step is recorded with one click', async ({ page, open, line }) => {
  await open('/scope');
  const excite = panel(page, 'Sweep or step');
  await excite.getByRole('button', { name: /Axis to excite/ }).click();
  await page.getByRole('option', { name: 'reference' }).click();
  await excite.getByRole('button', { name: /Kind/ }).click();
  await page.getByRole('option', { name: 'Step' }).click();
  await excite.getByRole('button', { name: 'Step and record' }).click();
  await expect(page.getByRole('table', { name: 'Measurements' })).toBeVisible({ timeout: 90_000 });
  await expect.poll(async () => (await line.call<{ jobs: { do: string; state: string }[] }>('GET', '/jobs')).jobs.at(-1)).toMatchObject({ do: 'step', state: 'done' });
});
