import type { Page } from '@playwright/test';
import { accessible, rulesFor } from './accessible';
import { expect as shortly, noPower, panel, takenBack, test as base, type, withoutTimeouts } from './fixtures';
import { lineOf, plan, write } from './guide';
import { Line } from './line';

const expect = shortly.configure({ timeout: 120_000 }); // a busy machine is slow, and not wrong

// The guide in the middle of things: left and taken up again, with the power cut, a fault, another browser, and undone.

const test = base.extend<{ axis: string }>({
  axis: ['reference', { option: true }],
  line: async ({ axis }, use) => {
    const line = await new Line(lineOf(axis, 'virtual')).start();
    await clock(line, 1);
    await use(line);
    await line.end();
  },
});

interface View {
  state: string;
  powered: boolean;
  velocity_rpm: number;
  position_counts: number;
}

interface Job {
  id: number;
  do: string;
  state: string;
}

const path = '/axes/reference';
const view = (line: Line) => line.call<View>('GET', path);
const jobs = async (line: Line) => (await line.call<{ jobs: Job[] }>('GET', '/jobs')).jobs;
const differences = async (line: Line) => (await line.call<{ differences: { object: string }[] }>('GET', `${path}/parameters/diff`)).differences.map(({ object }) => object);
const journal = (page: Page) => page.getByRole('region', { name: 'Written by the guide' });
const clock = (line: Line, speed: number) => line.call('PUT', '/clock', { speed });
// There and back, for so long that a test can stop the time in the middle.
const begin = async (page: Page, open: (path: string) => Promise<void>) => {
  await open('/commission/reference?step=cycle');
  await type(page, 'Distance', 8);
  await type(page, 'Velocity', 12);
  await write(page);
  await page.getByRole('button', { name: 'There and back' }).click();
};
// In the middle of the first move the time stands still: what follows is in the middle on any machine.
const moving = async (line: Line) => {
  await expect.poll(async () => (await view(line)).velocity_rpm, { intervals: [50] }).toBeGreaterThan(10);
  await clock(line, 0);
};
const still = (line: Line) => expect.poll(async () => Math.abs((await view(line)).velocity_rpm)).toBeLessThan(1);

test('a reload in the middle of a cycle starts no further move, and the guide says so', async ({ page, open, line }) => {
  await begin(page, open);
  await moving(line);
  await page.reload();
  const motion = page.getByRole('group', { name: 'There and back' });
  await expect(motion.getByRole('button', { name: 'Abort' })).toBeEnabled();
  await expect(motion.getByRole('button', { name: 'There and back' })).toBeDisabled();
  await clock(line, 50);
  await expect(motion.getByText('the page was left before the sequence was complete')).toBeVisible({ timeout: 300_000 });
  expect((await jobs(line)).filter((job) => job.do === 'move').map(({ state }) => state)).toEqual(['done']);
  // What was typed and written is still known, and the step can be repeated.
  await expect(page.getByRole('textbox', { name: 'Distance' })).toHaveValue('8');
  await expect(journal(page)).toContainText('6081:00');
  await type(page, 'Distance', -8);
  await motion.getByRole('button', { name: 'There and back' }).click();
  await expect(page.getByText('✓ The axis is back where it began')).toBeVisible({ timeout: 300_000 });
});

test('no motion begins between two writes of a plan', async ({ page, open }) => {
  await open('/commission/reference?step=cycle');
  await type(page, 'Distance', 8);
  await type(page, 'Velocity', 12);
  await expect(plan(page)).toBeVisible();
  const rows = await plan(page).getByRole('row').count();
  expect(rows).toBeGreaterThan(2);
  let release: () => void = () => undefined;
  const held = new Promise<void>((resolve) => (release = resolve));
  let writes = 0;
  await page.route('**/axes/reference/objects/**', async (route) => {
    if (route.request().method() === 'PUT' && ++writes === 2) await held;
    await route.continue();
  });
  await page.getByRole('button', { name: /^Write th/ }).click();
  await expect(panel(page, 'First cycle')).toContainText('Values are being written: wait.');
  await expect.poll(() => writes).toBe(2);
  // The poll of the values sees the first one written; the rows stay, and the motion waits.
  await page.waitForResponse((response) => response.url().includes('/values?'));
  await expect(plan(page).getByRole('row')).toHaveCount(rows);
  await expect(page.getByRole('button', { name: 'There and back' })).toBeDisabled();
  release();
  await expect(plan(page)).toHaveCount(0);
  await expect(page.getByRole('button', { name: 'There and back' })).toBeEnabled();
});

