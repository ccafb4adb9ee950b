import { execFile } from 'node:child_process';
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import { fileURLToPath } from 'node:url';
import { promisify } from 'node:util';
import type { Page } from '@playwright/test';
import { choose, expect as shortly, panel, test as base, type } from './fixtures';
import { figures, identify, journalIsLogged, lineOf, moveInTime, next, products, torque, write } from './guide';
import { axes, Line } from './line';

const expect = shortly.configure({ timeout: 120_000 }); // a busy machine is slow, and not wrong

// The guided commissioning, in virtual time: it runs as fast as the machine can, with the same results on any machine.

const root = fileURLToPath(new URL('../..', import.meta.url));
const python = process.env.SERVODROME_PYTHON ?? join(root, '.venv/bin/python');

// pysoem needs a network interface: tools/with-veth has made a cable from servo0 to master0.
const cable = process.env.WITH_VETH === '1';

const test = base.extend<{ axis: string }>({
  axis: ['reference', { option: true }],
  line: async ({ axis }, use) => {
    // Ideal stages: with real ones the loop at small signals is slower than at a load, by a quarter on the reference drive.
    const text = lineOf(axis, 'virtual').replace('\nproduct = ', '\nideal = true\nproduct = ');
    const line = await new Line(text, ['can0=socketcand:127.0.0.1:0/can0', ...(cable ? ['ecat=raw:servo0'] : [])]).start();
    await line.call('PUT', '/clock', { speed: 10 });
    await use(line);
    await line.end();
  },
});

interface View {
  state: string;
  homed: boolean;
  mode: number;
  position_counts: number;
  velocity_rpm: number;
}

interface Job {
  id: number;
  do: string;
  state: string;
}

interface Stated {
  cycle: Record<string, number>;
  step: Record<string, number>;
}

async function inputs(page: Page) {
  await expect(page.getByRole('group', { name: 'Force DI0' })).toBeVisible();
  for (const row of await page.getByRole('group', { name: /^Force DI/ }).all()) {
    const seen = page.getByRole('row', { name: new RegExp(`^${(await row.getAttribute('aria-label'))!.slice(6)} `) }).getByRole('cell');
    await row.getByRole('button', { name: '0' }).click();
    await expect(seen.nth(2)).toHaveText('✓');
    await row.getByRole('button', { name: '1' }).click();
    await expect(seen.nth(3)).toHaveText('✓');
  }
}

const values = async (page: Page, row: RegExp) => (await figures(page).getByRole('row', { name: row }).getByRole('cell').allTextContents()).map(Number);

