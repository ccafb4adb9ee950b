import { card, choose, expect, panel, test as base, type, watch } from './fixtures';
import { Line, lineFile, Studio } from './line';

// The page in front of drives on buses: those of a line in another process, which the studio reaches as any others.

interface View {
  state: string;
  velocity_rpm: number;
  position_counts: number;
}

const test = base.extend<{ drives: Line; studio: Studio; go: (path: string) => Promise<void> }>({
  drives: async ({ page: _ }, use) => {
    const line = await new Line(lineFile(), ['can0=socketcand:127.0.0.1:0/can0', 'ecat=udp:127.0.0.1:0']).start();
    await line.waitForSlowMaster();
    await use(line);
    await line.end();
  },
  studio: async ({ drives }, use) => {
    const studio = await new Studio([`${drives.linkOf('can0')}=1,2`, drives.linkOf('ecat')]).start();
    await use(studio);
    await studio.end();
  },
  go: async ({ page, studio }, use) => {
    await use(async (path) => {
      await page.goto(studio.address + path);
      await expect(page.locator('main .panel').first()).toBeVisible();
    });
  },
  // The other fixtures' line stands for the studio here.
  watched: async ({ page, studio }, use) => {
    const found: string[] = [];
    watch(page, studio, found);
    await page.addInitScript(() => {
      if (location.protocol.startsWith('http')) localStorage.setItem('servodrome.tour', 'over');
    });
    await use(found);
    expect(found).toEqual([]);
  },
  line: async ({ drives }, use) => use(drives),
});

const [can, reference, ethercat] = ['ismc-1', 'generic402-2', 'jmc_ec-1'];

test('shows the drives that were found, moves them, and knows what it does not have', async ({ page, go, drives, picture }) => {
  await go('/');
  for (const axis of [can, reference, ethercat]) await expect(card(page, axis).locator('header .chip')).toHaveText('switch on disabled');
  await go(`/axis/${reference}`);
  await type(page, 'Distance', 2.5);
  await page.getByRole('button', { name: 'Move +' }).click();
  await expect(page.getByText(/move: done/)).toBeVisible();
  const { position_counts } = await drives.call<View>('GET', '/axes/reference');
  expect(Math.abs(position_counts - 2.5 * 131072)).toBeLessThan(500);
  await expect(panel(page, 'Motion')).toContainText(/2\.(49|50)\d\d\s*rev/);
  await expect(page.getByRole('button', { name: 'Power cycle' })).toHaveCount(0);
  await picture('real-axis');
  await page.getByRole('link', { name: 'Misbehaviour' }).click();
  await expect(page.getByText('Only simulated drives and their buses can misbehave on purpose')).toBeVisible();
  await page.getByRole('link', { name: 'I/O and plant' }).click();
  await expect(page.locator('main')).toContainText('these are drives on a bus');
  // Its terminals are asked over the bus.
  await panel(page, 'Outputs').getByRole('row', { name: /60FE:01/ }).getByRole('switch', { name: 'DO1' }).click();
  await expect.poll(async () => (await drives.call<{ value: number }>('GET', '/axes/reference/objects/60FE/1')).value).toBe(0x20000);
  await page.getByRole('link', { name: 'Tuning', exact: true }).click();
  await expect(panel(page, 'Tune the velocity loop').getByRole('button', { name: 'Tune', exact: true })).toBeVisible();
  await expect(page.getByRole('textbox', { name: 'Velocity loop proportional gain' })).toHaveValue('0');
  await go('/');
  await expect(page.locator('.card .travel')).toHaveCount(0); // the drives do not report it
  await picture('real-line');
});

test('a dashboard reads and writes drives on two buses, and a recording has both', async ({ page, go, studio, drives }) => {
  await go('/boards');
  const widgets = [
    { kind: 'watch', title: 'Words', span: 2, channels: [`${can}/6041:00`, `${ethercat}/6041:00`, `${reference}/1008:00`] },
    { kind: 'slider', title: 'Acceleration', span: 1, object: `${reference}/6083:00`, minimum: 0, maximum: 2000000, step: 1000 },
  ];
  const buffer = Buffer.from(JSON.stringify({ format: 'servodrome-dashboards', version: 1, boards: [{ name: 'Buses', widgets }] }));
  await page.getByLabel('Import a file').setInputFiles({ name: 'buses.json', mimeType: 'application/json', buffer });
  const words = page.getByRole('table', { name: 'Words' });
  for (const axis of [can, ethercat]) await expect(words.getByRole('row', { name: new RegExp(`^${axis} `) })).toContainText(/[0-9A-F]{4}h/);
  await expect(words.getByRole('row', { name: /1008:00/ })).toContainText('reference drive');
  const field = panel(page, 'Acceleration').getByRole('textbox');
  await expect(field).toBeEnabled();
  await expect(panel(page, 'Acceleration').getByRole('status')).toHaveText(/^drive: \d/); // a value that arrives replaces what is typed
  await field.fill('77000');
  await field.press('Enter');
  await expect.poll(async () => (await drives.call<{ value: number }>('GET', '/axes/reference/objects/6083/0')).value).toBe(77000);
  await expect(panel(page, 'Acceleration').getByRole('status')).toHaveText('drive: 77\u2009000');

  const channels = [can, ethercat].map((axis) => ({ axis, object: '6041:00' }));
  const { id } = await studio.call<{ id: number }>('POST', '/recordings', { channels, rate_hz: 50, duration_ms: 1000 });
  await expect.poll(async () => (await studio.call<{ state: string }>('GET', `/recordings/${id}`)).state).toBe('done');
  await go(`/scope?rec=${id}&math=${encodeURIComponent('both=c1+c2')}`);
  const rows = page.getByRole('table', { name: 'Measurements' }).getByRole('row');
  await expect(rows).toHaveCount(4);
  await expect(rows.filter({ hasText: 'both' }).getByRole('cell').nth(5)).not.toHaveText('–');
});

