import { readFileSync } from 'node:fs';
import { inEveryLook, slow_ms } from './accessible';
import { choose, expect as shortly, panel, test as base, type, watch } from './fixtures';
import { figures, identify, journalIsLogged, lineOf, moveInTime, next, products, torque, write } from './guide';
import { axes, Line, Studio } from './line';

const expect = shortly.configure({ timeout: 120_000 }); // a busy machine is slow, and not wrong

// The guided commissioning of drives on buses, as of real ones: the studio reaches the drive only by its bus, knows neither
// shaft nor wiring, and everything is in real time. What the drive really did is asked of its line, in another process.

const test = base.extend<{ axis: string; drives: Line; studio: Studio }>({
  axis: ['reference', { option: true }],
  drives: async ({ axis }, use) => {
    const line = await new Line(lineOf(axis, 'real'), ['can0=socketcand:127.0.0.1:0/can0', 'ecat=udp:127.0.0.1:0']).start();
    if (axis === 'jmc') await line.waitForSlowMaster();
    await use(line);
    await line.end();
  },
  studio: async ({ axis, drives }, use) => {
    const studio = await new Studio([axis === 'jmc' ? drives.linkOf('ecat') : `${drives.linkOf('can0')}=${axes.findIndex((each) => each.name === axis) + 1}`]).start();
    await use(studio);
    await studio.end();
  },
  line: async ({ drives }, use) => use(drives),
  watched: async ({ page, studio }, use) => {
    const found: string[] = [];
    watch(page, studio, found);
    await page.addInitScript(() => {
      if (location.protocol.startsWith('http')) localStorage.setItem('servodrome.tour', 'over');
    });
    await use(found);
    expect(found).toEqual([]);
  },
});

interface View {
  state: string;
  homed: boolean;
  velocity_rpm: number;
  position_counts: number;
}

interface Inputs {
  inputs: Record<string, { level: boolean }>;
}