// The server's view of a drive on a bus may be older than the end of the last job.
test('the axis is back at its start also if the view of the server is late', async ({ page, open, line }) => {
  let late = 0;
  await page.route(/\/axes\/reference$/, async (route) => {
    const response = await route.fetch();
    const answer = (await response.json()) as { position_actual: number };
    await route.fulfill({ response, json: { ...answer, position_actual: answer.position_actual + late } });
    late += 131072 / 4;
  });
  await begin(page, open);
  await clock(line, 50);
  await expect(page.getByText('✓ The axis is back where it began')).toBeVisible({ timeout: 300_000 });
  expect(late).toBeGreaterThanOrEqual(131072 / 2); // it was asked before and after
});

test('an aborted move halts, and nothing follows', async ({ page, open, line }) => {
  await begin(page, open);
  await moving(line);
  await page.getByRole('button', { name: 'Abort' }).click();
  await clock(line, 1);
  await expect(page.getByRole('group', { name: 'There and back' }).locator('.trouble').first()).toBeVisible();
  await still(line);
  expect((await jobs(line)).filter((job) => job.do === 'move').map(({ state }) => state)).toEqual(['cancelled']);
});

test('STOP in a step stops the axis, and the sequence does not go on', async ({ page, open, line }) => {
  await begin(page, open);
  await moving(line);
  await page.getByRole('button', { name: 'STOP', exact: true }).click();
  await clock(line, 1);
  await expect(page.getByRole('group', { name: 'There and back' }).locator('.trouble').first()).toBeVisible();
  await still(line);
  expect((await jobs(line)).filter((job) => job.do === 'move')).toHaveLength(1);
});

const stops: [string, (page: Page, line: Line) => Promise<unknown>][] = [
  ['STOP', async (page) => {
    await page.keyboard.press('Control+Space');
    await expect(page.getByText('all axes stopped')).toBeVisible();
  }],
  ['the STOP of another client', (_, line) => line.call('POST', '/stop')],
];

for (const [what, stop] of stops) test(`${what} between a press and its first motion: no motion begins`, async ({ page, open, line, excused }) => {
  excused.push(/status of 409/, takenBack);
  await withoutTimeouts(page);
  await open('/commission/reference?step=velocity');
  const measure = page.getByRole('button', { name: 'Measure the loop and propose gains' });
  await expect(measure).toBeEnabled();
  let release: () => void = () => undefined;
  const held = new Promise<void>((resolve) => (release = resolve));
  let reads = 0;
  await page.route('**/api/v1/axes/reference', async (route) => {
    ++reads;
    await held;
    await route.continue();
  });
  await measure.click();
  await expect.poll(() => reads).toBeGreaterThan(0);
  await stop(page, line);
  release();
  await expect(page.getByRole('group', { name: 'Measure the loop and propose gains' }).locator('.trouble').first()).toBeVisible();
  expect((await jobs(line)).filter((job) => job.do === 'tune')).toEqual([]);
});

