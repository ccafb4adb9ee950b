import type { Page } from '@playwright/test';
import { expect as shortly, noPower, panel, test as base, type } from './fixtures';
import { lineOf, write } from './guide';
import { Line } from './line';

const expect = shortly.configure({ timeout: 60_000 }); // a busy machine is slow, and not wrong

// What the guide refuses, and why, before anything is written or moves.

const test = base.extend<{ axis: string }>({
  axis: ['reference', { option: true }],
  line: async ({ axis }, use) => {
    const line = await new Line(lineOf(axis, 'virtual')).start();
    await line.call('PUT', '/clock', { speed: 5 });
    await use(line);
    await line.end();
  },
});

const path = '/axes/reference';
const value = async (line: Line, object: string) => (await line.call<{ value: number }>('GET', `${path}/objects/${object}`)).value;
const done = (page: Page) => page.getByRole('button', { name: 'Done, next step' });

test('soft limits in the wrong order or beyond the switches are not written', async ({ page, open, line }) => {
  await open('/commission/reference?step=limits');
  const step = panel(page, 'Soft limits');
  const button = page.getByRole('button', { name: 'Write these 2 values' });
  await expect(button).toBeEnabled();
  await type(page, 'Lowest position', 8);
  await type(page, 'Highest position', -8);
  await expect(button).toBeDisabled();
  await expect(step.locator('.guide-plan').getByRole('alert')).toHaveText('The lowest position must be below the highest.');
  await type(page, 'Lowest position', -10.5);
  await type(page, 'Highest position', 9);
  await expect(step.locator('.guide-plan').getByRole('alert')).toHaveText('The lowest position, −10.5 rev, lies beyond the negative limit switch at −10 rev: choose one inside.');
  await expect(button).toBeDisabled();
  await type(page, 'Highest position', 20000);
  await expect(step).toContainText('At most 16383.99999 rev (607D:02).');
  await expect(button).toBeDisabled();
  expect([await value(line, '607d/1'), await value(line, '607d/2')]).toEqual([0, 0]);
  // The drive has such limits from elsewhere: the step is not complete.
  await line.call('PUT', `${path}/objects/607d/1`, { value: -10.5 * 131072 });
  await line.call('PUT', `${path}/objects/607d/2`, { value: 9 * 131072 });
  await type(page, 'Highest position', 9);
  await expect(step.locator('.guide-check')).toContainText('lies beyond the negative limit switch');
  await expect(done(page)).toBeDisabled();
  await type(page, 'Lowest position', -9);
  await expect(page.getByRole('button', { name: 'Write this value' })).toBeEnabled(); // the page has seen the other value
  await write(page);
  await expect(step.locator('.guide-check')).toHaveText('✓ The drive has the limits.');
});

test('a move that does not show the direction is refused', async ({ page, open, line }) => {
  await open('/commission/reference?step=direction');
  await write(page);
  const step = panel(page, 'Direction and encoder');
  await type(page, 'Distance', 0);
  await expect(step).toContainText('At least 0.05 rev, forward or back: a smaller move does not show the direction.');
  await expect(page.getByRole('button', { name: 'Make the small move' })).toBeDisabled();
  await type(page, 'Distance', -0.05);
  await page.getByRole('button', { name: 'Make the small move' }).click();
  await page.getByRole('button', { name: 'The right way' }).click();
  await expect(step.locator('.guide-check')).toHaveText('✓ 6064h moved by the distance, and the machine moved the right way.');
  expect((await line.call<{ position_counts: number }>('GET', path)).position_counts).toBeLessThan(-6000);
});

