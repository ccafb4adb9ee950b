import { card, expect, noPower, panel, test } from './fixtures';
import { lineFile } from './line';

// The place of things on the page: what the drives do moves no button.

test('a fault, a move and an axis without power leave the cards as they are', async ({ page, open, line, excused }) => {
  excused.push(noPower);
  await page.setViewportSize({ width: 1366, height: 768 });
  await open('/');
  await expect(card(page, 'jmc')).toContainText('switch on disabled');
  const places = () => page.locator('.card').evaluateAll((cards) => cards.map((each) => [each.getBoundingClientRect().top, each.getBoundingClientRect().height]));
  const before = await places();
  await line.call('POST', '/axes/ismk/jobs', { do: 'enable' });
  await line.call('POST', '/axes/pronet/faults', { inject: 'encoder_loss' });
  await line.call('POST', '/axes/jmc/power', { action: 'off' });
  await expect(card(page, 'ismk')).toContainText('operation enabled');
  await expect(card(page, 'pronet').getByRole('link', { name: /encoder/ })).toBeVisible();
  await expect(card(page, 'jmc')).toContainText('no power');
  await expect(card(page, 'jmc')).toContainText('true position'); // the plant has it without power as well
  expect(await places()).toEqual(before);
});

test('the axis is drawn only when its travel is known', async ({ page, open }) => {
  let answer = () => {};
  const asked = new Promise<void>((resolve) => (answer = resolve));
  await page.route('**/axes/reference/geometry', async (route) => {
    await asked;
    await route.continue();
  });
  await open('/axis/reference');
  await expect(page.getByText('switch on disabled').first()).toBeVisible();
  await expect(panel(page, 'Motion').locator('.travel')).toBeVisible();
  await expect(panel(page, 'Motion').locator('.travel .carriage')).toHaveCount(0);
  answer();
  await expect(panel(page, 'Motion').locator('.travel .carriage')).toBeVisible();
});

test('the button of a dashboard is as high as its texts', async ({ page, open }) => {
  await page.addInitScript(() => localStorage.setItem('servodrome.boards', JSON.stringify([{ name: 'Bench', widgets: [{ kind: 'button', title: 'On', span: 1, axis: 'reference', do: 'enable' }] }])));
  await open('/boards');
  await panel(page, 'On').getByRole('button', { name: 'On' }).click();
  await expect(panel(page, 'On')).toContainText('operation enabled');
  expect((await panel(page, 'On').boundingBox())!.height).toBeLessThan(150);
});

test.describe('a line in virtual time', () => {
  test.use({ lineText: lineFile('virtual') });

  test('on a telephone STOP is in the first row, beside the other controls of the page', async ({ page, open, line }) => {
    await page.setViewportSize({ width: 390, height: 844 });
    await line.call('POST', '/clock/advance', { ms: 60_000 });
    await open('/');
    await expect(page.getByRole('button', { name: '+100 ms' })).toBeVisible();
    const top = async (name: string) => (await page.getByRole('button', { name, exact: true }).boundingBox())!;
    const [stop, help] = [await top('STOP'), await top('Help')];
    expect(stop.x).toBeGreaterThan(help.x);
    expect(stop.y).toBeLessThan(help.y + help.height);
    expect(stop.y).toBeLessThan(20);
    expect(stop.x + stop.width).toBeGreaterThan(370);
    await expect(page.getByRole('button', { name: '+100 ms' })).toBeInViewport({ ratio: 1 });
  });
});
