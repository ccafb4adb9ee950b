import { readFileSync } from 'node:fs';
import type { Page } from '@playwright/test';
import { accessible, rulesFor } from './accessible';
import { choose, expect, hold, jogUntil, noPower, panel, takenBack, test, withoutTimeouts } from './fixtures';

// Dashboards: made, used, exported and imported by a user.

const widgets = [
  { kind: 'value', title: 'Speed', span: 1, channel: 'reference/velocity_rpm', format: 'decimal' },
  { kind: 'value', title: 'Statusword', span: 1, channel: 'reference/6041:00', format: 'binary' },
  { kind: 'slider', title: 'Profile acceleration', span: 1, object: 'reference/6083:00', minimum: 0, maximum: 1000000, step: 1000 },
  { kind: 'switch', title: 'Output', span: 1, object: 'reference/60FE:02', on: 262144, off: 0 },
  { kind: 'plot', title: 'Motion', span: 2, channels: ['reference/velocity_rpm', 'reference/following_error'], seconds: 10 },
  { kind: 'watch', title: 'Objects', span: 2, channels: ['reference/6041:00', 'reference/1008:00', 'reference/606C:00', 'ismc/6041:00', 'reference/DI0'] },
  { kind: 'button', title: '', span: 1, axis: 'reference', do: 'enable' },
  { kind: 'button', title: 'Forward', span: 1, axis: 'reference', do: 'jog', velocity: 1 },
  { kind: 'button', title: '', span: 1, axis: 'reference', do: 'stop' },
  { kind: 'script', title: 'There and back', span: 2, lines: 'reference enable\nrepeat 2\n  reference move by 1 velocity 10 acceleration 200\n  reference move by -1 velocity 10\nend\nreference set 6081:00 4711' },
  { kind: 'note', title: 'Mind', span: 1, text: 'The belt is new.' },
];
const file = (boards: unknown) => ({ name: 'boards.json', mimeType: 'application/json', buffer: Buffer.from(JSON.stringify({ format: 'servodrome-dashboards', version: 1, boards })) });
const importField = (page: Page) => page.getByLabel('Import a file');

async function openBoard(page: Page, open: (path: string) => Promise<void>, its: unknown[] = widgets) {
  await open('/boards');
  await importField(page).setInputFiles(file([{ name: 'Test bench', widgets: its }]));
  await expect(page.getByRole('link', { name: 'Test bench' })).toBeVisible();
}
const value = async (call: () => Promise<{ value: number }>) => (await call()).value;

test('a dashboard is made from nothing, saved, changed and deleted', async ({ page, open }) => {
  await open('/boards');
  await page.getByRole('textbox', { name: 'Name of a dashboard' }).fill('Axis of the door');
  await page.getByRole('button', { name: 'New', exact: true }).click();
  await expect(page).toHaveURL(/\/boards\?name=Axis/);
  await choose(page, 'New widget', /^Value/);
  await page.getByRole('button', { name: 'Add the widget' }).click();
  // Without its signal it is not saved, and the field says why.
  await page.getByRole('button', { name: 'Save the widget' }).click();
  await expect(page.getByRole('alert')).toContainText('Signal or object: is missing');
  await choose(page, 'Axis of signal or object', 'reference');
  await page.getByRole('textbox', { name: 'Title' }).fill('Voltage');
  await page.getByRole('combobox', { name: 'Signal or object', exact: true }).fill('supply_v');
  await page.getByRole('button', { name: 'Save the widget' }).click();
  await expect(panel(page, 'Voltage').locator('.figure')).toHaveText(/^3(09|10).*V$/);

  await choose(page, 'New widget', /^Note/);
  await page.getByRole('button', { name: 'Add the widget' }).click();
  await page.getByRole('textbox', { name: 'Text' }).fill('second');
  await page.getByRole('button', { name: 'Save the widget' }).click();
  await page.getByRole('button', { name: 'Move Note back' }).click();
  await expect(page.locator('.widget h2')).toHaveText(['Note', 'Voltage']);
  await page.reload();
  await expect(page.locator('.widget h2')).toHaveText(['Note', 'Voltage']);
  await expect(page.getByRole('button', { name: 'Remove Note' })).toHaveCount(0); // it opens for use, not for changes

  await page.getByText('edit', { exact: true }).click();
  await page.getByRole('button', { name: 'Remove Note' }).click();
  await expect(page.locator('.widget h2')).toHaveText(['Voltage']);
  await page.getByRole('textbox', { name: 'Name of a dashboard' }).fill('Door');
  await page.getByRole('button', { name: 'Rename' }).click();
  await expect(page).toHaveURL(/\/boards\?name=Door$/);
  await page.getByRole('button', { name: 'Delete', exact: true }).click();
  await page.getByRole('button', { name: 'Really delete "Door"' }).click();
  await expect(page.getByText('It is kept in this browser')).toBeVisible();
});

