import { accessible } from './accessible';
import { expect, test } from './fixtures';

// Every page, in every look: opens, has no serious accessibility violation, no error, no request outside, and fits.

const pages: Record<string, string> = {
  line: '/', axis: '/axis/reference', homing: '/axis/ismc?do=home', scope: '/scope', boards: '/boards', faults: '/faults/reference', misbehaviour: '/misbehaviour/reference', objects: '/objects/reference',
  plant: '/plant/reference', bus: '/bus', traffic: '/bus/traffic?bus=can0', parameters: '/objects/reference?view=parameters', pdos: '/objects/reference?view=pdos', changes: '/objects/reference?view=changes', tuning: '/tuning/ismk',
};

for (const [name, path] of Object.entries(pages)) {
  test(`${name} in every size and colour`, async ({ page, open, picture }) => {
    test.setTimeout(300_000); // six runs of axe, which a busy machine does slowly
    await open(path);
    await expect(page.locator('main')).not.toHaveText('');
    await page.waitForTimeout(500); // what comes over the stream is there as well
    for (const [width, height] of [[1366, 768], [1920, 1080], [390, 844]]) {
      await page.setViewportSize({ width, height });
      await expect(page.getByRole('button', { name: 'STOP', exact: true })).toBeInViewport({ ratio: 1 });
      await expect(page.locator('.top nav [aria-current]')).toBeInViewport({ ratio: 0.99 });
      if (width > 1000) await expect(page.locator('.top nav').getByRole('link', { name: 'Bus' })).toBeInViewport({ ratio: 1 });
      const overhang = await page.evaluate(() => Math.max(...[document.documentElement, document.querySelector('.page')!].map(({ scrollWidth, clientWidth }) => scrollWidth - clientWidth)));
      expect(overhang).toBeLessThanOrEqual(0);
      for (const colorScheme of ['light', 'dark'] as const) {
        await page.emulateMedia({ colorScheme });
        await accessible(page, `${colorScheme}, ${width} px`);
        await picture(`${name}-${colorScheme}-${width}`);
      }
    }
  });
}

test('controls are not drawn anew each time that an axis moves', async ({ page, open, line }) => {
  await line.call('POST', '/axes/reference/jobs', { do: 'enable' });
  const metrics = await page.context().newCDPSession(page);
  await metrics.send('Performance.enable');
  const script = async () => (await metrics.send('Performance.getMetrics')).metrics.find(({ name }) => name === 'ScriptDuration')!.value;
  const costs = async (path: string) => {
    await open(path);
    await page.waitForTimeout(2000);
    const before = await script();
    await page.waitForTimeout(4000);
    return (await script()) - before;
  };
  // Against the page that draws every axis 20 times a second, on the same machine: it was 20 times as much.
  const line_page = await costs('/');
  expect(await costs('/plant/reference')).toBeLessThan(5 * line_page);
});

test('the keyboard reaches every page, and stops the line', async ({ page, open }) => {
  await open('/');
  await page.keyboard.press('Tab');
  await expect(page.getByText('Skip to the content')).toBeFocused();
  await page.getByRole('link', { name: 'Axis', exact: true }).focus();
  await page.keyboard.press('Enter');
  await expect(page).toHaveURL(/\/axis\//);
  await page.keyboard.press('Control+Space');
  await expect(page.getByText('all axes stopped')).toBeVisible();
});

test('the choice of colours survives a reload', async ({ page, open }) => {
  await page.emulateMedia({ colorScheme: 'light' });
  await open('/');
  const ground = () => page.evaluate(() => getComputedStyle(document.body).backgroundColor);
  const light = await ground();
  await page.getByRole('button', { name: 'Colours' }).click();
  await page.getByRole('option', { name: 'Dark' }).click();
  await expect.poll(ground).not.toBe(light);
  const dark = await ground();
  await page.reload();
  await expect.poll(ground).toBe(dark);
});
