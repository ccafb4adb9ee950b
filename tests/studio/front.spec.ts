import { expect, noPower, panel, test } from './fixtures';

// The panel of the drive's front, while the drive is at work: what the API says is what is seen, as it changes.

const title = 'Lamps and outputs';

test('the lamps of a drive change with its state', async ({ page, open, line }) => {
  await open('/axis/ismk');
  const lamp = (name: string, light: string) => panel(page, title).getByRole('listitem').filter({ hasText: name }).getByRole('img', { name: light, exact: true });
  await expect(lamp('PWR', 'on')).toHaveClass(/green/);
  await expect(lamp('ERR', 'off')).toBeVisible();
  await expect(lamp('ERR', 'off')).not.toHaveClass(/red/);
  await expect(lamp('RUN', 'on')).toBeVisible();
  await line.call('POST', '/axes/ismk/faults', { inject: 'encoder_loss' });
  await expect(lamp('ERR', 'on')).toHaveClass(/red/);
  await expect(lamp('RUN', 'off')).toBeVisible();
});

test('flashes of a lamp are said in words', async ({ page, open, line }) => {
  await open('/axis/jmc');
  const lights = async () => (await line.call<{ lamps: { name: string; light: string; flashes?: number }[] }>('GET', '/axes/jmc')).lamps;
  await line.call('POST', '/axes/jmc/faults', { inject: 'encoder_loss' });
  await expect.poll(async () => (await lights()).some(({ light }) => light === 'flashes')).toBe(true);
  const flashing = (await lights()).find(({ light }) => light === 'flashes');
  const words = flashing?.flashes === 1 ? 'single flash' : `${flashing?.flashes} flashes`;
  await expect(panel(page, title).getByRole('listitem').filter({ hasText: flashing?.name })).toContainText(words);
});

test('the outputs of a drive are seen as they are set', async ({ page, open, line }) => {
  await open('/axis/reference');
  const output = (name: string) => panel(page, title).getByRole('listitem').filter({ hasText: name }).getByRole('img');
  for (const name of ['DO0', 'DO1', 'DO2', 'DO3']) await expect(output(name)).toHaveAccessibleName('off');
  await line.call('PUT', '/axes/reference/objects/60FE/2', { value: 0xf0000 });
  await line.call('PUT', '/axes/reference/objects/60FE/1', { value: 0x40000 });
  await expect(output('DO2')).toHaveAccessibleName('on');
  for (const name of ['DO0', 'DO1', 'DO3']) await expect(output(name)).toHaveAccessibleName('off');
});

test('a warning is seen as long as it is there', async ({ page, open, line }) => {
  await open('/axis/pronet');
  await expect(panel(page, title).getByText(/^Warning/)).toHaveCount(0);
  await line.call('PUT', '/axes/pronet/inputs', { DI3: true }); // NOT
  await expect(panel(page, title).getByText(/^Warning 8682h: /)).toBeVisible();
  await line.call('PUT', '/axes/pronet/inputs', { DI3: null });
  await expect(panel(page, title).getByText(/^Warning/)).toHaveCount(0);
});

test('a drive without power shows nothing', async ({ page, open, line, excused }) => {
  excused.push(noPower);
  await open('/axis/reference');
  await expect(panel(page, title)).toBeVisible();
  await line.call('POST', '/axes/reference/power', { action: 'off' });
  await expect(panel(page, title)).toHaveCount(0);
});
