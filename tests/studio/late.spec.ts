import type { Locator, Page } from '@playwright/test';
import { expect, hold, jogUntil, noPower, takenBack, test, withoutTimeouts } from './fixtures';
import { axes, lineFile, type Line } from './line';

// A slow network: a halt or STOP comes between two requests of a sequence, or reaches the server before an earlier request.
// The last command of the person counts. (The monkey, monkey.spec.ts, looks for more of these.)

interface Job {
  axis: string;
  do: string;
  state: string;
}

const jobs = async (line: Line) => (await line.call<{ jobs: Job[] }>('GET', '/jobs')).jobs.map((job) => job.do);
const givenUp = (page: Page) => page.waitForEvent('requestfailed', (request) => request.url().endsWith('/axes/reference/jobs'));
// The page has what it asks a drive for at its beginning: nothing moves its buttons any more.
const isSettled = async (page: Page) => {
  await expect(page.getByRole('button', { name: 'Move +' })).toBeEnabled();
  await expect(page.locator('.travel .carriage')).toBeVisible();
};

test.beforeEach(({ page }) => withoutTimeouts(page));

for (const [button, kind] of [['Move and record', 'move'], ['Sweep and record', 'sweep']] as const) {
  test(`"${button}" begins no ${kind} after a halt that came before the recording`, async ({ page, open, line, excused }) => {
    excused.push(/status of 409/); // the refusal
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
  });
}

