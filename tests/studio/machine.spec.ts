import type { Locator, Page } from '@playwright/test';
import { accessible } from './accessible';
import { card, choose, expect, test } from './fixtures';

// The machine on the page of the line: mechanics, legend, and the rows of a large line.

const axis = (name: string, more: string) => `[[axis]]\nname = "${name}"\nproduct = "generic402"\nbus = "can0"\nnode = ${name.length}\n${more}\n`;
const mechanics =
  'clock = "virtual"\n[[bus]]\nname = "can0"\n' +
  axis('x', '[axis.travel]\nlow_stop = -200000\nhigh_stop = 200000\n[axis.load]\ngravity_torque_nm = 0.1') +
  axis('tu', '') +
  axis('arm', '[axis.load]\narm_torque_nm = 0.2\ncycle_revolutions = 50\ncycle_offset_turns = 0.25') +
  axis('slid', '[axis.load]\ncrank_torque_nm = 0.1\ncrank_ratio = 0.25\ncycle_revolutions = 10\nelastic = true');

test.describe('the mechanics of the line file', () => {
  test.use({ lineText: mechanics });
  test('are drawn and named', async ({ page, open, picture }) => {
    await open('/');
    await expect(card(page, 'x')).toContainText('linear, hanging load');
    await expect(card(page, 'x').getByRole('img', { name: /^x is at 0.00 rev/ })).toBeVisible();
    await expect(card(page, 'x').locator('.dial')).toHaveCount(0); // its travel only
    await expect(card(page, 'tu').getByRole('img', { name: 'rotary, at 0°' })).toBeVisible();
    await expect(card(page, 'arm').getByRole('img', { name: 'arm, at 90°' })).toBeVisible();
    await expect(card(page, 'slid').getByRole('img', { name: 'crank, elastic coupling, at 0°' })).toBeVisible();
    await page.getByText('Legend').click();
    await expect(page.getByText('limit switch is active')).toBeVisible();
    await accessible(page);
    await picture('machine');
  });
  test('follow the motion', async ({ page, open, line }) => {
    await open('/');
    // A quarter of a motor turn; a tenth of the crank's.
    await line.call('PUT', '/axes/tu/plant', { position_counts: 32768 });
    await line.call('PUT', '/axes/slid/plant', { position_counts: 131072 });
    await line.call('POST', '/clock/advance', { ms: 20 });
    // In this time the weight of the slider turns the crank a little.
    await expect(card(page, 'tu').getByRole('img', { name: 'rotary, at 90°' })).toBeVisible();
    await expect(card(page, 'slid').getByRole('img', { name: /^crank, elastic coupling, at 3[56]°$/ })).toBeVisible();
  });
});

const sixteen = `clock = "real"\n[[bus]]\nname = "can0"\n${Array.from({ length: 16 }, (_, i) => `[[axis]]\nname = "axis-${i + 1}"\nproduct = "generic402"\nbus = "can0"\nnode = ${i + 1}\n`).join('')}`;

test.describe('a line of 16 axes on a telephone', () => {
  test.use({ lineText: sixteen, viewport: { width: 390, height: 844 } });
  test('has the state, the fault and the commands of each axis in its row', async ({ page, open, line, picture }) => {
    const row = (name: string) => page.getByRole('row').filter({ has: page.getByRole('link', { name, exact: true }) });
    const fits = async (element: Locator) => {
      await expect(element).toBeInViewport({ ratio: 0.99 });
      const box = (await element.boundingBox())!;
      expect(box.x).toBeGreaterThanOrEqual(0);
      expect(box.x + box.width).toBeLessThanOrEqual(390);
    };
    await line.call('POST', '/axes/axis-2/faults', { inject: 'encoder_loss' });
    await open('/');
    await expect(page.getByRole('columnheader', { name: 'true position' })).toBeVisible();
    const fault = row('axis-2').getByRole('link', { name: /Encoder/ });
    await fits(fault);
    await fits(row('axis-2').getByRole('button', { name: 'Clear fault' }));
    await row('axis-3').getByRole('button', { name: 'Enable' }).click();
    await expect(row('axis-3')).toContainText('operation enabled');
    // No state is cut off.
    expect(await page.locator('.of-state').evaluateAll((cells) => cells.every((cell) => cell.scrollWidth <= cell.clientWidth))).toBe(true);
    for (const name of ['Halt', 'Disable']) await fits(row('axis-3').getByRole('button', { name, exact: true }));
    await picture('rows-narrow');
    // The last row can be reached, and its command too.
    await page.locator('.row-box').evaluate((element) => element.scrollTo(0, element.scrollHeight));
    await page.locator('.row-box').scrollIntoViewIfNeeded();
    await row('axis-16').getByRole('button', { name: 'Enable' }).click();
    await expect(row('axis-16').getByRole('button', { name: 'Halt' })).toBeVisible();
    expect(await page.evaluate(() => document.documentElement.scrollWidth)).toBeLessThanOrEqual(390);
    await page.locator('.row-box').evaluate((element) => element.scrollTo(0, 0));
    await fault.click();
    await expect(page).toHaveURL(/\/faults\/axis-2/);
  });
});