test('values and the watch list follow the drive over the stream', async ({ page, open, line, excused }) => {
  excused.push(noPower);
  const requests: string[] = [];
  page.on('request', (request) => requests.push(request.url()));
  await openBoard(page, open);
  const watch = page.getByRole('table', { name: 'Objects' });
  const row = (name: RegExp) => watch.getByRole('row', { name });
  const word = await value(() => line.call('GET', '/axes/reference/objects/6041/0'));
  await expect(row(/^reference 6041:00/)).toContainText(`${word}${word.toString(16).toUpperCase().padStart(4, '0')}h`);
  await expect(row(/^reference 6041:00/)).toContainText('Statusword');
  await expect(row(/^reference 1008:00/)).toContainText(/generic402|reference|Servodrome/i); // a text: polled, since the stream carries numbers
  await expect(row(/^ismc 6041:00/)).toContainText('h');
  await expect(panel(page, 'Statusword').locator('.figure')).toHaveText(/^[01 ]{19}$/);
  await line.call('POST', '/axes/reference/jobs', { do: 'enable' });
  await expect(row(/^reference 6041:00/)).toContainText(/\d{3,5}0[0-9A-F]37h/); // operation enabled
  await line.call('PUT', '/axes/reference/inputs', { DI0: true });
  await expect(row(/^reference DI0/)).toContainText('101h0000 0001');
  await line.call('POST', '/axes/reference/power', { action: 'off' });
  await expect(row(/^reference 6041:00/)).toContainText('–');
  await line.call('POST', '/axes/reference/power', { action: 'on' });
  await expect(row(/^reference 6041:00/)).toContainText('h');
  // The stream carries the numbers: only the text is read by requests.
  const polled = requests.filter((url) => url.includes('/values?'));
  expect(polled.length).toBeGreaterThan(0);
  expect(polled.filter((url) => !/objects=1008:00$/.test(decodeURIComponent(url)))).toEqual([]);
});

test('a slider writes the last value, and shows a refusal', async ({ page, open, line, watched }) => {
  await openBoard(page, open, [widgets[2], { kind: 'slider', title: 'Wrong', span: 1, object: 'reference/6098:00', minimum: -128, maximum: 127, step: 1 }]);
  const slider = panel(page, 'Profile acceleration').getByRole('slider');
  await expect(slider).toBeEnabled();
  const written: number[] = [];
  page.on('request', (request) => request.method() === 'PUT' && request.url().includes('6083') && written.push(Number((request.postDataJSON() as { value: number }).value)));
  await slider.fill('200000');
  for (let n = 0; n < 40; ++n) await slider.press('ArrowRight');
  const present = () => value(() => line.call('GET', '/axes/reference/objects/6083/0'));
  await expect.poll(present).toBe(240000);
  await expect(panel(page, 'Profile acceleration').getByRole('status')).toHaveText('drive: 240\u2009000');
  expect(written.at(-1)).toBe(240000);

  // Homing method 99 does not exist.
  const wrong = panel(page, 'Wrong');
  const before = await value(() => line.call('GET', '/axes/reference/objects/6098/0'));
  await wrong.getByRole('textbox').fill('99');
  await wrong.getByRole('textbox').press('Enter');
  await expect(wrong.getByRole('alert')).toContainText('99: the drive refuses');
  await expect(wrong.getByRole('slider')).toHaveValue(String(before));
  expect(watched.splice(0).every((each) => /422|409/.test(each))).toBe(true);
});