test('nothing is undone while the power stage is on: the mode of a motion from before would move the axis', async ({ page, open, line }) => {
  const mode = async () => (await line.call<{ value: number }>('GET', `${path}/objects/6060/0`)).value;
  const over = (kind: string) => expect.poll(async () => (await jobs(line)).filter((job) => job.do === kind).at(-1)?.state).toBe('done');
  await open('/commission/reference?step=direction');
  await write(page);
  await line.call('POST', `${path}/jobs`, { do: 'enable' });
  await over('enable');
  await line.call('POST', `${path}/jobs`, { do: 'velocity', units: 'revolutions', velocity: 0.2 });
  await over('velocity');
  await page.getByRole('button', { name: 'Make the small move' }).click();
  await over('move');
  await still(line);
  await expect(journal(page).getByRole('row', { name: /6060:00/ })).toContainText(/3\s*1/);
  const undo = page.getByRole('button', { name: 'Undo this step' });
  await expect(panel(page, 'Direction and encoder').getByText('Disable the axis first')).toBeVisible();
  await expect(undo).toBeDisabled();
  await expect(journal(page).getByText('Disable the axis first')).toBeVisible();
  await expect(journal(page).getByRole('button', { name: 'Undo all' })).toBeDisabled();
  expect(await mode()).toBe(1);
  const { position_counts: stood } = await view(line);
  await page.getByRole('button', { name: 'Disable' }).click();
  await expect(undo).toBeEnabled();
  await undo.click();
  await expect(journal(page)).toHaveCount(0);
  expect(await mode()).toBe(3);
  expect(Math.abs((await view(line)).position_counts - stood)).toBeLessThan(1000);
});

test('after a restart of the server the guide does not take another job for that of its run', async ({ page, open, line, watched }) => {
  await open('/commission/reference?step=direction');
  await write(page);
  await clock(line, 0);
  await page.getByRole('button', { name: 'Make the small move' }).click();
  const name = 'servodrome.guide.reference';
  const begun = () => page.evaluate((key) => (JSON.parse(localStorage.getItem(key) ?? '{}') as { run?: { jobs: number[]; of: number } }).run?.jobs.length ?? 0, name);
  await clock(line, 1);
  await expect.poll(begun, { intervals: [20] }).toBe(3);
  await clock(line, 0);
  // The run is as a page that was closed in the middle leaves it.
  await page.evaluate((key) => {
    const guide = JSON.parse(localStorage.getItem(key)!) as { run: { state: string } };
    localStorage.setItem('test', JSON.stringify({ ...guide, run: { ...guide.run, state: 'running', error: undefined } }));
  }, name);
  await page.goto('about:blank');
  await line.stop();
  await line.start();
  await clock(line, 1);
  for (const request of [{ do: 'stop' }, { do: 'enable' }, { do: 'move', units: 'revolutions', by: 0.1, velocity: 1, acceleration: 20, deceleration: 20 }]) {
    const { id } = await line.call<Job>('POST', `${path}/jobs`, request);
    await expect.poll(async () => (await jobs(line)).find((job) => job.id === id)?.state).toBe('done');
  }
  await page.goto(line.address);
  await page.evaluate((key) => localStorage.setItem(key, localStorage.getItem('test')!), name);
  await page.goto(`${line.address}/commission/reference?step=direction`);
  await expect(page.getByText('the server was restarted before the sequence was complete')).toBeVisible();
  watched.splice(0); // the lost connection
});

test('a power cut in the middle: the guide names the lost values, and writes them again', async ({ page, open, line, excused }) => {
  excused.push(noPower);
  await begin(page, open);
  await moving(line);
  await line.call('POST', `${path}/power`, { action: 'off' });
  await clock(line, 5);
  await expect(page.getByRole('button', { name: 'There and back' })).toBeDisabled();
  await expect(panel(page, 'First cycle')).toContainText('The drive has no power');
  await page.getByRole('button', { name: 'Power on' }).click();
  const row = journal(page).getByRole('row', { name: /6081:00/ });
  await expect(row).toContainText('not in the drive');
  await expect(plan(page)).toContainText('6081:00'); // shown again before it is written
  await row.getByRole('button', { name: 'Write 6081:00 again' }).click();
  await expect(row).toContainText('in the drive');
  await expect(row).not.toContainText('not in the drive');
});

test('a fault keeps the axis from moving until it is cleared', async ({ page, open, line }) => {
  await open('/commission/reference?step=direction');
  await write(page);
  await line.call('POST', `${path}/faults`, { inject: 'encoder_loss' });
  await expect(panel(page, 'Direction and encoder').getByRole('alert')).toContainText('7');
  const move = page.getByRole('button', { name: 'Make the small move' });
  await expect(move).toBeDisabled();
  await line.call('DELETE', `${path}/faults`);
  await page.getByRole('button', { name: 'Clear fault' }).click();
  await expect(move).toBeEnabled();
});

