import { card, expect, noPower, panel, test, type } from './fixtures';
import { axes } from './line';

// What the page lets a user ask of an axis: nothing that is not understood, and nothing that comes back by itself.

interface View {
  state: string;
  velocity_rpm: number;
  position_counts: number;
}

for (const { name, counts } of axes) {
  test(`enabling ${name} after STOP moves nothing`, async ({ page, open, line }) => {
    const view = () => line.call<View>('GET', `/axes/${name}`);
    await open(`/axis/${name}?do=velocity`);
    await page.getByRole('button', { name: 'Run' }).click();
    await expect.poll(async () => Math.abs((await view()).velocity_rpm)).toBeGreaterThan(50);
    await page.getByRole('button', { name: 'STOP', exact: true }).click();
    await expect.poll(async () => Math.abs((await view()).velocity_rpm)).toBeLessThan(1);
    const { position_counts: stood } = await view();
    await open('/');
    await line.call('POST', `/axes/${name}/jobs`, { do: 'disable' });
    await expect(card(page, name).getByRole('button', { name: 'Enable' })).toBeVisible();
    await card(page, name).getByRole('button', { name: 'Enable' }).click();
    await expect.poll(async () => (await view()).state).toBe('operation enabled');
    await page.waitForTimeout(1000); // of the line's time: it is a real one
    expect(Math.abs((await view()).position_counts - stood)).toBeLessThan(counts / 100);
  });
}

const numbers: [string, string | null][] = [
  ['-5', 'More than 0'], ['0', 'More than 0'], ['1e9', 'at most'], ['', 'Enter a number'], ['abc', 'Not a number'], ['1.2.3', 'Not a number'], ['1,500', '1500 or 1.5'], ['12', null],
];

test('a number that is not understood is marked, and its buttons are dead', async ({ page, open, line }) => {
  await open('/axis/reference');
  const motion = panel(page, 'Motion');
  const move = motion.getByRole('button', { name: 'Move +' });
  const field = motion.getByRole('textbox', { name: 'Velocity', exact: true });
  await expect(move).toBeEnabled();
  for (const [text, problem] of numbers) {
    await field.fill(text);
    if (problem === null) {
      await expect(move).toBeEnabled();
      await expect(field).not.toHaveAttribute('aria-invalid', 'true');
      continue;
    }
    await expect(move).toBeDisabled();
    await expect(motion.getByRole('button', { name: '− Back' })).toBeDisabled();
    await expect(field).toHaveAttribute('aria-invalid', 'true');
    await expect(motion).toContainText(problem);
    await field.press('Tab');
    await expect(field).toHaveValue(text); // it is not replaced
  }
  await field.fill('300');
  await motion.getByRole('textbox', { name: 'Distance' }).fill('0,5');
  await motion.getByRole('textbox', { name: 'Distance' }).press('Tab');
  const before = (await line.call<View>('GET', '/axes/reference')).position_counts;
  await move.click();
  await expect(page.getByText(/move: done/)).toBeVisible();
  const { position_counts } = await line.call<View>('GET', '/axes/reference');
  expect(Math.abs(position_counts - before - 0.5 * 131072)).toBeLessThan(500);
});

test('a number that the object of the drive cannot hold is refused with the range, and leaves no prediction', async ({ page, open }) => {
  await open('/axis/reference');
  const motion = panel(page, 'Motion');
  const moves = () => Promise.all(['Move +', '− Back', 'There and back', 'Go to zero'].map((name) => expect(motion.getByRole('button', { name })).toBeDisabled()));
  const ghost = motion.locator('.ghost text');
  await expect(ghost).toHaveCount(1);
  for (const [field, text, problem, usual] of [
    ['Distance', '1e30', 'From -16383 to 16383.', '1'], ['Velocity', '1e9', 'More than 0, at most 1966079.', '300'], ['Velocity', '0', 'More than 0, at most 1966079.', '300'],
    ['Acceleration', '0', 'More than 0, at most 32767.', '50'], ['Acceleration', '1e9', 'More than 0, at most 32767.', '50'], ['Distance', '', 'Enter a number.', '1'],
  ] as const) {
    const input = motion.getByRole('textbox', { name: field, exact: true });
    await input.fill(text);
    await expect(motion.locator('.refusal')).toHaveText(problem);
    await moves();
    await expect(ghost).toHaveCount(0);
    await expect(motion.getByRole('note')).toHaveText('Enter all values to see the predicted motion.');
    await input.fill(usual);
    await expect(ghost).toHaveCount(1);
    await expect(motion.getByRole('button', { name: 'Move +' })).toBeEnabled();
  }
  // The refusal of a move that is too long goes with its number.
  const distance = motion.getByRole('textbox', { name: 'Distance', exact: true });
  await distance.fill('1000');
  await expect(motion.getByRole('alert')).toContainText('is longer than');
  await distance.fill('');
  await expect(motion.getByRole('alert')).toHaveCount(0);
});

