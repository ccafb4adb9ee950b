import { readFileSync } from 'node:fs';
import type { Page } from '@playwright/test';
import { accessible } from './accessible';
import { choose, expect, panel, test } from './fixtures';
import type { Line } from './line';

// What the scope makes of a recording: steps without cursors, math channels, XY, spectra, overlays, names, layouts, Parquet.

const twoDrives = [{ axis: 'reference', signal: 'velocity_rpm' }, { axis: 'ismc', signal: 'velocity_rpm' }, { axis: 'reference', signal: 'torque_nm' }];

// Records two drives while one of them makes a move of one revolution at 600 rpm.
async function recordMove(line: Line, more: Record<string, unknown> = {}): Promise<number> {
  const over = async (id: number) => (await line.call<{ state: string }>('GET', `/jobs/${id}`)).state;
  const run = async (job: Record<string, unknown>) => {
    const { id } = await line.call<{ id: number }>('POST', '/axes/reference/jobs', job);
    await expect.poll(() => over(id)).toBe('done');
  };
  await run({ do: 'enable' });
  const { id } = await line.call<{ id: number }>('POST', '/recordings', { channels: twoDrives, rate_hz: 4000, duration_ms: 600, pre_ms: 50, trigger: { kind: 'edge', channel: 0, level: 5 }, ...more });
  await run({ do: 'move', by: 1, velocity: 10, acceleration: 200, deceleration: 200, units: 'revolutions' });
  await expect.poll(async () => (await line.call<{ state: string }>('GET', `/recordings/${id}`)).state).toBe('done');
  return id;
}

const cellsOf = async (page: Page, name: RegExp) => page.getByRole('table', { name: 'Measurements' }).getByRole('row', { name }).getByRole('cell').allTextContents();

test('several drives are in one recording, and the step of a move is read without cursors', async ({ page, open, line }) => {
  const id = await recordMove(line);
  await open(`/scope?rec=${id}`);
  await expect(page.getByRole('table', { name: 'Measurements' })).toBeVisible();
  const moved = await cellsOf(page, /reference velocity/);
  const [step, rise, overshoot, settling] = moved.slice(-4);
  // The steps up and down are equally high: noise decides which of them is the highest.
  expect(step).toMatch(/^\S+ → (599|600|601)|^(599|600|601)\S* → /);
  // 600 rpm at 200 rev/s² take 50 ms: from 10 to 90 % 40 ms.
  expect(Number(rise)).toBeGreaterThan(38);
  expect(Number(rise)).toBeLessThan(43);
  expect(overshoot).toMatch(/^\d+\.\d\d %$/);
  expect(Number(settling)).toBeGreaterThan(Number(rise));
  expect((await cellsOf(page, /ismc velocity/)).slice(-4)).toEqual(['–', '–', '–', '–']);

  // The curves of the moved drive end long before the recording does: Fit shows that part.
  await page.getByRole('group', { name: 'Zoom' }).getByRole('button', { name: 'Fit' }).click();
  await expect(page).toHaveURL(/from=/);
  const { searchParams } = new URL(page.url());
  expect(Number(searchParams.get('from'))).toBeLessThan(40); // the move begins at 0, out of the noise
  expect(Number(searchParams.get('to'))).toBeLessThan(500);
  await expect(page.getByRole('table', { name: 'Measurements' })).toContainText('of what is shown');
});