test('a value that another changes meanwhile is not overwritten unseen, and an undo leaves it', async ({ page, open, line }) => {
  await open('/commission/reference?step=direction');
  await expect(plan(page)).toContainText('131072');
  // The page gets the old values until it asks for those that it is about to write.
  let asked = 0;
  await page.route(/values\?objects=/, async (route) => {
    const answer = await route.fetch();
    const { values } = (await answer.json()) as { values: Record<string, number> };
    const isPoll = !route.request().url().includes('objects=6081:00');
    asked += isPoll ? 0 : 1;
    // The page may have given the request up meanwhile.
    await route.fulfill({ json: { values: isPoll ? { ...values, '6081:00': 131072 } : values } }).catch(() => undefined);
  });
  await line.call('PUT', `${path}/objects/6081/0`, { value: 77777 });
  await page.getByRole('button', { name: /^Write th/ }).click();
  await expect(page.locator('.notice.bad')).toContainText('6081:00 changed meanwhile: nothing was written');
  expect(asked).toBeGreaterThan(0);
  expect((await line.call<{ value: number }>('GET', `${path}/objects/6072/0`)).value).toBe(3000);
  await page.unroute(/values\?objects=/);
  await expect(plan(page)).toContainText('77777');
  await write(page);
  await line.call('PUT', `${path}/objects/6083/0`, { value: 55555 });
  await expect(journal(page).getByRole('row', { name: /6083:00/ })).toContainText('changed by another');
  await page.getByRole('button', { name: 'Undo this step' }).click();
  await expect(page.locator('.notice.bad').filter({ hasText: '6083:00 was changed by another and stays' })).toBeVisible();
  expect((await line.call<{ value: number }>('GET', `${path}/objects/6083/0`)).value).toBe(55555);
  expect(await differences(line)).not.toContain('6072:00');
});

test('undo all brings the factory values back, step by step or at once', async ({ page, open, line }) => {
  const factory = await differences(line);
  await open('/commission/reference?step=direction');
  await write(page);
  await page.getByRole('link', { name: /Torque limit/ }).click();
  await type(page, 'Torque or current limit', 1500);
  await write(page);
  await expect(journal(page).getByRole('row', { name: /Direction and encoder 6072:00/ })).toContainText('replaced');
  await page.getByRole('link', { name: /Direction and encoder/ }).click();
  await page.getByRole('button', { name: 'Undo this step' }).click();
  // The later step keeps its value, and now leads back to the factory's.
  await expect(journal(page).getByRole('row', { name: /Torque limit 6072:00/ })).toContainText(/3000\s*1500/);
  expect((await line.call<{ value: number }>('GET', `${path}/objects/6072/0`)).value).toBe(1500);
  await journal(page).getByRole('button', { name: 'Undo all' }).click();
  await journal(page).getByRole('button', { name: 'Undo all of them' }).click();
  await expect(journal(page)).toHaveCount(0);
  expect(await differences(line)).toEqual(factory);
});

test('the wrong way: the polarity is reversed, and only another move shows that it is right', async ({ page, open, line }) => {
  const polarity = async () => (await line.call<{ value: number }>('GET', `${path}/objects/607E/0`)).value;
  const step = panel(page, 'Direction and encoder');
  const move = page.getByRole('button', { name: 'Make the small move' });
  const begin = (await view(line)).position_counts;
  await open('/commission/reference?step=direction');
  await write(page);
  await move.click();
  await page.getByRole('button', { name: 'The wrong way' }).click();
  await expect(step).toContainText('Reverse the direction, move again, and look again.');
  await expect(move).toBeDisabled();
  const { position_counts: there } = await view(line);
  await page.getByRole('button', { name: 'Disable' }).click();
  await expect(plan(page).getByRole('row', { name: /607E:00/ })).toContainText(/0\s*192/);
  await write(page);
  expect(await polarity()).toBe(192);
  expect(Math.abs((await view(line)).position_counts - there)).toBeLessThan(1000);
  await expect(step).toContainText('The small move has not been made yet.');
  await expect(page.getByRole('button', { name: 'Done, next step' })).toBeDisabled();
  await move.click();
  await page.getByRole('button', { name: 'The right way' }).click();
  await expect(step).toContainText('✓ 6064h moved by the distance, and the machine moved the right way.');
  expect(there - begin).toBeGreaterThan(13000);
  expect(Math.abs((await view(line)).position_counts - begin)).toBeLessThan(1000); // back, against the first move
  // The undo brings the old direction, of which the last move says nothing.
  await page.getByRole('button', { name: 'Disable' }).click();
  await page.getByRole('button', { name: 'Undo this step' }).click();
  await expect(journal(page)).toHaveCount(0);
  expect(await polarity()).toBe(0);
  await expect(step).toContainText('The small move has not been made yet.');
});