test('STOP drops the value of a slider that waits for a write', async ({ page, open }) => {
  await openBoard(page, open, [widgets[2]]);
  const slider = panel(page, 'Profile acceleration').getByRole('slider');
  const status = panel(page, 'Profile acceleration').getByRole('status');
  await expect(slider).toBeEnabled();
  const written: number[] = [];
  let release = () => {};
  const released = new Promise<void>((resolve) => (release = resolve));
  await page.route('**/axes/reference/objects/6083/0', async (route) => {
    if (route.request().method() === 'PUT') {
      written.push((route.request().postDataJSON() as { value: number }).value);
      await released;
    }
    await route.continue();
  });
  await slider.fill('200000');
  await expect.poll(() => written).toEqual([200000]);
  await slider.fill('300000');
  await expect(slider).toHaveValue('300000');
  const stopped = page.waitForResponse((response) => response.url().endsWith('/api/v1/stop'));
  await page.getByRole('button', { name: 'STOP', exact: true }).click();
  await stopped;
  release();
  await expect(status).toHaveText('drive: 200\u2009000');
  await expect(slider).toHaveValue('200000');
  await slider.fill('500000');
  await expect(status).toHaveText('drive: 500\u2009000');
  expect(written).toEqual([200000, 500000]);
});

const velocity = { kind: 'slider', title: 'Target', span: 1, object: 'reference/60FF:00', minimum: 0, maximum: 1000000, step: 1 };

test('a halt drops the value of a slider that waits, and takes back the write that is on its way', async ({ page, open, line, excused }) => {
  excused.push(takenBack);
  await withoutTimeouts(page);
  await line.call('PUT', '/axes/reference/objects/6060/0', { value: 3 });
  await openBoard(page, open, [velocity, { kind: 'button', title: 'Halt it', span: 1, axis: 'reference', do: 'stop' }]);
  await line.call('POST', '/axes/reference/jobs', { do: 'enable' });
  await expect.poll(async () => (await line.call<{ state: string }>('GET', '/axes/reference')).state).toBe('operation enabled');
  const slider = panel(page, 'Target').getByRole('slider');
  await expect(slider).toBeEnabled();
  const written: number[] = [];
  let release = () => {};
  const released = new Promise<void>((resolve) => (release = resolve));
  await page.route('**/axes/reference/objects/60ff/0', async (route) => {
    if (route.request().method() === 'PUT') {
      written.push((route.request().postDataJSON() as { value: number }).value);
      await released;
    }
    await route.continue().catch(() => undefined); // the page may have given it up
  });
  await slider.fill('200000');
  await expect.poll(() => written).toEqual([200000]);
  await slider.fill('300000');
  const halted = page.waitForResponse((response) => response.url().endsWith('/axes/reference/jobs'));
  await page.getByRole('button', { name: 'Halt it' }).click();
  await halted;
  release();
  await expect(panel(page, 'Target').getByRole('alert')).toContainText('200\u2009000: the command was taken back');
  await expect(slider).toHaveValue('0');
  await page.waitForTimeout(300); // longer than the pause between two writes
  expect(written).toEqual([200000]);
  expect(await value(() => line.call('GET', '/axes/reference/objects/60FF/0'))).toBe(0);
});

