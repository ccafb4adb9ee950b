import { choose, expect, panel, test } from './fixtures';

test('an input gets another function, and the drive takes it', async ({ page, open, line }) => {
  const value = async (object: string) => (await line.call<{ value: number }>('GET', `/axes/ismk/objects/2010/${object}`)).value;
  await open('/plant/ismk');
  const functions = panel(page, 'Functions of the inputs');
  await choose(page, /Din1_Function/, 'Home signal', functions);
  await expect.poll(() => value('3')).toBe(0x40);
  // Its polarity, and it by hand.
  await functions.getByRole('switch', { name: 'DI2 as it is wired, not inverted' }).click();
  await expect.poll(() => value('1')).toBe(0xfffd);
  const seen = panel(page, 'Inputs').getByRole('row', { name: /Din_Real/ });
  await expect(seen.getByRole('listitem').filter({ hasText: 'DI2 is on' }).getByRole('img', { name: 'on', exact: true })).toBeVisible();

  const outputs = panel(page, 'Functions of the outputs');
  await choose(page, /Dout1_Function/, 'Home found', outputs);
  await expect.poll(() => value('F')).toBe(0x400);
});

test('a touch probe is switched on, and keeps the position of an edge', async ({ page, open, line, picture }) => {
  await page.setViewportSize({ width: 1280, height: 1050 });
  await open('/plant/reference');
  const probes = panel(page, 'Touch probes');
  await probes.getByRole('switch', { name: 'probe 1: positive edge' }).click();
  await expect.poll(async () => (await line.call<{ value: number }>('GET', '/axes/reference/objects/60B8/0')).value).toBe(0x10);
  await probes.getByRole('switch', { name: 'probe 1 on' }).click();
  const status = probes.getByRole('row', { name: /Touch probe status/ });
  const lamp = (name: string) => status.getByRole('listitem').filter({ hasText: name }).getByRole('img', { name: 'on', exact: true });
  await expect(lamp('probe 1 is on')).toBeVisible();
  await expect(lamp('positive edge')).toHaveCount(0);
  // Input 3 has the function of probe 1.
  await page.getByRole('group', { name: 'Force DI3' }).getByRole('button', { name: '1' }).click();
  await expect(lamp("probe 1 has a positive edge's position")).toBeVisible();
  await panel(page, 'Outputs').getByRole('row', { name: /60FE:01/ }).getByRole('switch', { name: 'DO0' }).click();
  await expect.poll(async () => (await line.call<{ value: number }>('GET', '/axes/reference/objects/60FE/1')).value).toBe(0x10000);
  await picture('terminals');
});