test('a math channel is added, measured and plotted; a wrong one is refused at its field', async ({ page, open, line }) => {
  const id = await recordMove(line);
  await open(`/scope?rec=${id}`);
  const math = panel(page, 'Mathematics');
  const formula = math.getByRole('textbox', { name: 'Formula' });
  for (const [text, problem] of [['c1 +', 'is missing at the end'], ['c9', 'there is no channel c9'], ['alert(1)', '"alert" is no channel and no function'], ['abs(c1', '")" is missing']]) {
    await formula.fill(text);
    await expect(formula).toHaveAccessibleDescription(new RegExp(problem.replace(/[()"]/g, '\\$&')));
    await math.getByRole('button', { name: 'Add the math channel' }).click();
    await expect(math.getByRole('listitem')).toHaveCount(0);
  }
  await formula.fill('derivative(c1) / 60');
  await math.getByRole('button', { name: 'Add the math channel' }).click();
  await expect(math.getByText('Enter a name.')).toBeVisible();
  await math.getByRole('textbox', { name: 'Name of the math channel' }).fill('acceleration');
  await formula.press('Enter');
  const row = page.getByRole('table', { name: 'Measurements' }).getByRole('row', { name: /acceleration/ });
  await expect(row).toContainText('rpm/s');
  // 200 rev/s², somewhat more at the beginning of the ramp.
  const maximum = Number((await row.getByRole('cell').allTextContents())[5]);
  expect(maximum).toBeGreaterThan(190);
  await expect(page.getByRole('img', { name: /acceleration/ })).toBeVisible();
  await page.reload();
  await expect(row).toBeVisible();
  await math.getByRole('button', { name: 'Remove acceleration' }).click();
  await expect(row).toHaveCount(0);
});

// Pixels with the colour of the n-th curve in the plot's drawing.
const inked = (page: Page, tone = 0) =>
  page.evaluate((n) => {
    const canvas = document.querySelector<HTMLCanvasElement>('.lane canvas');
    if (!canvas) return 0;
    const probe = document.body.appendChild(document.createElement('span'));
    probe.style.color = `var(--curve-${n})`;
    const curve = (getComputedStyle(probe).color.match(/\d+/g) ?? []).map(Number);
    probe.remove();
    const { data } = canvas.getContext('2d')!.getImageData(80, 0, canvas.width - 90, canvas.height - 60);
    let count = 0;
    for (let i = 0; i < data.length; i += 4) if (data[i + 3] > 200 && curve.every((value, k) => Math.abs(data[i + k] - value) < 32)) ++count;
    return count;
  }, tone);

test('XY draws one channel over another, with the overlays', async ({ page, open, line }) => {
  const [first, second] = [await recordMove(line), await recordMove(line)];
  await open(`/scope?rec=${first}&plot=xy`);
  await choose(page, 'Up', 'reference torque_nm');
  await expect(page.getByRole('img', { name: /reference torque_nm over reference velocity_rpm/ })).toBeVisible();
  await expect.poll(() => inked(page)).toBeGreaterThan(300);
  expect(await inked(page, 1)).toBe(0);
  await page.getByRole('checkbox', { name: 'overlay' }).check();
  await expect(page).toHaveURL(new RegExp(`with=${second}`));
  await expect.poll(() => inked(page, 1)).toBeGreaterThan(100);
  await page.getByRole('button', { name: 'Swap' }).click();
  await expect(page.getByRole('img', { name: /reference velocity_rpm over reference torque_nm/ })).toBeVisible();
  await accessible(page);
});

test('the spectrum has the amplitude of a known sine', async ({ page, open, line }) => {
  const enable = await line.call<{ id: number }>('POST', '/axes/reference/jobs', { do: 'enable' });
  await expect.poll(async () => (await line.call<{ state: string }>('GET', `/jobs/${enable.id}`)).state).toBe('done');
  const { id } = await line.call<{ id: number }>('POST', '/recordings', {
    channels: [{ axis: 'reference', object: '60FF:00' }, { axis: 'reference', signal: 'supply_v' }], rate_hz: 1000, duration_ms: 2000, trigger: { kind: 'edge', channel: 0, level: 6000 },
  });
  // A sweep from 20 to 20.001 Hz is a sine of 20 Hz. The amplitude is 1 rev/s: 131072 counts/s.
  await line.call('POST', '/axes/reference/jobs', { do: 'sweep', amplitude: 1, units: 'revolutions', from_hz: 20, to_hz: 20.001, seconds: 3 });
  await expect.poll(async () => (await line.call<{ state: string }>('GET', `/recordings/${id}`)).state).toBe('done');
  await open(`/scope?rec=${id}&plot=fft&win=flattop`);
  const row = page.getByRole('table', { name: 'Spectrum' }).getByRole('row', { name: /Target velocity/i });
  const lines = (await row.getByRole('cell').last().textContent())!;
  const [, amplitude, hz] = /^([\d.\u2009]+) at ([\d.]+) Hz/.exec(lines)!;
  expect(Math.abs(Number(amplitude.replaceAll('\u2009', '')) / 131072 - 1)).toBeLessThan(0.01);
  expect(Math.abs(Number(hz) - 20)).toBeLessThan(0.6);
  await expect(page.getByRole('table', { name: 'Spectrum' }).getByRole('row', { name: /supply/ })).toContainText(/V(309\.\d+|310)/);
  await accessible(page);
});

test('name and note of a recording are kept by the server', async ({ page, open, line }) => {
  const id = await recordMove(line, { name: 'first try' });
  await open(`/scope?rec=${id}`);
  await expect(panel(page, 'first try')).toBeVisible();
  const list = panel(page, 'Recordings');
  await list.getByRole('textbox', { name: 'Name', exact: true }).fill('with the new gains');
  await list.getByRole('textbox', { name: 'Note' }).fill('gain 12, belt “loose”');
  await list.getByRole('textbox', { name: 'Name', exact: true }).focus();
  await expect(panel(page, 'with the new gains')).toBeVisible();
  const view = () => line.call<{ name: string; note: string }>('GET', `/recordings/${id}`);
  await expect.poll(async () => (await view()).note).toBe('gain 12, belt “loose”');
  expect((await view()).name).toBe('with the new gains');
});

test('three recordings lie over each other', async ({ page, open, line }) => {
  const ids = [await recordMove(line), await recordMove(line), await recordMove(line)];
  await open(`/scope?rec=${ids[0]}&math=slip=c1-c2`);
  const overlays = page.getByRole('checkbox', { name: 'overlay' });
  await expect(overlays).toHaveCount(ids.length - 1); // all() does not wait for the list
  for (const box of await overlays.all()) await box.check();
  await expect(page.getByRole('img', { name: new RegExp(`recording ${ids[1]}.*recording ${ids[2]}`) })).toBeVisible();
  await expect(page.getByRole('img', { name: new RegExp(`slip, recording ${ids[2]}`) })).toBeVisible();
});

test('a layout is saved, survives a reload, and is applied', async ({ page, open }) => {
  await open('/scope?ch=reference/velocity_rpm,ismc/velocity_rpm&rate=4000&math=slip=c1-c2');
  const layouts = panel(page, 'Layouts');
  await layouts.getByRole('textbox').fill('slip of two');
  await layouts.getByRole('button', { name: 'Save' }).click();
  await open('/scope?ch=reference/torque_nm&trigger=edge&level=3');
  await layouts.getByRole('button', { name: 'slip of two', exact: true }).click();
  await expect(panel(page, 'Channels').locator('.channels .name')).toHaveText(['reference velocity_rpm', 'ismc velocity_rpm']);
  await expect(page).not.toHaveURL(/trigger/);
  await expect(panel(page, 'Mathematics')).toContainText('slip = c1-c2');
  await layouts.getByRole('button', { name: 'Delete layout slip of two' }).click();
  await expect(layouts.getByRole('listitem')).toHaveCount(0);
});

test('a signal of all axes is added at once', async ({ page, open }) => {
  await open('/scope?ch=reference/velocity_rpm');
  await page.getByLabel('Signal or object').fill('velocity_rpm');
  await page.getByRole('button', { name: 'Of all axes' }).click();
  await expect(panel(page, 'Channels').locator('.channels .name')).toHaveText(['reference velocity_rpm', 'ismc velocity_rpm', 'pronet velocity_rpm', 'ismk velocity_rpm', 'jmc velocity_rpm']);
  await expect(page.getByRole('img', { name: /ismc velocity_rpm.*jmc velocity_rpm/ })).toBeVisible();
});

test('the files of a recording have its name', async ({ page, open, line }) => {
  const { id } = await line.call<{ id: number }>('POST', '/recordings', { name: 'first try / gain 12', channels: [{ axis: 'reference', signal: 'velocity_rpm' }], rate_hz: 1000, duration_ms: 100 });
  await open(`/scope?rec=${id}`);
  await expect(page.getByRole('table', { name: 'Measurements' })).toBeVisible();
  for (const kind of ['CSV', 'MCAP', 'Parquet', 'PNG']) {
    const [file] = await Promise.all([page.waitForEvent('download'), page.getByRole('group', { name: 'Save as' }).getByText(kind, { exact: true }).click()]);
    expect(file.suggestedFilename()).toBe(`first-try-gain-12.${kind.toLowerCase()}`);
  }
});

test('a recording is exported as Parquet', async ({ page, open, line }) => {
  const id = await recordMove(line);
  await open(`/scope?rec=${id}&math=slip=c1-c2`);
  const [file] = await Promise.all([page.waitForEvent('download'), page.getByRole('button', { name: 'Parquet' }).click()]);
  expect(file.suggestedFilename()).toBe(`recording-${id}.parquet`);
  const bytes = readFileSync(await file.path());
  expect([bytes.subarray(0, 4), bytes.subarray(-4)].map(String)).toEqual(['PAR1', 'PAR1']);
  for (const column of ['tick', 'time_s', 'reference velocity_rpm [rpm]', 'slip [rpm]']) expect(bytes.includes(column)).toBe(true);
});

for (const [width, height] of [[1366, 768], [1920, 1080]]) {
  test(`the plots take the height of the window, ${width} x ${height}`, async ({ page, open, line }) => {
    const id = await recordMove(line);
    await page.setViewportSize({ width, height });
    await open(`/scope?rec=${id}`);
    const lanes = page.locator('.lanes.fill');
    const share = async () => ((await lanes.boundingBox())?.height ?? 0) / height; // null: not drawn yet
    await expect.poll(share).toBeGreaterThan(0.5);
    // The toolbar below is still on the screen.
    await expect(page.getByRole('button', { name: 'PNG' })).toBeInViewport();
  });
}