for (const { name, counts } of axes) {
  const { tunes, home, limits, gain } = products[name];
  test.describe(name, () => {
  test.use({ axis: name });
  const tag = name === 'pronet' ? [] : ['@all'];
  test(`takes ${name} from the factory to a tuned, homed, cycling axis`, { tag }, async ({ page, open, line, picture }) => {
    test.setTimeout(900_000);
    const factory = await line.call<{ differences: unknown[] }>('GET', `/axes/${name}/parameters/diff`);
    await open(`/commission/${name}`);
    await expect(panel(page, 'Find the drive')).toBeVisible();
    await next(page).click();
    await identify(page);
    await expect(panel(page, 'Units')).toBeVisible();
    await next(page).click();
    await inputs(page);
    await next(page).click();
    const forced = async () => Object.values((await line.call<{ inputs: Record<string, { forced: boolean }> }>('GET', `/axes/${name}/inputs`)).inputs).filter((input) => input.forced);
    await expect.poll(forced).toEqual([]);

    // Nothing is written before it was shown: the drive has its factory values up to here.
    expect((await line.call<{ differences: unknown[] }>('GET', `/axes/${name}/parameters/diff`)).differences).toEqual(factory.differences);
    await expect(page.getByRole('button', { name: 'Make the small move' })).toBeDisabled();
    await write(page);
    const moves = (button: string, seen: () => Promise<boolean>) => moveInTime(page, button, seen, () => Promise.resolve());
    await moves('Make the small move', () => page.getByRole('button', { name: 'The right way' }).isVisible());
    await page.getByRole('button', { name: 'The right way' }).click();
    await picture(`guide-direction-${name}`);
    await next(page).click();

    await torque(page);
    await moves('Measure a step', () => figures(page).isVisible());
    const [before] = await values(page, /^Rise time/);
    if (tunes === 'proposed') {
      await type(page, 'Target bandwidth (blank: at least 60 % of maximum)', name === 'ismk' ? 40 : 180);
      await moves('Measure the loop and propose gains', () => page.getByText('The proposed gains are in the form').isVisible());
      await write(page, 'Gains');
      await moves('Measure a step', async () => (await values(page, /^Rise time/))[2] < before);
      await moves('Measure the loop and propose gains', async () => (await values(page, /^Bandwidth/))[2] > 0);
      const [, predicted, after] = await values(page, /^Bandwidth/);
      expect(Math.abs(after / predicted - 1)).toBeLessThan(0.15);
    } else if (tunes === 'by hand') {
      const { objects } = await line.call<{ objects: { index: string; sub: number; name: string }[] }>('GET', `/axes/${name}/objects`);
      const [index, sub, value] = gain!;
      await type(page, objects.find((each) => each.index === index && each.sub === sub)!.name, value, panel(page, 'Velocity loop'));
      await write(page, 'Gains');
      await moves('Measure a step', async () => (await values(page, /^Rise time/))[2] < before);
    } else {
      await expect(page.getByText('documents no gains')).toBeVisible();
    }
    await picture(`guide-velocity-${name}`);
    await next(page).click();

    await write(page);
    await moves('Measure a move', () => figures(page).isVisible());
    if (tunes === 'proposed') {
      await write(page, 'Gains');
      await moves('Measure a move', async () => (await values(page, /^Greatest following error/))[2] > 0);
      // The iSMK's gain for 40 Hz is lower than the factory's, that of the reference drive is higher.
      const [first, , last] = await values(page, /^Greatest following error/);
      expect(Math.sign(last - first)).toBe(name === 'ismk' ? 1 : -1);
    }
    await picture(`guide-position-${name}`);
    await next(page).click();

    await choose(page, /Method/, home);
    await write(page);
    await moves('Home', () => page.getByText('✓ The drive reports home').isVisible());
    expect((await line.call<View>('GET', `/axes/${name}`)).homed).toBe(true);
    await picture(`guide-homing-${name}`);
    await next(page).click();

    await expect(panel(page, 'Soft limits')).toBeVisible();
    if (limits) {
      await expect(next(page)).toBeDisabled();
      await write(page);
      await picture(`guide-limits-${name}`);
      await next(page).click();
    } else {
      await expect(page.getByText('has no object 607Dh')).toBeVisible();
      await page.getByRole('button', { name: 'Skip' }).click();
    }

    await type(page, 'Cycles', 2);
    await write(page);
    await moves('There and back', () => page.getByText('✓ The axis is back where it began').isVisible());
    await picture(`guide-cycle-${name}`);
    const jobs = (await line.call<{ jobs: (Job & { axis: string })[] }>('GET', '/jobs')).jobs.filter((job) => job.axis === name).slice(-5);
    expect(jobs.map((job) => `${job.do} ${job.state}`)).toEqual(['enable done', ...Array<string>(4).fill('move done')]);
    await next(page).click();
    await page.getByRole('button', { name: 'Disable' }).click();
    await page.getByText('Store the present values of the drive').click();
    await page.getByRole('button', { name: 'Store in the drive' }).click();
    await next(page).click();

    const saving = page.waitForEvent('download');
    await page.getByRole('button', { name: 'Save as a file' }).click();
    const file = await (await saving).path();
    const text = readFileSync(file, 'utf8');
    expect(text).toContain(`Commissioning of ${name}`);
    expect(text).toContain('<svg');
    expect(text).toContain(name === 'ismk' ? 'No switch is wired to this drive.' : 'Every wired input was seen at both levels.');
    expect(text).toContain('The drive has the limit.');
    if (limits) expect(text).toContain('The drive has the limits.');
    const stated = JSON.parse(/id="stated">(.*?)<\/script>/s.exec(text)![1]) as Stated;
    expect(stated.cycle.by).toBe(2 * (name === 'ismk' ? 65536 : counts));
    await picture(`guide-report-${name}`);
    // "Print or save as PDF": the report alone, on its pages.
    await page.emulateMedia({ media: 'print' });
    await expect(page.getByRole('button', { name: 'Save as a file' })).toBeHidden();
    await expect(page.getByRole('button', { name: 'STOP' })).toBeHidden();
    await expect(page.locator('.paper svg').first()).toBeVisible();
    await page.emulateMedia({ media: null });
    const pdf = (await page.pdf({ preferCSSPageSize: true })).toString('latin1');
    expect(pdf.slice(0, 5)).toBe('%PDF-');
    expect(pdf.match(/\/Type \/Page\b(?!s)/g)!.length).toBeGreaterThan(1);
    expect(pdf).toMatch(/\/MediaBox \[0 0 59[0-9.]+ 84[0-9.]+\]/); // A4

    // Another maker's master finds on the bus what the report states.
    if (name === 'jmc' && !cable) {
      test.info().annotations.push({ type: 'not measured', description: 'by pysoem: tools/with-veth cannot make a network interface here' });
      return;
    }
    const master = name === 'jmc' ? ['--ethercat', 'master0'] : ['--can', line.linkOf('can0').replace('socketcand:', ''), '--node', String(axes.findIndex((each) => each.name === name) + 1)];
    const measured = await promisify(execFile)(python, [join(root, 'tests/studio/measure_step.py'), file, '--api', `${line.address}/api/v1`, ...master]).catch((error: unknown) => error as { stdout: string; stderr: string });
    expect(measured.stderr).toBe('');
    expect((JSON.parse(measured.stdout) as { failures: string[] }).failures).toEqual([]);

    await journalIsLogged(page, line, name);
    if (name !== 'reference') return;
    // All of it is undone, after what the other master has changed.
    await line.call('POST', '/changes/undo', { axis: name, who: 'SDO on can0' });
    const journal = page.getByRole('region', { name: 'Written by the guide' });
    await expect.poll(async () => (await line.call<View>('GET', `/axes/${name}`)).state).not.toBe('operation enabled');
    await journal.getByRole('button', { name: 'Undo all' }).click();
    await journal.getByRole('button', { name: 'Undo all of them' }).click();
    // The mode that the other master has set stays.
    await expect(page.locator('.notice.bad').filter({ hasText: '6060:00 was changed by another and stays' })).toBeVisible();
    await expect(journal.getByRole('row')).toHaveCount(2); // with the header
    await journal.getByRole('button', { name: 'Take 6060:00 out of the list' }).click();
    await expect(journal).toHaveCount(0);
    expect((await line.call<{ differences: unknown[] }>('GET', `/axes/${name}/parameters/diff`)).differences).toEqual(factory.differences);
  });
  });
}