test('compares the parameters of a drive with the factory', async ({ page, go }) => {
  await go(`/objects/${ethercat}?view=parameters`);
  await page.getByRole('button', { name: 'Compare with factory' }).click();
  await expect(panel(page, 'Compared with factory')).toBeVisible({ timeout: 60_000 });
});

test('shows what PDOs carry, and the frames that pass', async ({ page, go, studio, drives }) => {
  await go(`/objects/${reference}?view=pdos`);
  await expect(page.getByRole('region', { name: 'Receive PDOs, to the drive' })).toContainText('6040');
  await go(`/bus/traffic?bus=${encodeURIComponent(drives.linkOf('can0'))}`);
  await expect(panel(page, 'Traffic').getByRole('button', { name: 'Stop recording' })).toBeVisible();
  const rows = page.getByRole('listbox', { name: 'Frames' });
  await studio.call('GET', `/axes/${reference}/objects/6064/0`);
  await expect(rows).toContainText('6041');
  await expect(rows).toContainText(reference);
});

interface Job {
  id: number;
  do: string;
  state: string;
  error?: { what: string };
}

// A master that gets no processor for a tenth of a second loses its slaves, as a real one does: then once more.
test('homes a drive on EtherCAT', async ({ page, go, drives, studio }) => {
  await go(`/axis/${ethercat}?do=home`);
  await choose(page, 'Method', /^7: /);
  await type(page, 'Speed during search for switch', 240);
  await type(page, 'Speed during search for zero', 60);
  const last = async () => (await studio.call<{ jobs: Job[] }>('GET', '/jobs')).jobs.filter((job) => job.do === 'home').at(-1);
  for (let attempt = 1; ; ++attempt) {
    const before = (await last())?.id ?? 0;
    await page.getByRole('button', { name: 'Home', exact: true }).click();
    await expect.poll(async () => { const job = await last(); return job && job.id > before ? job.state : 'not begun'; }, { timeout: 90_000 }).toMatch(/done|failed/);
    const job = (await last())!;
    if (attempt === 5 || !/watchdog|frames do not come back/.test(job.error?.what ?? '')) break;
    await page.getByRole('button', { name: 'Clear fault' }).click();
    await expect.poll(async () => (await drives.call<View>('GET', '/axes/jmc')).state, { timeout: 30_000 }).not.toBe('fault');
  }
  await expect(page.getByText(/home: done/)).toBeVisible();
  expect((await drives.call<{ homed: boolean }>('GET', '/axes/jmc')).homed).toBe(true);
});

test('reads and writes objects, and shows what the drive refuses', async ({ page, go, drives }) => {
  await go(`/objects/${can}?q=6083&object=6083:00`);
  const editor = page.getByRole('textbox', { name: /value/i }).first();
  await expect(editor).toBeVisible();
  await editor.fill('54321');
  await editor.press('Enter');
  await expect.poll(async () => (await drives.call<{ value: number }>('GET', '/axes/ismc/objects/6083/0')).value).toBe(54321);
});

test('records, by asking as fast as the bus lets it', async ({ page, go, studio }) => {
  await go(`/scope?ch=${reference}/position_counts,${reference}/velocity&rate=100&ms=1500&pre=0`);
  await page.getByText('with a move').click();
  await page.getByRole('button', { name: 'Record', exact: true }).click();
  await expect.poll(async () => (await studio.call<{ recordings: { state: string }[] }>('GET', '/recordings')).recordings[0]?.state).toBe('done');
  await expect(page.getByRole('list', { name: 'How the channels were sampled' })).toContainText(/position_counts: read as an object at \d+ Hz/);
});