const stops = '[axis.travel]\nlow_stop = -200000\nhigh_stop = 200000';
const coupling = (first: string, second: string, more = '') => `[[coupling]]\naxes = ["${first}", "${second}"]\n${more}\n`;
const gantry =
  'clock = "virtual"\n[[bus]]\nname = "can0"\n' + axis('l', stops) + axis('re', stops) + axis('tab', '') + axis('tilt', '') + coupling('l', 're', 'ratio = -1') + coupling('tab', 'tilt');

test.describe('coupled axes', () => {
  test.use({ lineText: gantry });
  for (const width of [1366, 390]) {
    test(`two linear ones are drawn as a gantry, ${width} px wide`, async ({ page, open, line, picture }) => {
      await page.setViewportSize({ width, height: 768 });
      // The motors face each other, so these are the same place of the machine.
      await line.call('PUT', '/axes/l/plant', { position_counts: -131072 });
      await line.call('PUT', '/axes/re/plant', { position_counts: 131072 });
      await open('/');
      const machine = page.getByRole('region', { name: 'Gantry of l and re' });
      await expect(page.getByRole('region', { name: /^Gantry/ })).toHaveCount(1); // the rotary ones are none
      await expect(machine.getByRole('img', { name: /^l is at .1\.00 revolutions$/ })).toBeVisible();
      await expect(machine.getByRole('img', { name: 're is at 1.00 revolutions' })).toBeVisible();
      // The beam goes from carriage to carriage, and is inclined when one side has moved alone.
      const beam = async () => {
        const box = (await machine.locator('.across .beam').boundingBox())!;
        const middles = await Promise.all([0, 1].map(async (side) => {
          const { x, width: wide } = (await machine.locator('.carriage').nth(side).boundingBox())!;
          return x + wide / 2;
        }));
        return { left: box.x, right: box.x + box.width, middles };
      };
      const straight = await beam();
      expect(Math.abs(straight.middles[0] - straight.middles[1])).toBeLessThan(1);
      expect(Math.abs((straight.left + straight.right) / 2 - straight.middles[0])).toBeLessThan(1);
      const all = (await machine.locator('.sides').boundingBox())!;
      expect(straight.middles[0]).toBeLessThan(all.x + 0.25 * all.width);
      await line.call('PUT', '/axes/re/plant', { position_counts: 0 });
      await line.call('POST', '/clock/advance', { ms: 20 });
      await expect(machine.getByRole('img', { name: 're is at 0.00 revolutions' })).toBeVisible();
      const inclined = await beam();
      expect(inclined.right - inclined.left).toBeGreaterThan(0.2 * all.width);
      await expect(card(page, 're')).toContainText('linear, coupled with l');
      await expect(card(page, 'tilt')).toContainText('rotary, coupled with tab');
      await page.getByText('Legend').click();
      await expect(page.getByText('beam of a gantry between its two axes')).toBeVisible();
      expect(await page.evaluate(() => document.documentElement.scrollWidth)).toBeLessThanOrEqual(width);
      await accessible(page);
      await picture(`gantry-${width}`);
      await page.getByRole('group', { name: 'View' }).getByRole('button', { name: 'Rows' }).click();
      await expect(machine).toBeVisible();
      await expect(page.getByRole('rowheader', { name: /^re generic402, coupled with l$/ })).toBeVisible();
    });
  }
});

// 256 axes on three CAN buses. A torque turns every shaft, so each message of the stream has all axes.
const many = 256;
const perBus = 100;
function largeLine(): string {
  const buses = Array.from({ length: Math.ceil(many / perBus) }, (_, i) => `[[bus]]\nname = "can${i}"\n`).join('');
  const axes = Array.from({ length: many }, (_, i) =>
    `[[axis]]\nname = "axis-${String(i + 1).padStart(3, '0')}"\nproduct = "${i % 4 === 3 ? 'ismc' : 'generic402'}"\nbus = "can${Math.floor(i / perBus)}"\nnode = ${(i % perBus) + 1}\n` +
    `${i % 2 === 0 ? '[axis.travel]\ncounts_per_unit = 131072\nlow_stop = -1000\nhigh_stop = 1000\n' : ''}[axis.load]\nexternal_torque_nm = -0.05\nviscous_friction_nms = 0.001\n`,
  ).join('');
  return `clock = "virtual"\n${buses}${axes}`;
}

interface Counts {
  commits: number;
  messages: number;
  frames: number;
}
const counts = (page: Page) => page.evaluate(() => ({ ...(window as unknown as { counts: Counts }).counts, now: performance.now() }));

