import { accessible } from './accessible';
import { expect as shortly, panel, test } from './fixtures';

const expect = shortly.configure({ timeout: 120_000 }); // a busy machine is slow, and not wrong

test('a bit, a state and an object are explained on hover, on keyboard focus, and Escape hides it', async ({ page, open, picture }) => {
  await open('/axis/ismk');
  const tip = page.getByRole('tooltip');
  const bits = panel(page, 'Words').getByRole('list', { name: 'Bits of the statusword' }).getByRole('listitem');
  await bits.filter({ hasText: 'fault' }).hover();
  await expect(tip).toContainText('Fault or Fault reaction active');
  await expect(tip).toContainText('6041h; iSMK integrated servo user manual');
  await page.keyboard.press('Escape');
  await expect(tip).toHaveCount(0);

  // One tab stop for the word; the arrows go from bit to bit.
  await bits.first().focus();
  await page.keyboard.press('ArrowDown');
  await page.keyboard.press('ArrowUp');
  await expect(tip).toContainText('Bit 15');
  await expect(bits.first()).toHaveAttribute('aria-describedby', 'tip');
  await page.keyboard.press('ArrowDown');
  await expect(tip).toContainText('Bit 14');
  await accessible(page, 'with an explanation');
  await picture('tip-bit');
  await panel(page, 'State machine').locator('.place').filter({ hasText: 'quick stop active' }).hover();
  await expect(tip).toContainText('605Ah');

  await open('/objects/ismk?q=6081');
  await page.getByRole('option', { name: /^6081:00/ }).hover();
  await expect(tip).toContainText('CiA 402-2 (IEC 61800-7-201), 6081h');
  await page.mouse.move(0, 0);
  await expect(tip).toHaveCount(0);
  await page.getByRole('listbox', { name: 'Objects' }).focus();
  await page.keyboard.press('ArrowDown');
  await expect(tip).toContainText('6081');
});

test('the chip of a state says what the state is on this product, on every page', async ({ page, open, line }) => {
  for (const value of [6, 7]) await line.call('PUT', '/axes/jmc/objects/6040/0', { value });
  for (const [path, count] of [['/', 1], ['/axis/jmc', 1], ['/commission/jmc?step=find', 2]] as const) {
    await open(path);
    const chips = page.locator('.chip[data-tip]', { hasText: /^switched on$/ });
    await expect(chips).toHaveCount(count);
    for (const chip of await chips.all()) await expect(chip).toHaveAttribute('data-tip', /the motor holds its position[^]*JMC/);
  }
});

test.describe('on a touch screen', () => {
  test.use({ hasTouch: true, viewport: { width: 390, height: 844 } });

  test('a tap explains a bit, another one elsewhere hides it', async ({ page, open }) => {
    await open('/axis/reference');
    await panel(page, 'Words').getByRole('list', { name: 'Bits of the controlword' }).getByRole('listitem').filter({ hasText: 'halt' }).tap();
    await expect(page.getByRole('tooltip')).toContainText('605Dh');
    const box = (await page.getByRole('tooltip').boundingBox())!;
    expect(box.x).toBeGreaterThanOrEqual(0);
    expect(box.x + box.width).toBeLessThanOrEqual(390);
    await panel(page, 'Words').getByRole('heading', { name: 'Words' }).tap();
    await expect(page.getByRole('tooltip')).toHaveCount(0);
  });
});

test('the tour goes over the page once, and again from the menu', async ({ line, browser }) => {
  const page = await (await browser.newContext()).newPage();
  await page.goto(line.address);
  const tour = page.getByRole('complementary', { name: 'Tour of the page' });
  await expect(tour).toContainText('1 of 7');
  const stop = page.getByRole('button', { name: 'STOP', exact: true });
  await tour.getByRole('button', { name: 'Next' }).click();
  await expect(stop).toHaveClass(/tour-here/);
  await accessible(page, 'with the tour');
  for (let i = 3; i <= 7; ++i) {
    await tour.getByRole('button', { name: 'Next' }).click();
    await expect(tour).toContainText(`${i} of 7`);
  }
  await tour.getByRole('button', { name: 'End the tour' }).click();
  await page.reload();
  await expect(page.getByRole('article').first()).toBeVisible();
  await expect(tour).toHaveCount(0);
  await page.getByRole('button', { name: 'Help' }).click();
  await page.getByRole('menuitem', { name: 'Tour of the page' }).click();
  await expect(tour).toContainText('1 of 7');
  await tour.getByRole('button', { name: 'No tour' }).click();
  await page.goto(`${line.address}/axis/reference`);
  await expect(panel(page, 'Motion')).toBeVisible();
  await expect(tour).toHaveCount(0);
});
