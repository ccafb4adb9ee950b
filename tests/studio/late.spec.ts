import type { Locator, Page } from '@playwright/test';
import { expect, test } from './fixtures';
import { axes, lineFile, type Line } from './line';

// A slow network: a halt or STOP comes between two requests of a sequence, or reaches the server before an earlier request.
// The last command of the person counts. (The monkey, monkey.spec.ts, looks for more of these.)

interface Job {
  axis: string;
  do: string;
  state: string;
}

const jobs = async (line: Line) => (await line.call<{ jobs: Job[] }>('GET', '/jobs')).jobs.map((job) => job.do);
const takenBack = (page: Page) => page.waitForEvent('requestfailed', { predicate: (request) => request.url().endsWith('/axes/reference/jobs'), timeout: 8000 }); // before the page's own timeout, 10 s

// Holds the requests of this kind, with `text` in their body, until `release` is called, which returns when the first of them has
// gone on.
async function hold(page: Page, method: string, path: string, text = '') {
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

// Presses the button, and releases the pointer elsewhere.
async function pressOnly(page: Page, button: Locator) {
  await button.hover();
  await page.mouse.down();
  await page.mouse.move(5, 500);
  await page.mouse.up();
}

test('the buttons that halt or disable act when they are pressed', async ({ page, open, line }) => {
  const enabled = async () => (await line.call<{ axes: { name: string; state: string }[] }>('GET', '/axes')).axes.filter(({ state }) => state === 'operation enabled').map(({ name }) => name);
  const enable = async (...names: string[]) => {
    for (const name of names) await line.call('POST', `/axes/${name}/jobs`, { do: 'enable' });
    await expect.poll(enabled).toEqual(expect.arrayContaining(names));
  };
  const all = axes.map(({ name }) => name);
  await open('/');
  await enable(...all);
  const halted = await jobs(line);
  await pressOnly(page, page.getByRole('button', { name: 'Halt all' }));
  await expect.poll(async () => (await jobs(line)).slice(halted.length)).toEqual(all.map(() => 'stop'));
  expect((await enabled()).length).toBe(all.length);
  await pressOnly(page, page.getByRole('button', { name: 'Disable all' }));
  await expect.poll(enabled).toEqual([]);

  await enable('reference');
  await pressOnly(page, page.getByRole('article', { name: 'reference' }).getByRole('button', { name: 'Disable' }));
  await expect.poll(enabled).toEqual([]);

  await open('/axis/reference');
  for (const name of [/^5 disable operation/, /^8 shutdown/, /^9 disable voltage/, /^11 quick stop/]) {
    await line.call('POST', '/axes/reference/jobs', { do: 'disable' });
    await expect.poll(async () => (await line.call<{ jobs: Job[] }>('GET', '/jobs')).jobs.at(-1)).toMatchObject({ do: 'disable', state: 'done' });
    await enable('reference');
    await pressOnly(page, page.getByRole('button', { name }));
    await expect.poll(enabled).toEqual([]);
  }
});

test('the keyboard halts and disables all axes', async ({ page, open, line }) => {
  await line.call('POST', '/axes/reference/jobs', { do: 'enable' });
  await open('/');
  for (const [name, key, kind] of [['Halt all', 'Enter', 'stop'], ['Disable all', 'Space', 'disable']] as const) {
    await page.getByRole('button', { name }).focus();
    const sent = page.waitForRequest((request) => request.url().endsWith('/axes/reference/jobs') && (request.postDataJSON() as { do: string }).do === kind);
    await page.keyboard.down(key);
    await sent;
    await page.keyboard.up(key);
  }
  await expect.poll(async () => (await line.call<{ state: string }>('GET', '/axes/reference')).state).not.toBe('operation enabled');
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
  const tuning = await hold(page, 'POST', '**/axes/reference/jobs', '"tune"');
  await page.getByRole('button', { name: 'Measure and propose' }).click();
  await tuning.held;
  await page.getByRole('link', { name: 'Line', exact: true }).click();
  await line.call('POST', '/axes/reference/jobs', { do: 'enable' }); // the page offers a halt
  const card = page.getByRole('article', { name: 'reference' });
  const failed = takenBack(page);
  await card.getByRole('button', { name: 'Halt' }).click();
  await failed;
  await tuning.release();
  await expect.poll(() => jobs(line)).toEqual(['stop', 'enable', 'stop']);
  watched.splice(0);
});

test('STOP takes back a controlword whose request is still on its way', async ({ page, open, line, watched }) => {
  const state = async () => (await line.call<{ state: string }>('GET', '/axes/reference')).state;
  await line.call('PUT', '/axes/reference/objects/605A/0', { value: 6 }); // a stopped axis stays in Quick stop active, which Fh leaves
  await line.call('POST', '/axes/reference/jobs', { do: 'enable' });
  await expect.poll(state).toBe('operation enabled');
  await open('/objects/reference?q=6040&object=6040:00');
  const written = await hold(page, 'PUT', '**/objects/6040/0');
  await page.getByRole('textbox', { name: 'New value' }).fill('0xF');
  await page.getByRole('button', { name: 'Write', exact: true }).click();
  await written.held;
  await page.getByRole('button', { name: 'STOP', exact: true }).click();
  await expect(page.getByText('all axes stopped')).toBeVisible();
  const stopped = await state();
  expect(stopped).not.toBe('operation enabled');
  await written.release();
  await page.waitForTimeout(200); // of the line's time
  expect(await state()).toBe(stopped);
  await expect(page.getByText('taken back').first()).toBeVisible();
  watched.splice(0);
});

test.describe('with the time of the line', () => {
  test.use({ lineText: lineFile('virtual') });

  test('Cancel takes back what was to follow, also if the job is over before the request arrives', async ({ page, open, line, watched }) => {
    await line.call('PUT', '/clock', { speed: 1 });
    await open('/axis/reference');
    await expect(page.getByRole('button', { name: 'Move +' })).toBeEnabled();
    await line.call('PUT', '/clock', { speed: 0 });
    await page.getByRole('button', { name: 'Move +' }).click();
    const cancel = page.getByRole('button', { name: 'Cancel', exact: true });
    await expect(cancel).toBeVisible();
    const cancelling = await hold(page, 'DELETE', '**/api/v1/jobs/*');
    await cancel.click();
    await cancelling.held;
    await line.call('PUT', '/clock', { speed: 1 });
    await expect(page.getByText('enable: done')).toBeVisible();
    await page.waitForTimeout(300); // the time in which the page sent the move
    expect(await jobs(line)).toEqual(['enable']);
    await expect(page.getByText('taken back').first()).toBeVisible();
    await cancelling.release();
    watched.splice(0);
  });

  test('Cancel of a job that is over ends the next job of a sequence of another client', async ({ page, open, line }) => {
    await line.call('PUT', '/clock', { speed: 1 });
    await open('/axis/reference');
    await line.call('PUT', '/clock', { speed: 0 });
    const { id } = await line.call<{ id: number }>('POST', '/axes/reference/jobs', { do: 'enable' });
    const cancel = page.getByRole('button', { name: 'Cancel', exact: true });
    await expect(cancel).toBeVisible();
    const cancelling = await hold(page, 'DELETE', '**/api/v1/jobs/*');
    await cancel.click();
    await cancelling.held;
    await line.call('PUT', '/clock', { speed: 1 });
    await expect.poll(async () => (await line.call<{ state: string }>('GET', `/jobs/${id}`)).state).toBe('done');
    await line.call('POST', '/axes/reference/jobs', { do: 'move', after: id, units: 'revolutions', by: 8, velocity: 1, acceleration: 20 });
    await cancelling.release();
    await expect.poll(async () => (await line.call<{ jobs: Job[] }>('GET', '/jobs')).jobs.map((job) => `${job.do} ${job.state}`)).toEqual(['enable done', 'move cancelled']);
    await expect.poll(async () => (await line.call<{ in_motion: boolean }>('GET', '/axes/reference')).in_motion).toBe(false);
  });

  test('Cancel halts a job that the server has begun, and whose answer is still on its way', async ({ page, open, line, watched }) => {
    await line.call('PUT', '/clock', { speed: 1 });
    await open('/axis/reference');
    let release = () => {};
    const released = new Promise<void>((resolve) => (release = resolve));
    const cancelling = await hold(page, 'DELETE', '**/api/v1/jobs/*');
    await page.route('**/axes/reference/jobs', async (route) => {
      const { do: kind } = route.request().postDataJSON() as { do: string };
      const response = await route.fetch();
      if (kind === 'move') await released;
      await route.fulfill({ response }).catch(() => undefined);
    });
    await page.getByRole('textbox', { name: 'Distance' }).fill('8');
    await page.getByRole('textbox', { name: 'Velocity', exact: true }).fill('60');
    await page.getByRole('button', { name: 'Move +' }).click();
    const cancel = page.getByRole('button', { name: 'Cancel', exact: true });
    await expect.poll(async () => (await jobs(line)).at(-1)).toBe('move');
    await cancel.click();
    await cancelling.held;
    await expect.poll(() => jobs(line)).toEqual(['enable', 'move', 'stop']);
    release();
    await cancelling.release();
    watched.splice(0);
  });
});

const speedOf = async (line: Line, axis = 'reference') => Math.abs((await line.call<{ velocity_rpm: number }>('GET', `/axes/${axis}`)).velocity_rpm);

async function openJog(page: Page, open: (path: string) => Promise<unknown>, line: Line) {
  await open('/axis/reference?do=jog');
  await line.call('POST', '/axes/reference/jobs', { do: 'enable' });
  const jog = page.getByRole('button', { name: 'Jog in positive direction' });
  await expect(jog).toBeEnabled();
  return jog;
}

test('Ctrl stops a jog that Space holds, and no release of a key is lost', async ({ page, open, line }) => {
  const jog = await openJog(page, open, line);
  await jog.focus();
  await page.keyboard.down('Space');
  await expect.poll(() => speedOf(line)).toBeGreaterThan(30);
  const stop = page.waitForRequest('**/api/v1/stop');
  await page.keyboard.down('Control');
  await stop;
  await expect.poll(() => speedOf(line)).toBeLessThan(1);
  await page.keyboard.up('Space');
  await page.keyboard.up('Control');
  await page.waitForTimeout(1000);
  expect(await speedOf(line)).toBeLessThan(1);
});

test('a jog that is released before it has begun moves nothing', async ({ page, open, line }) => {
  const jog = await openJog(page, open, line);
  const before = (await line.call<{ position_counts: number }>('GET', '/axes/reference')).position_counts;
  const held = await hold(page, 'POST', '**/api/v1/axes/reference/jobs');
  await jog.hover();
  await page.mouse.down();
  await held.held;
  await page.mouse.up();
  await held.release();
  await page.waitForTimeout(1500);
  expect(await jobs(line)).not.toContain('jog');
  const after = (await line.call<{ position_counts: number }>('GET', '/axes/reference')).position_counts;
  expect(Math.abs(after - before)).toBeLessThan(100);
});

test('the second click of a double click on Disable does not enable the axis', async ({ page, open, line }) => {
  await open('/');
  await page.evaluate(() => {
    const pressTimes: number[] = [];
    Object.assign(window, { pressTimes });
    addEventListener('pointerdown', ({ timeStamp }) => pressTimes.push(timeStamp), true);
  });
  const between_ms = () => page.evaluate(() => {
    const [first, second] = (window as unknown as { pressTimes: number[] }).pressTimes.slice(-2);
    return second - first;
  });
  const card = page.getByRole('article', { name: 'reference' });
  const disable = card.getByRole('button', { name: 'Disable' });
  const press = async () => {
    const box = (await card.getByRole('button', { name: /^(Dis|En)able$/ }).boundingBox())!;
    await page.mouse.click(box.x + 10, box.y + box.height / 2);
  };
  // On a busy machine the second click may come too late for a double click.
  await expect(async () => {
    await line.call('POST', '/axes/reference/jobs', { do: 'enable' });
    await expect(disable).toBeVisible();
    await press();
    await expect(disable).toHaveCount(0);
    await press();
    expect(await between_ms()).toBeLessThan(500);
  }).toPass();
  await page.waitForTimeout(700);
  expect((await jobs(line)).at(-1)).toBe('disable');
  await press();
  await expect.poll(async () => (await jobs(line)).at(-1)).toBe('enable');
});

test('STOP drops a number that is typed half', async ({ page, open, line }) => {
  await open('/tuning/reference');
  const gain = page.getByRole('table', { name: /./ }).getByRole('textbox').first();
  await expect(gain).not.toHaveValue('');
  const before = await gain.inputValue();
  let writes = 0;
  page.on('request', (request) => (writes += request.method() === 'PUT' && request.url().includes('/objects/') ? 1 : 0));
  await gain.fill('7');
  await page.getByRole('button', { name: 'STOP', exact: true }).click();
  await expect(gain).toHaveValue(before);
  expect(writes).toBe(0);
  await line.call('GET', '/axes');
});

test('a sequence does not go on after the page has slept', async ({ page, open, line }) => {
  await open('/axis/reference');
  // The way there takes 4 s, so that it ends while the page sleeps.
  await page.getByRole('textbox', { name: 'Distance' }).fill('4');
  await page.getByRole('textbox', { name: 'Velocity' }).fill('60');
  await page.getByRole('button', { name: 'There and back' }).click();
  await expect.poll(() => speedOf(line), { intervals: [20] }).toBeGreaterThan(30);
  // As a computer that sleeps: the clock goes on, and no message is handled meanwhile.
  await page.evaluate(() => {
    const end = performance.now() + 6000;
    while (performance.now() < end);
  });
  await expect(page.getByText('this page slept or was not connected')).toBeVisible();
  await page.waitForTimeout(500);
  expect((await jobs(line)).filter((job) => job === 'move')).toHaveLength(1);
});

// Answers that arrive while a person looks for an option.
test('an open list of the guide stays open while the answers about the drive arrive', async ({ page, open }) => {
  const [objects, units] = [await hold(page, 'GET', '**/api/v1/axes/reference/objects'), await hold(page, 'GET', '**/api/v1/axes/reference/units')];
  await open('/commission/reference?step=homing');
  await page.getByRole('button', { name: /Method/ }).click();
  const list = page.getByRole('listbox', { name: 'Method' });
  await expect(list).toBeVisible();
  await objects.release();
  await expect(page.getByRole('table', { name: 'Values read from the drive', includeHidden: true })).toBeAttached(); // the page has the objects
  await expect(list).toBeVisible();
  await units.release();
  await list.getByRole('option', { name: /^35: / }).click();
  await expect(page.getByRole('button', { name: /^35: .* Method$/ })).toBeVisible();
});

test('an open list of methods keeps its order when the wiring of the switches arrives', async ({ page, open }) => {
  const geometry = await hold(page, 'GET', '**/api/v1/axes/ismk/geometry');
  await open('/commission/ismk?step=homing');
  const method = page.getByRole('button', { name: /Method/ });
  await method.click();
  const options = page.getByRole('listbox', { name: 'Method' }).getByRole('option');
  const before = await options.allTextContents();
  await geometry.release();
  await expect(page.locator('svg.homing, svg.travel').first()).toBeAttached(); // the page has the wiring
  expect(await options.allTextContents()).toEqual(before);
  await page.keyboard.press('Escape');
  await method.click();
  await expect(options.filter({ hasText: 'no home switch' })).not.toHaveCount(0);
});