for (const { name, counts } of axes) {
  const { limits, home, unitsUnknown, gain, bits, input } = products[name];
  test.describe(name, () => {
    test.use({ axis: name });
    const tag = ['ismk', 'jmc'].includes(name) ? [] : ['@all'];
    test(`takes ${name} from the factory to a homed, cycling axis over its bus`, { tag }, async ({ page, drives, studio, watched, picture }) => {
      test.setTimeout(600_000);
      const onBus = (await studio.call<{ axes: { name: string }[] }>('GET', '/axes')).axes.map((each) => each.name);
      expect(onBus).toHaveLength(1);
      const truth = () => drives.call<View>('GET', `/axes/${name}`);
      const changed = async () => (await drives.call<{ differences: { object: string }[] }>('GET', `/axes/${name}/parameters/diff`)).differences.map(({ object }) => object);
      const factory = await changed();
      const place = async () => (await truth()).position_counts;
      const began = await place();

      await page.goto(`${studio.address}/commission/${onBus[0]}`);
      await expect(panel(page, 'Find the drive')).toBeVisible();
      // The studio scans only while it knows that no axis has torque; on a busy machine it may have to wait for that.
      await expect(async () => {
        await page.getByRole('button', { name: /^Scan / }).click();
        await shortly(page.getByText('1 device answers.')).toBeVisible({ timeout: 5000 });
      }).toPass({ timeout: 120_000 });
      for (const message of watched.splice(0)) expect(message).toMatch(/409/);
      await next(page).click();
      await identify(page);
      await expect(panel(page, 'Units')).toBeVisible();
      if (unitsUnknown) await type(page, 'Units of 6064h per motor revolution', counts);
      await next(page).click();

      // A person presses each switch of the machine, and marks the inputs that have none.
      const table = page.getByRole('table', { name: 'Inputs of the drive' });
      await expect(table.getByRole('row')).not.toHaveCount(1);
      expect(await changed()).toEqual(factory); // nothing has been written
      if (input) {
        const [field, option, object, value] = input;
        await choose(page, new RegExp(field), option);
        await write(page);
        expect((await drives.call<{ value: number }>('GET', `/axes/${name}/objects/${object.replace(':', '/')}`)).value).toBe(value);
      }
      const rows = await table.getByRole('rowheader').allTextContents();
      expect(rows).toEqual(expect.arrayContaining(Object.keys(bits)));
      for (const bit of rows) {
        await expect(next(page)).toBeDisabled();
        const row = table.getByRole('row', { name: new RegExp(`^${bit} `) });
        const terminal = bits[bit] as string | undefined;
        if (terminal === undefined) {
          await row.getByText('not wired').click();
          continue;
        }
        const { level } = (await drives.call<Inputs>('GET', `/axes/${name}/inputs`)).inputs[terminal];
        for (const to of [!level, level]) {
          await drives.call('PUT', `/axes/${name}/inputs`, { [terminal]: to });
          await expect(row.getByRole('img', { name: to ? 'on' : 'off' })).toBeVisible();
        }
        await drives.call('PUT', `/axes/${name}/inputs`, { [terminal]: null });
        await expect(row.getByText('✓')).toHaveCount(2);
      }
      await expect(page.getByText('✓ Every wired input was seen at both levels.')).toBeVisible();
      await picture(`guide-real-inputs-${name}`);
      await next(page).click();

      // Nothing has moved.
      expect(Math.abs((await place()) - began)).toBeLessThan(counts / 100);
      await write(page);
      const rightWay = page.getByRole('button', { name: 'The right way' });
      const from = await moveInTime(page, 'Make the small move', () => rightWay.isVisible(), place);
      await rightWay.click();
      expect(Math.abs((await place()) - from - 0.1 * counts)).toBeLessThan(counts / 100);
      await picture(`guide-real-direction-${name}`);
      await next(page).click();

      await torque(page);
      await type(page, 'Duration of the step', 0.5);
      await moveInTime(page, 'Measure a step', () => page.getByText('✓ A step is measured').isVisible(), place); // with a rise time only if enough samples came
      // Its gains are parameters that no object on the bus shows.
      if (gain) await expect(page.getByText('The gains of jmc_ec are no objects on its bus')).toBeVisible();
      await next(page).click();

      await write(page);
      await moveInTime(page, 'Measure a move', () => figures(page).isVisible(), place);
      await picture(`guide-real-position-${name}`);
      await next(page).click();

      await choose(page, /Method/, home);
      await expect(page.getByRole('img', { name: /^Homing method \d+, not to scale: \w+ until/ })).toBeVisible();
      await write(page);
      await moveInTime(page, 'Home', () => page.getByText('✓ The drive reports home').isVisible(), place);
      expect((await truth()).homed).toBe(true);
      await next(page).click();

      await expect(panel(page, 'Soft limits')).toBeVisible();
      if (limits) {
        await expect(page.getByText('Not entered yet: Lowest position.')).toBeVisible();
        await expect(next(page)).toBeDisabled();
        await type(page, 'Lowest position', -8);
        await type(page, 'Highest position', 8);
        await write(page);
        await next(page).click();
      } else {
        await page.getByRole('button', { name: 'Skip' }).click();
      }

      await type(page, 'Cycles', 2);
      await write(page);
      const start = await moveInTime(page, 'There and back', () => page.getByText('✓ The axis is back where it began').isVisible(), place);
      expect(Math.abs((await place()) - start)).toBeLessThan(counts / 100);
      expect((await truth()).velocity_rpm).toBeLessThan(1);
      await picture(`guide-real-cycle-${name}`);
      await next(page).click();

      await page.getByRole('button', { name: 'Disable' }).click();
      await expect.poll(async () => (await truth()).state).not.toBe('operation enabled');
      await page.getByText('Store the present values of the drive').click();
      await page.getByRole('button', { name: 'Store in the drive' }).click();
      await next(page).click();

      const saving = page.waitForEvent('download');
      await page.getByRole('button', { name: 'Save as a file' }).click();
      const text = readFileSync(await (await saving).path(), 'utf8');
      expect(text).toContain(`Commissioning of ${onBus[0]}`);
      expect(text).toContain('<svg');
      for (const bit of rows) expect(text).toContain(`<th scope="row">${bit}</th><td>${bit in bits ? '</td><td>yes' : 'not wired'}</td>`);
      expect(text).toContain('The drive has the limit.');
      if (limits) expect(text).toContain('The drive has the limits.');
      const { journal } = await page.evaluate((key) => JSON.parse(localStorage.getItem(key)!) as { journal: { object: string; after: number }[] }, `servodrome.guide.${onBus[0]}`);
      for (const { object, after } of journal) {
        expect(text).toMatch(new RegExp(`<th scope="row">${object}</th>.*?<td class="figure">${after}</td>`));
      }
      await journalIsLogged(page, studio, onBus[0]);
    });
  });
}

test.describe('a drive on a bus', () => {
  test.use({ axis: 'jmc' });
  test('its inputs and the schematic of its homing in every size and colour', async ({ page, studio, picture }) => {
    test.setTimeout(2 * slow_ms);
    const [{ name }] = (await studio.call<{ axes: { name: string }[] }>('GET', '/axes')).axes;
    for (const [step, shown] of [['inputs', page.getByRole('table', { name: 'Inputs of the drive' })], ['homing', page.getByRole('img', { name: /not to scale/ })]] as const) {
      await page.goto(`${studio.address}/commission/${name}?step=${step}`);
      await expect(shown).toBeVisible();
      await inEveryLook(page, `guide-real-${step}`, picture);
    }
  });
});