test('no button that moves acts on a number that is not understood', async ({ page, open }) => {
  for (const [kind, field, button] of [['velocity', 'Velocity', 'Run'], ['velocity', 'Acceleration', 'Run'], ['torque', 'Torque', 'Apply'], ['home', 'Speed during search for switch', 'Home'], ['position', 'Distance', 'Move +']] as const) {
    await open(`/axis/reference?do=${kind}`);
    const motion = panel(page, 'Motion');
    await expect(motion.getByRole('button', { name: button, exact: true })).toBeEnabled();
    await motion.getByRole('textbox', { name: field, exact: true }).fill('x');
    await expect(motion.getByRole('button', { name: button, exact: true })).toBeDisabled();
  }
  await open('/axis/reference?do=jog');
  await panel(page, 'Motion').getByRole('button', { name: 'Enable' }).click();
  const jog = page.getByRole('button', { name: 'Jog in positive direction' });
  await expect(jog).toBeEnabled();
  await type(page, 'Velocity', -1);
  await expect(jog).toBeDisabled();
  await open('/scope?ch=reference/velocity_rpm');
  await expect(page.getByRole('button', { name: 'Move and record' })).toBeEnabled();
  await page.getByRole('textbox', { name: 'Duration', exact: true }).fill('no');
  await expect(page.getByRole('button', { name: 'Move and record' })).toBeDisabled();
  await expect(page.getByRole('button', { name: 'Sweep and record' })).toBeEnabled();
  await page.getByRole('textbox', { name: 'Amplitude' }).fill('');
  await expect(page.getByRole('button', { name: 'Sweep and record' })).toBeDisabled();
});

test('no motion begins while the drive is in fault or without power, and the buttons give the reason', async ({ page, open, line, excused }) => {
  excused.push(noPower);
  const board = { name: 'Bench', widgets: ['move', 'home', 'jog'].map((what) => ({ kind: 'button', title: `Board ${what}`, span: 1, axis: 'ismk', do: what, by: 1, velocity: 1 })) };
  await page.addInitScript((boards) => localStorage.setItem('servodrome.boards', boards), JSON.stringify([board]));
  const reason = 'The drive has a fault: clear it first.';
  const state = async () => (await line.call<View>('GET', '/axes/ismk')).state;
  const motions: [string, string[]][] = [
    ['/axis/ismk', ['− Back', 'Move +', 'There and back', 'Go to zero']], ['/axis/ismk?do=velocity', ['Run']], ['/axis/ismk?do=torque', ['Apply']],
    ['/axis/ismk?do=jog', ['Jog in negative direction', 'Jog in positive direction']], ['/axis/ismk?do=home', ['Home']],
    ['/tuning/ismk', ['Measure and propose', 'Tune', 'Let the drive tune itself']], ['/scope?ch=ismk/velocity_rpm', ['Move and record', 'Sweep and record']],
    ['/boards', ['Board move', 'Board home', 'Board jog']],
  ];
  await line.call('POST', '/axes/ismk/jobs', { do: 'enable' });
  await expect.poll(state).toBe('operation enabled');
  await open('/axis/ismk');
  await expect(page.getByRole('button', { name: 'Move +' })).toBeEnabled();
  await expect(page.getByRole('button', { name: 'Move +' })).not.toHaveAttribute('title');
  await line.call('POST', '/axes/ismk/faults', { inject: 'encoder_loss' });
  await expect(page.getByRole('button', { name: 'Move +' })).toBeDisabled();
  await expect.poll(state).toBe('fault');
  const refuses = async (names: string[], why: string) => {
    for (const name of names) {
      await expect(page.getByRole('button', { name, exact: true })).toBeDisabled();
      await expect(page.getByRole('button', { name, exact: true })).toHaveAttribute('title', why);
    }
  };
  for (const [path, names] of motions) {
    await open(path);
    await refuses(names, reason);
    for (const halt of await page.getByRole('button', { name: /^(STOP|Halt)$/ }).all()) await expect(halt).toBeEnabled();
  }
  await line.call('DELETE', '/axes/ismk/faults');
  await open('/axis/ismk');
  await page.getByRole('button', { name: 'Clear fault' }).click();
  await expect(page.getByRole('button', { name: 'Move +' })).toBeEnabled();
  await page.getByRole('link', { name: 'Dashboards' }).click();
  await expect(page.getByRole('button', { name: 'Board move' })).toBeEnabled();
  await line.call('POST', '/axes/ismk/power', { action: 'off' });
  for (const [path, names] of motions) {
    if (path.startsWith('/tuning')) continue; // it has no buttons then
    await open(path);
    await refuses(names, 'The drive has no power: switch it on first.');
  }
});

test('says what a motion will be', async ({ page, open }) => {
  await open('/axis/reference');
  await type(page, 'Distance', 10);
  await type(page, 'Velocity', 300);
  await type(page, 'Acceleration', 50);
  await expect(panel(page, 'Motion').getByRole('note')).toContainText('Reaches 300 rpm in 100 ms, 10 rev in 2.1 s; a halt takes 100 ms and 0.25 rev');
});