test('a number that is typed beside a slider is dropped by the press of STOP or of a halt', async ({ page, open }) => {
  await openBoard(page, open, [velocity, { kind: 'button', title: 'Halt it', span: 1, axis: 'reference', do: 'stop' }, { kind: 'script', title: 'Waits', span: 2, lines: 'reference stop\nwait 3600' }]);
  const field = panel(page, 'Target').getByRole('textbox');
  await expect(field).toBeEnabled();
  const written: number[] = [];
  page.on('request', (request) => request.method() === 'PUT' && /60ff/i.test(request.url()) && written.push((request.postDataJSON() as { value: number }).value));
  await panel(page, 'Waits').getByRole('button', { name: 'Run' }).click();
  await expect(panel(page, 'Waits').getByRole('status')).toHaveText('line 2');
  for (const name of ['Stop the script', 'Halt it', 'STOP']) {
    await field.fill('500');
    await page.getByRole('button', { name, exact: true }).click();
    await expect(field).not.toBeFocused();
    await expect(field).toHaveValue('0');
  }
  await field.fill('700');
  await field.press('Enter');
  await expect.poll(() => written).toEqual([700]);
});

test('a switch shows the drive, not the click', async ({ page, open, line }) => {
  await openBoard(page, open, [widgets[3], { kind: 'switch', title: 'Read only', span: 1, object: 'reference/60FE:01', on: 262144, off: 0 }]);
  const toggle = panel(page, 'Output').getByRole('switch');
  await expect(toggle).not.toBeChecked();
  await toggle.click();
  await expect(toggle).toBeChecked();
  expect(await value(() => line.call('GET', '/axes/reference/objects/60FE/2'))).toBe(262144);
  await line.call('PUT', '/axes/reference/objects/60FE/2', { value: 0 }); // by someone else
  await expect(toggle).not.toBeChecked();
  await line.call('PUT', '/axes/reference/objects/60FE/2', { value: 5 });
  await expect(panel(page, 'Output')).toContainText('the drive has 5');
});

test('buttons move the axis by jobs, a jog while it is pressed, and STOP is always there', async ({ page, open, line }) => {
  await openBoard(page, open);
  const jog = page.getByRole('button', { name: 'Forward' });
  await expect(jog).toBeDisabled();
  await page.getByRole('button', { name: 'enable reference' }).click();
  await expect(jog).toBeEnabled();
  const position = async () => (await line.call<{ position_counts: number }>('GET', '/axes/reference')).position_counts;
  const began = await position();
  await jog.hover();
  await jogUntil(async () => (await position()) > began + 50000, () => page.mouse.down(), () => page.mouse.up());
  await page.mouse.up();
  await expect.poll(async () => (await line.call<{ in_motion: boolean }>('GET', '/axes/reference')).in_motion).toBe(false);
  const { jobs } = await line.call<{ jobs: { do: string }[] }>('GET', '/jobs');
  expect(jobs.map((job) => job.do).slice(0, 3)).toEqual(['enable', 'stop', 'jog']);
  await page.setViewportSize({ width: 390, height: 844 });
  await page.locator('.page').evaluate((element) => element.scrollTo(0, element.scrollHeight));
  await expect(page.getByRole('button', { name: 'STOP', exact: true })).toBeInViewport({ ratio: 1 });
  await page.getByRole('button', { name: 'STOP', exact: true }).click();
  await expect.poll(async () => (await line.call<{ state: string }>('GET', '/axes/reference')).state).not.toBe('operation enabled');
});

test('a script runs in sequence and ends at rest', async ({ page, open, line, picture }) => {
  await page.setViewportSize({ width: 1366, height: 1000 });
  await openBoard(page, open);
  const script = panel(page, 'There and back');
  const began = (await line.call<{ position_counts: number }>('GET', '/axes/reference')).position_counts;
  // While the plots load, the page moves under the pointer, and the press of a button that moves away has no effect: a person
  // presses again.
  await expect(async () => {
    await script.getByRole('button', { name: 'Run' }).click({ timeout: 5000 });
    await expect(script.getByRole('status')).not.toHaveText('', { timeout: 5000 });
  }).toPass({ timeout: 60_000 });
  await expect(script.getByRole('status')).toHaveText('done', { timeout: 60_000 });
  await page.locator('.page').evaluate((element) => element.scrollTo(0, 0));
  await expect(page.getByText('imported from')).toHaveCount(0);
  await picture('boards');
  const { jobs } = await line.call<{ jobs: { do: string; state: string }[] }>('GET', '/jobs');
  expect(jobs.map((job) => `${job.do} ${job.state}`)).toEqual(['stop done', 'enable done', ...Array(4).fill('move done')]);
  expect(await value(() => line.call('GET', '/axes/reference/objects/6081/0'))).toBe(4711);
  const axis = await line.call<{ position_counts: number; in_motion: boolean }>('GET', '/axes/reference');
  expect(axis.in_motion).toBe(false);
  expect(Math.abs(axis.position_counts - began)).toBeLessThan(200);
});