test('two browsers: the second sees the axis busy, and its own guide is untouched', async ({ page, open, line, browser }) => {
  await begin(page, open);
  await moving(line);
  const other = await (await browser.newContext()).newPage();
  await other.goto(`${line.address}/commission/reference?step=cycle`);
  await expect(panel(other, 'First cycle')).toContainText('The axis is busy');
  await expect(other.getByRole('button', { name: 'There and back' })).toBeDisabled();
  await expect(journal(other)).toHaveCount(0);
  await other.getByRole('button', { name: 'Abort' }).click();
  await clock(line, 1);
  await still(line);
  await expect(page.getByRole('group', { name: 'There and back' }).locator('.trouble').first()).toBeVisible();
});

test('a scan of the first step shows what answers on the bus', async ({ page, open, line, excused }) => {
  excused.push(noPower);
  await open('/commission/reference?step=find');
  await page.getByRole('button', { name: 'Scan can0' }).click();
  const devices = page.getByRole('table', { name: 'Devices on can0' });
  await expect(devices.getByRole('row')).toHaveCount(2); // with the header
  await expect(devices.getByRole('link', { name: 'reference' })).toBeVisible();
  await line.call('POST', `${path}/power`, { action: 'off' });
  await page.getByRole('button', { name: 'Scan can0' }).click();
  await expect(page.getByText('0 devices answer.')).toBeVisible();
});

test('every step is accessible, light and dark, wide and narrow, and STOP is in view', async ({ page, open, picture }) => {
  test.setTimeout(240_000);
  const sizes = [[1366, 768, 'light'], [1920, 1080, 'dark'], [390, 844, 'light'], [390, 844, 'dark']] as const;
  for (const step of ['find', 'identify', 'units', 'inputs', 'direction', 'torque', 'velocity', 'position', 'homing', 'limits', 'cycle', 'store', 'report']) {
    await open(`/commission/reference?step=${step}`);
    for (const [width, height, theme] of sizes) {
      await page.setViewportSize({ width, height });
      await page.evaluate((to) => (document.documentElement.dataset.theme = to), theme);
      await expect(page.getByRole('button', { name: 'STOP', exact: true })).toBeInViewport();
      expect(await page.evaluate(() => document.querySelector('.page')!.scrollWidth - document.querySelector('.page')!.clientWidth), `${step} at ${width}`).toBeLessThanOrEqual(0);
      await picture(`step-${step}-${width}-${theme}`);
      if (width !== 1920) await accessible(page, `${step} at ${width}, ${theme}`, rulesFor(theme));
    }
  }
});

