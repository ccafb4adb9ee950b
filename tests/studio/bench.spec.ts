import { expect, noPower, panel, test, type, withoutTimeouts } from './fixtures';

interface View {
  state: string;
  powered: boolean;
}

test('an input is forced and given back', async ({ page, open, line, picture }) => {
  await open('/plant/reference');
  const inputs = panel(page, 'Input wiring');
  await inputs.getByRole('group', { name: 'Force DI0' }).getByRole('button', { name: '1' }).click();
  await expect(inputs.getByRole('row', { name: /DI0/ }).getByRole('img', { name: 'on' })).toBeVisible();
  const level = async () => (await line.call<{ inputs: Record<string, { level: boolean; forced: boolean }> }>('GET', '/axes/reference/inputs')).inputs.DI0;
  expect(await level()).toEqual({ level: true, forced: true });
  await picture('plant');
  await inputs.getByRole('group', { name: 'Force DI0' }).getByRole('button', { name: 'wire' }).click();
  await expect.poll(level).toEqual({ level: false, forced: false });
});

test('a fault is provoked, explained, looked at in its moment, and cleared', async ({ page, open, line, picture }) => {
  await open('/axis/reference');
  await panel(page, 'Motion').getByRole('button', { name: 'Enable' }).click();
  await expect(panel(page, 'State machine').locator('.place.now')).toHaveText('operation enabled');
  await page.getByRole('link', { name: 'I/O and plant' }).click();
  await panel(page, 'Fault injection').getByRole('button', { name: 'Inject' }).click();
  await expect.poll(async () => (await line.call<View>('GET', '/axes/reference')).state).toBe('fault');

  await page.getByRole('link', { name: 'Faults' }).click();
  const active = panel(page, 'Active');
  await expect(active).toContainText('cause');
  await expect(active).toContainText('remedy');
  const moment = panel(page, 'Fault recordings').getByRole('link').first();
  await expect(moment).toBeVisible();
  await picture('faults');

  await page.getByRole('link', { name: 'Remove the injected fault' }).click();
  await page.getByRole('button', { name: /Remove fault encoder_loss/ }).click();
  await page.getByRole('link', { name: 'Faults' }).click();
  await active.getByRole('button', { name: 'Clear fault' }).click();
  await expect(active).toContainText('No fault.');
  expect((await line.call<View>('GET', '/axes/reference')).state).toBe('switch on disabled');

  await moment.click();
  await expect(page.getByRole('table', { name: 'Measurements' })).toBeVisible();
  await expect(page.getByRole('heading', { name: /fault 0x[0-9A-F]+ of reference/i })).toBeVisible();
});

test('a parameter is changed, marked, stored, and there after a power cycle', async ({ page, open, line, picture, excused }) => {
  excused.push(noPower);
  await withoutTimeouts(page);
  await open('/objects/reference?q=profile velocity&object=6081:00');
  const editor = panel(page, /profile velocity/i);
  await editor.getByLabel('New value').fill('0x4D2');
  await editor.getByRole('button', { name: 'Write' }).click();
  await expect(editor.locator('dd.changed')).toContainText('1234');
  await picture('objects');

  await open('/objects/reference?q=save all&object=1010:01');
  await page.getByRole('button', { name: /Store/ }).click();
  await expect(page.getByText('1010:01 written')).toBeVisible();
  await open('/plant/reference');
  const cycled = page.waitForResponse('**/axes/reference/power');
  await page.getByRole('button', { name: 'Power cycle' }).click();
  await cycled;
  await expect.poll(async () => (await line.call<View>('GET', '/axes/reference')).powered).toBe(true);
  await open('/objects/reference?group=Changed&object=6081:00');
  await expect(panel(page, /profile velocity/i).locator('dd.changed')).toContainText('1234');
});

test('what the drive refuses is said, and changes nothing', async ({ page, open, line, watched }) => {
  await open('/objects/reference?q=modes of operation&object=6060:00');
  const editor = panel(page, /modes of operation/i);
  await editor.getByLabel('New value').fill('99');
  await editor.getByRole('button', { name: 'Write' }).click();
  await expect(page.locator('.notice.bad')).toContainText('refuses');
  expect((await line.call<{ value: number }>('GET', '/axes/reference/objects/6060/0')).value).toBe(0);
  // The browser itself logs the refusal.
  expect(watched.splice(0).join()).toContain('422');
});

test('a search without a hit says so, and 0x before an index is understood', async ({ page, open }) => {
  await open('/objects/reference?q=0x6064');
  await expect(page.getByRole('listbox', { name: 'Objects' }).getByRole('option').first()).toContainText('6064:00');
  await open('/objects/reference?q=flux+capacitor');
  await expect(panel(page, 'Dictionary')).toContainText('No object matches "flux capacitor".');
  await open('/objects/reference?q=6064&group=Storage');
  await expect(panel(page, 'Dictionary')).toContainText('No object of the group "Storage" matches "6064".');
});