test('a script does not go on after STOP, also not in a wait', async ({ page, open, line, watched }) => {
  await withoutTimeouts(page);
  const script = (title: string, second: string) => ({ kind: 'script', title, span: 2, lines: `reference enable\n${second}\nreference move by 1 velocity 10 acceleration 200` });
  await openBoard(page, open, [script('Waits', 'wait 3600'), script('Goes on', '# at once')]);
  const waits = panel(page, 'Waits');
  await waits.getByRole('button', { name: 'Run' }).click();
  await expect(waits.getByRole('status')).toHaveText('line 2');
  const stopped = page.waitForResponse('**/api/v1/stop');
  await page.getByRole('button', { name: 'STOP', exact: true }).click();
  await expect(waits.getByRole('status')).toHaveText('line 2: stopped');
  await stopped;

  // By another client: the server refuses the next job of the script.
  const moving = await hold(page, 'POST', '**/axes/reference/jobs', '"move"');
  await panel(page, 'Goes on').getByRole('button', { name: 'Run' }).click();
  await moving.held;
  await line.call('POST', '/stop');
  await moving.release();
  await expect(panel(page, 'Goes on').getByRole('status')).toHaveText(/^line 3: another command to the axis came|^line 3: job \d+ is not the last command/);
  const { jobs } = await line.call<{ jobs: { do: string }[] }>('GET', '/jobs');
  expect(jobs.some((job) => job.do === 'move')).toBe(false);
  expect(watched.splice(0)).toEqual([expect.stringContaining('409')]); // the refusal
  expect((await line.call<{ state: string }>('GET', '/axes/reference')).state).not.toBe('operation enabled');
});

test('a script goes on after its own halt', async ({ page, open, line }) => {
  await openBoard(page, open, [{ kind: 'script', title: 'Twice', span: 2, lines: 'reference enable\nreference disable\nreference enable\nreference stop' }]);
  const script = panel(page, 'Twice');
  await script.getByRole('button', { name: 'Run' }).click();
  await expect(script.getByRole('status')).toHaveText('done');
  const { jobs } = await line.call<{ jobs: { do: string }[] }>('GET', '/jobs');
  expect(jobs.map((job) => job.do)).toEqual(['stop', 'enable', 'disable', 'enable', 'stop']);
});

test('a script writes nothing after a halt by another client', async ({ page, open, line }) => {
  await withoutTimeouts(page);
  const lines = 'reference enable\nismc enable\nreference set 6083 4711';
  await openBoard(page, open, [{ kind: 'script', title: 'Slow', span: 2, lines }, { kind: 'button', title: 'State', span: 1, axis: 'reference', do: 'enable' }]);
  const script = panel(page, 'Slow');
  const enabling = await hold(page, 'POST', '**/axes/ismc/jobs', '"enable"');
  await script.getByRole('button', { name: 'Run' }).click();
  await enabling.held;
  await expect(panel(page, 'State')).toContainText('operation enabled');
  await line.call('POST', '/axes/reference/jobs', { do: 'disable' });
  await expect(panel(page, 'State')).not.toContainText('operation enabled'); // the page knows it
  await enabling.release();
  await expect(script.getByRole('status')).toHaveText(/^line 3: another command to the axis came/);
  expect(await value(() => line.call('GET', '/axes/reference/objects/6083/0'))).not.toBe(4711);
});