const tuningModes = { reference: 9, ismk: -3 };
for (const [name, mode] of Object.entries(tuningModes)) test.describe(name, () => {
  test.use({ axis: name });
  test('the mode of an aborted measurement of the loop belongs to the guide', async ({ page, open, line }) => {
    const present = async () => (await line.call<{ value: number }>('GET', `/axes/${name}/objects/6060/0`)).value;
    await line.call('PUT', `/axes/${name}/objects/6060/0`, { value: 1 });
    await open(`/commission/${name}?step=velocity`);
    const tuning = page.getByRole('group', { name: 'Measure the loop and propose gains' });
    await expect(tuning).toContainText(`mode 6060h 1 → ${mode}`);
    await expect(tuning).toContainText('the proposed gains appear above');
    await tuning.getByRole('button', { name: 'Measure the loop and propose gains' }).click();
    await expect.poll(present, { intervals: [50] }).toBe(mode);
    await tuning.getByRole('button', { name: 'Abort' }).click();
    await expect(tuning.locator('.trouble')).toBeVisible();
    expect(await present()).toBe(mode);
    const row = journal(page).getByRole('row', { name: /6060:00/ });
    await expect(row).toContainText(new RegExp(`1\\s*${mode}\\s*in the drive`));
    await line.call('POST', `/axes/${name}/jobs`, { do: 'disable' });
    await journal(page).getByRole('button', { name: 'Undo all' }).click();
    await journal(page).getByRole('button', { name: 'Undo all of them' }).click();
    await expect(journal(page)).toHaveCount(0);
    expect(await present()).toBe(1);
  });
});

test('after a power cut the values of several steps are written again, or count as undone', async ({ page, open, line, excused }) => {
  excused.push(noPower);
  await clock(line, 10);
  await open('/commission/reference?step=direction');
  await write(page);
  await page.getByRole('link', { name: /First cycle/ }).click();
  await write(page); // the same objects a second time
  // A gain of the velocity loop, measured and complete.
  await page.getByRole('link', { name: /Velocity loop/ }).click();
  const { gains } = await line.call<{ gains: { object: string }[] }>('GET', `${path}/gains`);
  const { objects } = await line.call<{ objects: { index: string; sub: number; name: string }[] }>('GET', `${path}/objects`);
  const nameOf = (object: string) => objects.find((each) => each.index.slice(2) === object.slice(0, 4) && each.sub === parseInt(object.slice(5), 16))?.name ?? '';
  const boxOf = (object: string) => panel(page, 'Velocity loop').getByRole('textbox', { name: nameOf(object), exact: true });
  let gain = ''; // the first that the page shows
  await expect.poll(async () => {
    for (const { object } of gains) if (await boxOf(object).count() > 0) gain ||= object;
    return gain;
  }).not.toBe('');
  await expect(boxOf(gain)).toHaveValue(/^\d/); // 0: the factory's gain
  await type(page, nameOf(gain), 28_000_000, panel(page, 'Velocity loop'));
  await write(page, 'Gains');
  await page.getByRole('button', { name: 'Measure a step' }).click();
  await page.getByRole('button', { name: 'Done, next step' }).click();
  const loop = page.getByRole('link', { name: /Velocity loop/ });
  await expect(loop).toContainText('✓');

  await line.call('POST', `${path}/power`, { action: 'cycle' });
  for (const object of ['6081:00', '6083:00', '6084:00', gain]) {
    const row = journal(page).getByRole('row', { name: new RegExp(`${object}.*as after a power cut`) });
    await expect(row).toHaveCount(1);
    await expect(row.getByRole('button', { name: `Write ${object} again` })).toBeVisible();
  }
  await expect(journal(page)).not.toContainText('changed by another');
  await expect(loop).not.toContainText('✓');
  await loop.click();
  await expect(panel(page, 'Velocity loop').locator('.guide-check')).toContainText(`Not in the drive any more: ${gain} = `);
  await expect(page.getByRole('button', { name: 'Done, next step' })).toBeDisabled();
  await journal(page).getByRole('button', { name: `Write ${gain} again` }).click();
  await expect(loop).toContainText('✓');
  await expect(page.getByRole('button', { name: 'Done, next step' })).toBeEnabled();

  await line.call('POST', `${path}/power`, { action: 'cycle' });
  await expect(loop).not.toContainText('✓');
  await journal(page).getByRole('button', { name: 'Undo all' }).click();
  await journal(page).getByRole('button', { name: 'Undo all of them' }).click();
  await expect(journal(page)).toHaveCount(0);
  await expect(page.locator('.notice.bad')).toHaveCount(0);
  expect(await differences(line)).toEqual([]);
  await expect(page.getByRole('button', { name: 'Begin again' })).toBeEnabled();
});