test('says a fault with its cause, and clears it', async ({ page, go, drives, picture }) => {
  await go(`/faults/${reference}`);
  await drives.call('POST', '/axes/reference/faults', { inject: 'over_voltage' });
  await expect(panel(page, 'Active')).toContainText(/3210h|over-?voltage/i);
  await picture('real-fault');
  await drives.call('DELETE', '/axes/reference/faults');
  await page.getByRole('button', { name: 'Clear fault' }).click();
  await expect.poll(async () => (await drives.call<View>('GET', '/axes/reference')).state).not.toBe('fault');
});

test('the big stop stops every axis', async ({ page, go, drives, studio }) => {
  await go('/');
  // So slowly that a busy machine presses the stop before the limit switches, after 10 revolutions, do it.
  for (const axis of [reference, ethercat]) {
    await card(page, axis).getByRole('button', { name: 'Enable' }).click();
    await expect(card(page, axis).locator('header .chip')).toHaveText('operation enabled');
    await studio.call('POST', `/axes/${axis}/jobs`, { do: 'velocity', velocity: 0.1, acceleration: 5, units: 'revolutions' });
  }
  const speed = async (axis: string) => Math.abs((await drives.call<View>('GET', `/axes/${axis}`)).velocity_rpm);
  for (const axis of ['reference', 'jmc']) await expect.poll(() => speed(axis)).toBeGreaterThan(3);
  const told = page.getByText('all axes stopped').waitFor({ timeout: 30_000 }); // the page shows it for four seconds: expect() may look too late
  await page.keyboard.press('Control+Space');
  await told;
  for (const axis of ['reference', 'jmc']) await expect.poll(() => speed(axis)).toBeLessThan(1);
});

test('the loss of the buses is said, and the page comes back with them', async ({ page, go, drives, watched, picture }) => {
  await go('/');
  await card(page, can).getByRole('button', { name: 'Enable' }).click();
  await expect(card(page, can).locator('header .chip')).toHaveText('operation enabled');
  await drives.stop();
  await expect(page.getByRole('alert')).toContainText('No answer from');
  await expect(page.getByRole('alert')).toContainText(can);
  await expect(card(page, can)).toContainText('no answer');
  await picture('real-lost');
  await drives.start();
  await expect(page.getByRole('alert')).toHaveCount(0);
  await card(page, can).getByRole('button', { name: 'Enable' }).click();
  await expect(card(page, can).locator('header .chip')).toHaveText('operation enabled');
  for (const message of watched.splice(0)) expect(message).toMatch(/409/); // what was being asked when the bus went
});

// The server would refuse it (409): while the drive has not been asked yet or is silent, and while it does something.
test('what moves an axis is dead as long as it cannot be asked or is busy', async ({ page, go, drives, studio }) => {
  await go(`/axis/${reference}?do=home`);
  const home = page.getByRole('button', { name: 'Home', exact: true });
  await expect(home).toBeEnabled();
  await drives.call('POST', '/buses/can0/disturb', { cut: true, axis: 'reference' });
  await expect(home).toBeDisabled();
  await drives.call('DELETE', '/buses/can0/disturb');
  await expect(home).toBeEnabled();
  await studio.call('POST', `/axes/${reference}/jobs`, { do: 'enable' });
  await expect(page.getByText(/enable: done/)).toBeVisible();
  await studio.call('POST', `/axes/${reference}/jobs`, { do: 'move', by: 4, velocity: 1, acceleration: 20, units: 'revolutions' });
  await expect(home).toBeDisabled();
  await expect(page.getByText(/move: done/)).toBeVisible();
  await expect(home).toBeEnabled();
});

// An ISMC has no object that says what a revolution is.
test('proposes no numbers where the unit is not known, and says what they will do', async ({ page, go, drives }) => {
  await go(`/axis/${can}?do=velocity`);
  const motion = panel(page, 'Motion');
  const run = motion.getByRole('button', { name: 'Run' });
  const velocity = motion.getByRole('textbox', { name: 'Velocity', exact: true });
  await expect(motion.getByRole('note')).toContainText('does not report its units per revolution');
  await expect(velocity).toHaveValue('');
  await expect(motion.getByRole('textbox', { name: 'Acceleration' })).toHaveValue('');
  await expect(run).toBeDisabled();
  await velocity.fill('232742');
  await expect(run).toBeDisabled();
  await motion.getByRole('textbox', { name: 'Acceleration' }).fill('500000');
  await expect(motion.getByRole('note')).toContainText(/Reaches 232\s742 .*\/s in 465 ms; a halt takes 465 ms/);
  await expect(run).toBeEnabled();
  await run.click();
  await expect(page.getByText(/velocity: done/)).toBeVisible();
  // A ramp on which halting would take an hour: it becomes a quick stop.
  await drives.call('PUT', '/axes/ismc/objects/6084/0', { value: 50 });
  await motion.getByRole('button', { name: 'Halt' }).first().click();
  await expect(motion.getByText(/became a quick stop/).first()).toBeVisible();
  await expect.poll(async () => Math.abs((await drives.call<View>('GET', '/axes/ismc')).velocity_rpm)).toBeLessThan(1);
});