test('STOP and Halt act when they are pressed, not when they are released', async ({ page, open, line }) => {
  await open('/axis/reference');
  await isSettled(page);
  await line.call('POST', '/axes/reference/jobs', { do: 'enable' }); // Halt is there for an enabled axis
  await expect(page.getByText('enable: done')).toBeVisible();
  for (const [name, path] of [['Halt', '**/api/v1/axes/reference/jobs'], ['STOP', '**/api/v1/stop']] as const) {
    const button = page.getByRole('button', { name, exact: true }).first();
    await button.hover();
    const sent = page.waitForRequest(path);
    await page.mouse.down();
    await sent;
    await page.mouse.move(5, 500); // the pointer leaves the button, and is released elsewhere
    await page.mouse.up();
  }
  await expect.poll(() => jobs(line)).toEqual(['enable', 'stop']);
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

  // The page has seen that the axis is disabled: a button "Disable" that it shows later is not that of before.
  const card = page.getByRole('article', { name: 'reference' });
  await expect(card.getByRole('button', { name: 'Enable' })).toBeVisible();
  await enable('reference');
  await pressOnly(page, card.getByRole('button', { name: 'Disable' }));
  await expect.poll(enabled).toEqual([]);

  await open('/axis/reference');
  await isSettled(page);
  for (const name of [/^5 disable operation/, /^8 shutdown/, /^9 disable voltage/, /^11 quick stop/]) {
    await line.call('POST', '/axes/reference/jobs', { do: 'disable' });
    await expect.poll(async () => (await line.call<{ jobs: Job[] }>('GET', '/jobs')).jobs.at(-1)).toMatchObject({ do: 'disable', state: 'done' });
    await expect(page.getByText('disable: done')).toBeVisible();
    await enable('reference');
    await expect(page.getByText('enable: done')).toBeVisible();
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
  test(`${what} takes back the command whose request is still on its way, and what was to follow`, async ({ page, open, line, excused }) => {
    excused.push(takenBack, noPower);
    await open('/axis/reference');
    const enabling = await hold(page, 'POST', '**/axes/reference/jobs');
    await page.getByRole('button', { name: 'Move +' }).click();
    await enabling.held;
    const failed = givenUp(page);
    await page.getByRole('button', { name: button }).click();
    await failed;
    await enabling.release();
    expect(await jobs(line)).toEqual([]);
  });
}

test('a controlword ends what was to follow', async ({ page, open, line, excused }) => {
  excused.push(takenBack);
  await open('/axis/reference');
  let answer = () => {};
  const answered = new Promise<void>((resolve) => (answer = resolve));
  await page.route('**/axes/reference/jobs', async (route) => {
    const response = await route.fetch();
    await answered;
    await route.fulfill({ response }).catch(() => undefined); // the page has given it up
  }, { times: 1 });
  await page.getByRole('button', { name: 'Move +' }).click();
  // The enabling is over before the page has the answer that it has begun.
  await expect.poll(async () => (await line.call<{ jobs: Job[] }>('GET', '/jobs')).jobs).toMatchObject([{ do: 'enable', state: 'done' }]);
  await page.getByRole('button', { name: /^5 disable operation/ }).click();
  await expect.poll(async () => (await line.call<{ state: string }>('GET', '/axes/reference')).state).toBe('switched on');
  await expect(page.getByText('taken back').first()).toBeVisible();
  answer();
  await expect(page.getByRole('button', { name: 'Move +' })).toBeEnabled();
  expect(await jobs(line)).toEqual(['enable']);
});

test('a halt takes back the command whose request is still on its way', async ({ page, open, line, excused }) => {
  excused.push(takenBack);
  await open('/tuning/reference');
  const tuning = await hold(page, 'POST', '**/axes/reference/jobs', '"tune"');
  await page.getByRole('button', { name: 'Measure and propose' }).click();
  await tuning.held;
  await page.getByRole('link', { name: 'Line', exact: true }).click();
  await line.call('POST', '/axes/reference/jobs', { do: 'enable' }); // the page offers a halt
  const card = page.getByRole('article', { name: 'reference' });
  const failed = givenUp(page);
  await card.getByRole('button', { name: 'Halt' }).click();
  await failed;
  await tuning.release();
  await expect.poll(() => jobs(line)).toEqual(['stop', 'enable', 'stop']);
});

test('STOP takes back a controlword whose request is still on its way', async ({ page, open, line, excused }) => {
  excused.push(takenBack);
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
  await expect(page.getByText('taken back').first()).toBeVisible();
  await written.release();
  expect(await state()).toBe(stopped);
});

const speedOf = async (line: Line, axis = 'reference') => Math.abs((await line.call<{ velocity_rpm: number }>('GET', `/axes/${axis}`)).velocity_rpm);

test.describe('with the time of the line', () => {
  test.use({ lineText: lineFile('virtual') });

  test('Cancel takes back what was to follow, also if the job is over before the request arrives', async ({ page, open, line }) => {
    await line.call('PUT', '/clock', { speed: 1 });
    await open('/axis/reference');
    await expect(page.getByRole('button', { name: 'Move +' })).toBeEnabled();
    await line.call('PUT', '/clock', { speed: 0 });
    const begun = page.waitForResponse('**/axes/reference/jobs');
    await page.getByRole('button', { name: 'Move +' }).click();
    await (await begun).finished(); // else Cancel takes back the enabling, too
    const cancel = page.getByRole('button', { name: 'Cancel', exact: true });
    await expect(cancel).toBeVisible();
    const cancelling = await hold(page, 'DELETE', '**/api/v1/jobs/*');
    await cancel.click();
    await cancelling.held;
    await line.call('PUT', '/clock', { speed: 1 });
    await expect(page.getByText('enable: done')).toBeVisible();
    await expect(page.getByText('taken back').first()).toBeVisible(); // the move
    expect(await jobs(line)).toEqual(['enable']);
    await cancelling.release();
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

  test('Cancel halts a job that the server has begun, and whose answer is still on its way', async ({ page, open, line, excused }) => {
    excused.push(takenBack);
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
    await isSettled(page);
    await page.getByRole('textbox', { name: 'Distance' }).fill('8');
    await page.getByRole('textbox', { name: 'Velocity', exact: true }).fill('60');
    await page.getByRole('button', { name: 'Move +' }).click();
    const cancel = page.getByRole('button', { name: 'Cancel', exact: true });
    await expect.poll(async () => (await jobs(line)).at(-1)).toBe('move');
    await line.call('PUT', '/clock', { speed: 0 }); // the move does not end before the click
    await cancel.click();
    await cancelling.held;
    await expect.poll(() => jobs(line)).toEqual(['enable', 'move', 'stop']);
    release();
    await cancelling.release();
  });

  test('a sequence does not go on after the page has slept', async ({ page, open, line }) => {
    await line.call('PUT', '/clock', { speed: 1 });
    await open('/axis/reference');
    await isSettled(page);
    await page.getByRole('textbox', { name: 'Distance' }).fill('4');
    await page.getByRole('textbox', { name: 'Velocity' }).fill('60');
    await page.getByRole('button', { name: 'There and back' }).click();
    await expect.poll(() => speedOf(line), { intervals: [20] }).toBeGreaterThan(30);
    await line.call('PUT', '/clock', { speed: 0 });
    // As a computer that sleeps: its clock goes on, and it handles no message meanwhile. The way there ends while the page sleeps.
    const asleep = page.waitForEvent('console', (message) => message.text() === 'asleep');
    const slept = page.evaluate(() => {
      console.log('asleep');
      const end = performance.now() + 6000;
      while (performance.now() < end);
    });
    await asleep;
    await line.call('PUT', '/clock', { speed: 20 });
    await expect.poll(async () => (await line.call<{ jobs: Job[] }>('GET', '/jobs')).jobs.at(-1)).toMatchObject({ do: 'move', state: 'done' });
    await slept;
    await expect(page.getByText('this page slept or was not connected')).toBeVisible();
    expect((await jobs(line)).filter((job) => job === 'move')).toHaveLength(1);
  });
});

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
  await jogUntil(async () => (await speedOf(line)) > 30, () => page.keyboard.down('Space'), () => page.keyboard.up('Space'));
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

// Answers that arrive while a person looks for an option.
test('an open list of the guide stays open while the answers about the drive arrive', async ({ page, open }) => {
  const [objects, units] = [await hold(page, 'GET', '**/api/v1/axes/reference/objects'), await hold(page, 'GET', '**/api/v1/axes/reference/units')];
  await open('/commission/reference?step=homing');
  // A list closes when the page scrolls. So the page is scrolled before the click, and not by it.
  const method = page.getByRole('button', { name: /Method/ });
  await method.scrollIntoViewIfNeeded();
  await page.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))));
  await method.click();
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
  const answered = page.waitForResponse('**/api/v1/axes/ismk/geometry');
  await geometry.release();
  await (await answered).finished();
  expect(await options.allTextContents()).toEqual(before);
  // A list that is opened before the page has handled the answer keeps the order of before: a person opens it again.
  await expect(async () => {
    await page.keyboard.press('Escape');
    await method.click();
    await expect(options.filter({ hasText: 'no home switch' })).not.toHaveCount(0, { timeout: 2000 });
  }).toPass();
});