test.describe('a line of 256 axes', () => {
  test.use({ lineText: largeLine(), contextOptions: { reducedMotion: 'no-preference' } });

  test('is shown in rows, all of which can be reached', async ({ page, open, picture }) => {
    await page.setViewportSize({ width: 1366, height: 768 });
    await open('/');
    const table = page.getByRole('table', { name: 'Axes' });
    await expect(table).toHaveAttribute('aria-rowcount', '257');
    // Only the rows in view are there, so their number depends on the window and not on the line.
    const drawn = await table.getByRole('rowheader').count();
    expect(drawn).toBeGreaterThan(8);
    expect(drawn).toBeLessThan(40);
    const seen = new Set<string>();
    const rows = page.locator('.row-box');
    for (let top = 0; top <= many * 40; top += 400) {
      await rows.evaluate((element, to) => element.scrollTo(0, to), top);
      const wanted = `axis-${String(Math.min(many, Math.floor(top / 40) + 1)).padStart(3, '0')}`;
      await expect(table.getByRole('rowheader', { name: wanted })).toHaveCount(1);
      for (const text of await table.getByRole('rowheader').getByRole('link').allTextContents()) seen.add(text);
    }
    expect(seen.size).toBe(many);
    await accessible(page);
    await picture('line-256');
  });

  test('is filtered by text, state and bus, and the address keeps it', async ({ page, open, line }) => {
    await line.call('POST', '/axes/axis-120/power', { action: 'off' });
    await open('/');
    const status = page.getByText(/\d+ of 256 axes/);
    await expect(status).toHaveText('256 of 256 axes');
    await page.getByRole('searchbox').fill('ismc can1');
    await expect(status).toHaveText('25 of 256 axes');
    await page.reload();
    await expect(status).toHaveText('25 of 256 axes');
    await choose(page, 'State', 'No power');
    await expect(status).toHaveText('1 of 256 axes');
    await expect(page.getByRole('table', { name: 'Axes' }).getByRole('rowheader')).toHaveText([/axis-120/]);
    await line.call('POST', '/axes/axis-120/power', { action: 'on' });
    await line.call('POST', '/clock/advance', { ms: 50 });
    await expect(status).toHaveText('0 of 256 axes');
    await expect(page.getByText('No axis fits the filter.')).toBeVisible();
    await page.getByRole('searchbox').fill('');
    await choose(page, 'State', 'Any state');
    await choose(page, 'Bus', 'can2');
    await expect(status).toHaveText('56 of 256 axes');
  });

  test('a message of the stream causes one commit of React', async ({ page, open, line }, info) => {
    // React reports each commit to this hook, as to its developer tools.
    await page.addInitScript(() => {
      const counts: Counts = { commits: 0, messages: 0, frames: 0 };
      Object.assign(window, { counts, __REACT_DEVTOOLS_GLOBAL_HOOK__: { supportsFiber: true, renderers: new Map(), inject: () => 1, onCommitFiberRoot: () => ++counts.commits, onCommitFiberUnmount: () => undefined } });
      const Socket = WebSocket;
      window.WebSocket = class extends Socket {
        constructor(url: string | URL, protocols?: string | string[]) {
          super(url, protocols);
          // Events of the axes are messages, too, and cause no commit.
          this.addEventListener('message', ({ data }) => typeof data === 'string' && data.startsWith('{"axes"') && ++counts.messages);
        }
      };
      const frame = () => {
        ++counts.frames;
        requestAnimationFrame(frame);
      };
      requestAnimationFrame(frame);
    });
    await page.setViewportSize({ width: 1366, height: 768 });
    await open('/');
    await expect(page.getByRole('table', { name: 'Axes' })).toBeVisible();
    // The answers about geometry and words of all axes cause commits of their own: wait until they are there.
    await page.waitForLoadState('networkidle');
    const metrics = await page.context().newCDPSession(page);
    await metrics.send('Performance.enable', { timeDomain: 'threadTicks' });
    const cpu_ms = async () => 1000 * (await metrics.send('Performance.getMetrics')).metrics.find(({ name }) => name === 'TaskDuration')!.value;
    await line.call('PUT', '/clock', { speed: 0.02 });
    const started = await counts(page);
    await expect.poll(async () => (await counts(page)).messages - started.messages, { timeout: 60_000 }).toBeGreaterThan(40);
    const [first, before_ms] = [await counts(page), await cpu_ms()];
    await expect.poll(async () => (await counts(page)).messages - first.messages, { timeout: 60_000 }).toBeGreaterThan(100);
    const [last, after_ms] = [await counts(page), await cpu_ms()];
    const [messages, commits, frames] = (['messages', 'commits', 'frames'] as const).map((key) => last[key] - first[key]);
    const seconds = (last.now - first.now) / 1000;
    // A figure to read, no verdict: it depends on the machine and on what else it does.
    const measured = `256 axes: ${(frames / seconds).toFixed(1)} frames/s, ${(messages / seconds).toFixed(1)} messages/s, ${((after_ms - before_ms) / messages).toFixed(1)} ms of the main thread's processor time a message, ${commits} commits of ${messages} messages`;
    info.annotations.push({ type: 'measured', description: measured });
    console.log(measured);
    // The clock and the table of buses have a commit a second each, on their own.
    expect(commits).toBeGreaterThan(messages * 0.5);
    expect(commits).toBeLessThanOrEqual(messages + Math.ceil(3 * seconds) + 5);
  });
});
