import { card, choose, expect, noPower, panel, test, type, withoutTimeouts } from './fixtures';

// What the page says of a drive is what its product does.

interface View {
  state: string;
  position_counts: number;
  target_counts: number | null;
}

test('a failed homing of an iSMK is shown as a homing error, by the names of the product', async ({ page, open, line }) => {
  await open('/axis/ismk?do=home');
  await expect(panel(page, 'Motion').locator('header')).toContainText('pulse');
  await panel(page, 'Motion').getByRole('button', { name: 'Enable' }).click();
  await expect.poll(async () => (await line.call<View>('GET', '/axes/ismk')).state).toBe('operation enabled');
  await line.call('POST', '/axes/ismk/jobs', { do: 'home', units: 'revolutions', method: 17, speed: 1, zero_speed: 1, acceleration: 20 });
  await expect(page.getByText(/home: failed/)).toBeVisible();
  const bits = panel(page, 'Words').getByRole('list', { name: 'Bits of the statusword' });
  await expect(bits.getByRole('listitem').filter({ hasText: 'homing error' })).toHaveClass('on');
  await expect(bits).not.toContainText('homing attained');
  await expect(page.getByText(/home: failed/)).toContainText('homing error');
  // The explanation is that of the name, not what CiA 402 has at this bit.
  for (const [bit, text] of [[12, 'homing error: Homing has failed'], [13, 'following error: The axis lags'], [15, 'home found: Homing is done'], [8, 'Manufacturer-specific.']] as const) {
    await bits.getByRole('listitem').nth(15 - bit).hover();
    await expect(page.getByRole('tooltip')).toContainText(text);
    await expect(page.getByRole('tooltip')).toContainText('iSMK integrated servo user manual, Table 5-5');
  }
  await expect(bits.getByRole('listitem').nth(15 - 15)).not.toHaveClass('on');
});

test('only the homing methods that the wiring permits can be chosen', async ({ page, open }) => {
  await open('/axis/ismk?do=home');
  await expect(page.getByRole('button', { name: /Method/ })).toContainText('33:');
  await page.getByRole('button', { name: /Method/ }).click();
  await expect(page.getByRole('option', { name: /^7: / })).toBeDisabled();
  await expect(page.getByRole('option', { name: /^7: / })).toContainText('no home switch');
  await expect(page.getByRole('option').first()).toBeEnabled();
  await page.keyboard.press('Escape');
  await open('/axis/pronet?do=home'); // its serial encoder has no index for homing
  await expect(page.getByRole('button', { name: /Method/ })).toContainText('17:');
});

test('the target of a relative move is where the axis goes', async ({ page, open, line }) => {
  await open('/axis/reference');
  await type(page, 'Distance', 2);
  for (const times of [1, 2]) {
    await page.getByRole('button', { name: 'Move +' }).click();
    await expect(page.getByText(/move: done/)).toBeVisible();
    await expect.poll(async () => Math.round((await line.call<View>('GET', '/axes/reference')).target_counts! / 131072)).toBe(2 * times);
  }
  const middle = async (path: string) => {
    const box = await page.locator(`.travel ${path}`).boundingBox();
    return box!.x + box!.width / 2;
  };
  await expect.poll(async () => Math.abs((await middle('path.target')) - (await middle('path.carriage')))).toBeLessThan(3);
});

test('the true position and 6064h have a name each', async ({ page, open, line }) => {
  await line.call('PUT', '/axes/reference/objects/607c/0', { value: 131072 });
  await open('/axis/reference?do=home');
  await choose(page, 'Method', /^35: /);
  await page.getByRole('button', { name: 'Home', exact: true }).click();
  await expect(page.getByText(/home: done/)).toBeVisible();
  const readout = (label: string) => panel(page, 'Motion').locator('.readout').filter({ hasText: label });
  await expect(readout('true position')).toContainText(/−?0\.00/);
  await expect(readout("drive's position (6064h)")).toContainText(/1\.00|0\.99/);
});

test('an address without such an axis or page says so', async ({ page, open }) => {
  await open('/axis/ismc');
  await page.goto(page.url().replace('/axis/ismc', '/axis/nope'));
  await expect(page.getByRole('alert')).toContainText('There is no axis "nope"');
  await page.getByRole('alert').getByRole('link', { name: 'ismc' }).click();
  await expect(panel(page, 'Motion')).toBeVisible();
  await page.goto(page.url().replace('/axis/ismc', '/nope'));
  await expect(page.getByRole('alert')).toContainText('There is no page "nope"');
});

test('an injected fault holds, which Clear fault says at once', async ({ page, open, line, excused }) => {
  excused.push(noPower);
  await withoutTimeouts(page);
  await line.call('POST', '/axes/reference/jobs', { do: 'enable' });
  await expect.poll(async () => (await line.call<View>('GET', '/axes/reference')).state).toBe('operation enabled');
  await line.call('POST', '/axes/reference/faults', { inject: 'encoder_loss' });
  await open('/');
  await card(page, 'reference').getByRole('button', { name: 'Clear fault' }).click();
  const notice = page.locator('.notice.bad');
  await expect(notice).toContainText('an injected fault holds: encoder_loss');
  await expect(notice).toContainText('remove the injected fault on the page "I/O and plant"');
  await expect(notice).not.toContainText('DELETE');
  expect(((await notice.textContent()) ?? '').split('remove the injected').length).toBe(2); // it is said once
  // No control lies below the notice, and it goes with the next command of the axis.
  const [box, below] = [await notice.boundingBox(), await page.locator('.page').boundingBox()];
  expect(box!.y).toBeGreaterThanOrEqual(below!.y + below!.height);
  await line.call('DELETE', '/axes/reference/faults');
  await card(page, 'reference').getByRole('button', { name: 'Clear fault' }).click();
  await expect(notice).toHaveCount(0);
  await expect(card(page, 'reference')).toContainText('switch on disabled');
  // A power cycle makes the notice, and the outcome of the job, out of date too.
  await line.call('POST', '/axes/reference/faults', { inject: 'encoder_loss' });
  await open('/axis/reference');
  await page.getByRole('button', { name: 'Clear fault' }).click();
  await expect(notice).toContainText('an injected fault holds');
  await expect(page.getByText(/reset fault: failed/)).toBeVisible();
  await page.getByRole('button', { name: 'Power cycle' }).click();
  await expect(notice).toHaveCount(0);
  await expect(page.getByText(/reset fault: failed/)).toHaveCount(0);
});

test('storing on a drive without a store command names what is lost', async ({ page, open, line }) => {
  await line.call('PUT', '/axes/pronet/objects/6083/0', { value: 77777 });
  await open('/objects/pronet?view=parameters');
  await page.getByRole('button', { name: 'Store in the drive' }).click();
  const report = panel(page, 'Parameters').locator('.report');
  await expect(report).toContainText('no store command');
  await report.getByText(/cannot store these changed values/).click();
  await expect(report).toContainText('6083:00');
});

test('a CAN identifier is shown in hexadecimal', async ({ page, open }) => {
  await open('/objects/reference?q=cob-id&object=1014:00');
  await expect(page.getByRole('option', { name: /^1014:00/ })).toContainText('00000082h');
});