test('a value that is none is refused with the reason', async ({ page, open }) => {
  await open('/objects/reference?object=6081:00&q=6081');
  const editor = panel(page, /profile velocity/i);
  const field = editor.getByLabel('New value');
  for (const [text, reason] of [['abc', 'Not a number'], ['1,5', 'The decimal separator is a point'], ['12.5', 'whole number'], ['99999999999999999999', 'Too high: UNSIGNED32 is at most 4294967295.']] as const) {
    await field.fill(text);
    await expect(editor.getByRole('status')).toContainText(reason);
    await expect(field).toHaveAccessibleDescription(new RegExp(reason));
    await expect(editor.getByRole('button', { name: 'Write' })).toBeDisabled();
  }
  await field.fill('1234');
  await expect(editor.getByRole('status')).toHaveCount(0);
  await expect(editor.getByRole('button', { name: 'Write' })).toBeEnabled();
});

test('a selected text stays while the value of the drive changes, until the field is left', async ({ page, open, line }) => {
  const drive = (value: number) => line.call('PUT', '/axes/reference/objects/6081/0', { value });
  await drive(1000);
  await open('/objects/reference?object=6081:00&q=6081');
  const editor = panel(page, /profile velocity/i);
  const field = editor.getByLabel('New value');
  await expect(field).toHaveValue('1000');
  await field.selectText();
  await drive(2000);
  await expect(editor.getByRole('definition').first()).toContainText('2000');
  await page.keyboard.insertText('30');
  await expect(field).toHaveValue('30');
  await field.press('Enter');
  await expect(editor.getByRole('definition').first()).toContainText('30');
  await field.selectText();
  await drive(4000);
  await expect(editor.getByRole('definition').first()).toContainText('4000');
  await page.keyboard.insertText('50');
  await expect(field).toHaveValue('50');
  await field.press('Enter');
  await expect(editor.getByRole('definition').first()).toContainText('50');
  await drive(6000);
  await field.blur();
  await expect(field).toHaveValue('6000');
});

test('the refusal of an object goes with its next success, and with its view', async ({ page, open, watched }) => {
  await withoutTimeouts(page);
  const bad = page.locator('.notice.bad');
  const write = async (value: string) => {
    await panel(page, /modes of operation/i).getByLabel('New value').fill(value);
    await panel(page, /modes of operation/i).getByRole('button', { name: 'Write' }).click();
  };
  await open('/objects/reference?q=modes of operation&object=6060:00');
  await write('99');
  await expect(bad).toContainText('refuses');
  await write('1');
  await expect(page.getByText('6060:00 written')).toBeVisible();
  await expect(bad).toHaveCount(0);
  await write('99');
  await expect(bad).toContainText('refuses');
  await page.getByRole('link', { name: 'Parameters', exact: true }).click();
  await expect(bad).toHaveCount(0);
  expect(watched.splice(0).join()).toContain('422'); // the browser itself logs the refusal
});

test('the plant is changed', async ({ page, open, line }) => {
  await open('/plant/ismc');
  await type(page, 'Load torque', 0.25);
  await page.getByText('Locked rotor').click();
  await expect.poll(async () => line.call('GET', '/axes/ismc/plant')).toMatchObject({ load_torque_nm: 0.25, locked_rotor: true });
});

test('a refused number of the plant is named as its field', async ({ page, open, watched }) => {
  await open('/plant/ismc');
  for (const [field, text] of [['Load torque', '1e30 Nm'], ['Load inertia', '1e30 kg·m²'], ['Coulomb friction', '1e30 Nm'], ['Supply', '1e30 V'], ['Ambient', '1e30 °C']] as const) {
    await type(page, field, 1e30);
    await expect(page.locator('.notice.bad').last()).toContainText(`${field}: ${text} is not within`);
    await page.locator('.notice.bad').last().getByRole('button', { name: 'Dismiss' }).click();
  }
  expect(watched.splice(0).join()).toContain('422'); // the browser itself logs the refusal
});

test('a bus is disturbed and left alone again', async ({ page, open, line }) => {
  await open('/plant/reference');
  const disturbance = panel(page, 'Disturbance of can0');
  await disturbance.getByRole('button', { name: 'Disturb' }).click();
  await expect(disturbance.getByText('disturbed')).toBeVisible();
  expect(await line.call('GET', '/buses/can0')).toMatchObject({ disturbance: { drop: 0.05 } });
  await disturbance.getByRole('button', { name: 'End' }).click();
  await expect(disturbance.getByText('disturbed')).toHaveCount(0);
});

test('without power an axis says so, and comes back', async ({ page, open, line, excused }) => {
  excused.push(noPower);
  await open('/plant/jmc');
  await page.getByRole('button', { name: 'Off' }).click();
  await expect.poll(async () => (await line.call<View>('GET', '/axes/jmc')).powered).toBe(false);
  await open('/');
  const card = page.getByRole('article', { name: 'jmc' });
  await expect(card).toContainText('no power');
  await card.getByRole('button', { name: 'Power on' }).click();
  await expect(card).not.toContainText('no power');
});