test('the report is complete when it is saved, and its differences are those after an undo', async ({ page, open }) => {
  await open('/commission/reference?step=cycle');
  await write(page);
  await page.getByRole('link', { name: /Report/ }).click();
  const check = panel(page, 'Report').locator('.guide-check');
  const finish = page.getByRole('button', { name: 'Done', exact: true });
  const different = page.getByRole('table', { name: 'Differences from the factory values' });
  await expect(different.getByRole('row', { name: /6081:00/ })).toBeVisible();
  await expect(check).toContainText('The report is not saved yet');
  await expect(finish).toBeDisabled();
  const saving = page.waitForEvent('download');
  await page.getByRole('button', { name: 'Save as a file' }).click();
  await saving;
  await expect(check).toHaveText("✓ The report is saved with the machine's papers.");
  await expect(finish).toBeEnabled();
  const journal = page.getByRole('region', { name: 'Written by the guide' });
  await journal.getByRole('button', { name: 'Undo all' }).click();
  await journal.getByRole('button', { name: 'Undo all of them' }).click();
  await expect(different).toHaveCount(0);
  await expect(panel(page, 'Report')).toContainText('None.');
  // The file is from before the undo.
  await expect(check).toContainText('The report is not saved yet');
  await page.getByText("The report is saved with the machine's papers", { exact: true }).click();
  await expect(finish).toBeEnabled();
});

for (const [axis, step] of [['pronet', 'direction'], ['reference', 'homing']]) test.describe(`${axis}, ${step}`, () => {
  test.use({ axis, viewport: { width: 390, height: 844 } });
  test('a narrow page shows the old and the new values whole', async ({ page, open, picture }) => {
    await open(`/commission/${axis}?step=${step}`);
    const table = page.locator('.guide-plan table');
    await expect(table).toBeVisible();
    await expect(page.getByRole('table', { name: 'Values to write' }).getByRole('row')).not.toHaveCount(0);
    for (const cell of await table.locator('tbody > tr > *').all()) {
      const hidden = await cell.evaluate((each) => {
        const range = document.createRange();
        range.selectNodeContents(each);
        const [text, box] = [range.getBoundingClientRect(), each.closest('.scroll')!.getBoundingClientRect()];
        return text.width > 0 && (text.left < box.left - 1 || text.right > box.right + 1);
      });
      expect(hidden, await cell.textContent() ?? '').toBe(false);
    }
    await table.scrollIntoViewIfNeeded();
    await picture(`plan-narrow-${axis}`);
  });
});

test('the message about the power goes when the axis has power', async ({ page, open, line, excused }) => {
  excused.push(noPower);
  await open('/commission/reference?step=cycle');
  await type(page, 'Distance', 8);
  await write(page);
  await page.getByRole('button', { name: 'There and back' }).click();
  await expect.poll(async () => (await line.call<{ velocity_rpm: number }>('GET', path)).velocity_rpm, { intervals: [50] }).toBeGreaterThan(10);
  await line.call('PUT', '/clock', { speed: 0 }); // the move does not end before the power goes
  await line.call('POST', `${path}/power`, { action: 'off' });
  await line.call('PUT', '/clock', { speed: 5 });
  const trouble = page.getByRole('group', { name: 'There and back' }).locator('.trouble').filter({ hasText: 'has no power' });
  await expect(trouble).toBeVisible();
  await line.call('POST', `${path}/power`, { action: 'on' });
  await expect(trouble).toHaveCount(0);
  await page.reload();
  await expect(page.getByRole('button', { name: 'There and back' })).toBeVisible();
  await expect(trouble).toHaveCount(0);
});

test('a step is not done while a number is refused, and refusals have its units', async ({ page, open, line }) => {
  await open('/commission/reference?step=units');
  const units = panel(page, 'Units');
  for (const text of ['-5', '', 'abc', '1,500']) {
    await units.getByRole('textbox', { name: 'Gear: revolutions of the motor' }).fill(text);
    await expect(units.locator('.guide-check')).toHaveText('A number of the form is refused: correct it.');
    await expect(done(page)).toBeDisabled();
  }
  await type(page, 'Gear: revolutions of the motor', 2);
  await expect(done(page)).toBeEnabled();
  await page.getByRole('button', { name: 'Machine' }).click();
  await page.getByRole('option', { name: 'Spindle, in mm' }).click();
  await page.getByRole('link', { name: /First cycle/ }).click();
  await type(page, 'Distance', 100); // 20 revolutions of the motor, 10 to the switch
  await expect(page.getByRole('group', { name: 'There and back' })).toContainText('The move of 100 mm is longer than the 50 mm to the positive limit switch.');
  await type(page, 'Cycles', 1.5);
  await expect(panel(page, 'First cycle')).toContainText('A whole number.');
  await line.call('POST', '/stop');
});
