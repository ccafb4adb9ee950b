import { card, choose, expect, panel, test, type } from './fixtures';
import { axes } from './line';

interface View {
  state: string;
  homed: boolean;
  position_counts: number;
  velocity_rpm: number;
}

for (const { name, home } of axes) {
  test(`homes ${name} by method ${home}`, async ({ page, open, line, picture }) => {
    await open(`/axis/${name}?do=home`);
    await choose(page, 'Method', new RegExp(`^${home}: `));
    await type(page, 'Speed during search for switch', 240);
    await type(page, 'Speed during search for zero', 60);
    await page.getByRole('button', { name: 'Home', exact: true }).click();
    await expect(page.getByText(/home: (running|done)/)).toBeVisible(); // a computer that is busy shows its end only
    await picture(`homing-${name}`);
    await expect(page.getByText(/home: done/)).toBeVisible({ timeout: 90_000 });
    const here = page.locator('svg.homing circle.here');
    const rest = (await here.getAttribute('cx')) ?? '';
    // The page tells each place it draws: a test that looks now and then may miss a replay of a second.
    const places = await page.evaluateHandle(() => {
      const seen = new Set<string | null>();
      const look = () => seen.add(document.querySelector('svg.homing circle.here')?.getAttribute('cx') ?? null);
      new MutationObserver(look).observe(document.querySelector('svg.homing')!, { attributes: true, childList: true, subtree: true });
      return seen;
    });
    await page.getByRole('button', { name: 'Replay' }).click();
    await expect.poll(() => places.evaluate((seen) => seen.size)).toBeGreaterThan(2);
    await picture(`replay-${name}`);
    await expect(page.getByRole('button', { name: 'Replay', exact: true })).toBeVisible();
    await expect(here).toHaveAttribute('cx', rest);
    const view = await line.call<View>('GET', `/axes/${name}`);
    expect(view.state).toBe('operation enabled');
    await open('/');
    await expect(card(page, name)).toContainText('homed');
  });
}

test('moves one revolution, and says where it is', async ({ page, open, line, picture }) => {
  await open('/axis/reference');
  await type(page, 'Distance', 2.5);
  await page.getByRole('button', { name: 'Move +' }).click();
  await expect(page.getByText(/move: done/)).toBeVisible();
  const { position_counts } = await line.call<View>('GET', '/axes/reference');
  expect(Math.abs(position_counts - 2.5 * 131072)).toBeLessThan(500);
  await expect(panel(page, 'Motion')).toContainText(/2\.(49|50)\d\d\s*rev/);
  await picture('axis');
});

test('runs at a velocity until it is halted', async ({ page, open, line }) => {
  await open('/axis/reference?do=velocity');
  await type(page, 'Velocity', 90);
  await page.getByRole('button', { name: 'Run' }).click();
  await expect.poll(async () => (await line.call<View>('GET', '/axes/reference')).velocity_rpm).toBeGreaterThan(80);
  await panel(page, 'Motion').getByRole('button', { name: 'Halt' }).first().click();
  await expect.poll(async () => Math.abs((await line.call<View>('GET', '/axes/reference')).velocity_rpm)).toBeLessThan(1);
});

test('jogs while it is pressed, with the pointer and with the keyboard', async ({ page, open, line }) => {
  await open('/axis/reference?do=jog');
  await panel(page, 'Motion').getByRole('button', { name: 'Enable' }).click();
  const jog = page.getByRole('button', { name: 'Jog in positive direction' });
  await expect(jog).toBeEnabled();
  const speed = async () => (await line.call<View>('GET', '/axes/reference')).velocity_rpm;
  await jog.hover();
  await page.mouse.down();
  await expect.poll(speed).toBeGreaterThan(50);
  await page.mouse.up();
  await expect.poll(async () => Math.abs(await speed())).toBeLessThan(1);

  await page.getByRole('button', { name: 'Jog in negative direction' }).focus();
  await page.keyboard.down('Space');
  await expect.poll(speed).toBeLessThan(-50);
  // The window loses the keyboard: the page is not told that the key goes up.
  await page.evaluate(() => dispatchEvent(new Event('blur')));
  await expect.poll(async () => Math.abs(await speed())).toBeLessThan(1);
  await page.keyboard.up('Space');
});

test('transitions of the state machine are buttons', async ({ page, open }) => {
  await open('/axis/reference');
  const machine = panel(page, 'State machine');
  for (const [button, state] of [['shutdown', 'ready to switch on'], ['switch on', 'switched on'], ['enable operation', 'operation enabled'], ['disable voltage', 'switch on disabled']]) {
    await machine.getByRole('button', { name: new RegExp(`^\\d+ ${button} →`) }).click();
    await expect(machine.locator('header .chip')).toHaveText(state);
    await expect(machine.locator('.place.now')).toHaveText(state);
  }
});

test('the big stop stops every axis', async ({ page, open, line }) => {
  for (const name of ['reference', 'ismc']) {
    await open(`/axis/${name}?do=velocity`);
    await page.getByRole('button', { name: 'Run' }).click();
    await expect.poll(async () => (await line.call<View>('GET', `/axes/${name}`)).velocity_rpm).toBeGreaterThan(50);
  }
  await page.getByRole('button', { name: 'STOP', exact: true }).click();
  for (const name of ['reference', 'ismc']) {
    await expect.poll(async () => Math.abs((await line.call<View>('GET', `/axes/${name}`)).velocity_rpm)).toBeLessThan(1);
  }
});