test('dashboards are exported, and imported again beside the old ones', async ({ page, open }) => {
  await openBoard(page, open);
  const [download] = await Promise.all([page.waitForEvent('download'), page.getByRole('button', { name: 'Export all' }).click()]);
  const text = readFileSync(await download.path(), 'utf8');
  expect(JSON.parse(text)).toEqual({ format: 'servodrome-dashboards', version: 1, boards: [{ name: 'Test bench', widgets }] });
  await importField(page).setInputFiles(await download.path());
  await expect(page.getByRole('navigation', { name: 'Dashboards' }).getByRole('link')).toHaveText(['Test bench', 'Test bench (2)']);
});

test('a file with a mistake is refused as a whole, with the place', async ({ page, open }) => {
  await openBoard(page, open);
  const bad = [{ name: 'good', widgets: [widgets[0]] }, { name: 'bad', widgets: [{ ...widgets[2], maximum: -5 }, { kind: 'robot' }] }];
  await importField(page).setInputFiles(file(bad));
  const manage = panel(page, 'Dashboards of this browser');
  await expect(manage.getByRole('alert')).toContainText('dashboard 2 "bad", widget 1: maximum must be above the minimum');
  await expect(manage.getByRole('alert')).toContainText('dashboard 2 "bad", widget 2: kind must be one of');
  await expect(page.getByRole('navigation', { name: 'Dashboards' }).getByRole('link')).toHaveText(['Test bench']);
  await importField(page).setInputFiles({ name: 'other.json', mimeType: 'application/json', buffer: Buffer.from('{"a": 1}') });
  await expect(manage.getByRole('alert')).toContainText('has no dashboards');
});

test('unusable storage does not break the page, and is kept', async ({ page, open }) => {
  await open('/boards');
  await page.evaluate(() => localStorage.setItem('servodrome.boards', '[{"name": 7}]'));
  await page.reload();
  await expect(page.getByText('storage of this page is unusable')).toBeVisible();
  await expect(page.getByText('It is kept in this browser')).toBeVisible();
  expect(await page.evaluate(() => localStorage.getItem('servodrome.boards.unreadable'))).toBe('[{"name": 7}]');
});

test('an axis that this line does not have is named', async ({ page, open }) => {
  await openBoard(page, open, [{ kind: 'button', title: '', span: 1, axis: 'other', do: 'enable' }, { kind: 'value', title: 'Gone', span: 1, channel: 'other/velocity_rpm', format: 'decimal' }, widgets[0]]);
  await expect(page.getByText('There is no axis "other".')).toBeVisible();
  await expect(panel(page, 'Gone').getByRole('status')).toContainText('other');
  await expect(panel(page, 'Speed').locator('.figure')).toHaveText(/rpm$/); // the others are not affected
});

for (const scheme of ['light', 'dark'] as const) {
  for (const [width, height] of [[1366, 768], [1920, 1080], [390, 844]]) {
    test(`a dashboard is accessible and fits, ${scheme}, ${width} px`, async ({ page, open, picture }) => {
      await page.emulateMedia({ colorScheme: scheme });
      await page.setViewportSize({ width, height });
      await openBoard(page, open);
      await expect(panel(page, 'Speed').locator('.figure')).toHaveText(/rpm$/);
      await expect(page.getByText('imported from')).toHaveCount(0);
      await accessible(page, 'now', rulesFor(scheme));
      const overhang = await page.evaluate(() => Math.max(...[document.documentElement, document.querySelector('.page')!].map(({ scrollWidth, clientWidth }) => scrollWidth - clientWidth)));
      expect(overhang).toBeLessThanOrEqual(0);
      await picture(`boards-${scheme}-${width}`);
      await page.getByText('edit', { exact: true }).click();
      await page.getByRole('button', { name: 'Settings of Motion' }).click();
      await accessible(page, 'with the settings', rulesFor(scheme));
      await picture(`boards-edit-${scheme}-${width}`);
    });
  }
}
