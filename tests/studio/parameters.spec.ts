import { execFile } from 'node:child_process';
import { readFileSync } from 'node:fs';
import { promisify } from 'node:util';
import { expect, panel, test, withoutTimeouts } from './fixtures';
import { lineFile, servodrome } from './line';

const write = (object: string, value: number) => ['PUT', `/axes/reference/objects/${object.replace(':', '/')}`, { value }] as const;

test('a dictionary is compared with the factory, and what differs is taken back', async ({ page, open, line, picture }) => {
  await line.call(...write('6081:0', 4321));
  await line.call(...write('6083:0', 999));
  await open('/objects/reference');
  await page.getByRole('link', { name: 'Parameters' }).click();
  await page.getByRole('button', { name: 'Compare with factory' }).click();
  const differences = panel(page, 'Compared with factory');
  await expect(differences.getByRole('status')).toContainText('2 of');
  await expect(differences.getByRole('row', { name: /6081:00/ })).toContainText('4321');
  await picture('parameters');
  await differences.getByRole('button', { name: 'Write 6081:00 of factory' }).click();
  await expect(differences.getByRole('status')).toContainText('1 of');
  expect((await line.call<{ value: number }>('GET', '/axes/reference/objects/6081/0')).value).not.toBe(4321);
  expect((await line.call<{ value: number }>('GET', '/axes/reference/objects/6083/0')).value).toBe(999);
  await differences.getByRole('button', { name: 'Write all values of factory' }).click();
  await expect(differences).toContainText('No differences.');
});

test('parameters are saved as a file, and loaded into the drive again', async ({ page, open, line, watched }) => {
  await open('/objects/reference?view=parameters');
  const [saved] = await Promise.all([page.waitForEvent('download'), page.getByRole('link', { name: 'Save as a file' }).click()]);
  expect(saved.suggestedFilename()).toBe('reference.par');
  const path = await saved.path();
  expect(readFileSync(path, 'utf8')).toMatch(/^# servodrome parameters 1\nproduct: generic402\n/);

  await line.call(...write('6081:0', 4321));
  await page.getByLabel('Parameter file').setInputFiles({ name: 'reference.par', mimeType: 'text/plain', buffer: readFileSync(path) });
  await page.getByRole('button', { name: 'Compare with file' }).click();
  await expect(panel(page, 'Compared with reference.par').getByRole('row', { name: /6081:00/ })).toContainText('4321');
  await page.getByText('store after loading').click();
  await page.getByRole('button', { name: 'Load file' }).click();
  await expect(panel(page, 'Parameters')).toContainText('1 of them were written. Stored.');
  expect((await line.call<{ value: number }>('GET', '/axes/reference/objects/6081/0')).value).not.toBe(4321);

  // A value that the drive refuses: it is named with the drive's reason, and nothing of the file stays.
  const bad = '# servodrome parameters 1\nproduct: generic402\n1600:00 u8 1\n1600:01 u32 60410010h\n6081:00 u32 5\nend\n';
  await page.getByLabel('Parameter file').setInputFiles({ name: 'bad.par', mimeType: 'text/plain', buffer: Buffer.from(bad) });
  await page.getByRole('button', { name: 'Load file' }).click();
  const refusal = panel(page, 'Parameters').getByRole('alert');
  await expect(refusal).toContainText('0604 0041h');
  await expect(refusal).toContainText('were restored');
  expect((await line.call<{ value: number }>('GET', '/axes/reference/objects/6081/0')).value).not.toBe(5);
  expect(watched.splice(0).join()).toContain('409'); // the browser itself logs the refusal
});

test('a PDO is mapped, reordered, written; what the drive refuses is said, and nothing is lost', async ({ page, open, line, picture, watched }) => {
  await withoutTimeouts(page);
  await open('/objects/reference?view=pdos');
  const pdo = panel(page, 'RPDO 1, 1600h');
  const map = async (what: string) => {
    await pdo.getByLabel('Object to map').fill(what);
    await pdo.getByRole('button', { name: 'Map' }).click();
  };
  const mapped = async () => {
    const { pdos } = await line.call<{ pdos: { index: string; objects: { object: string }[] }[] }>('GET', '/axes/reference/pdos');
    return pdos.find(({ index }) => index === '0x1600')!.objects.map(({ object }) => object);
  };
  await map('607A:00');
  await pdo.getByRole('button', { name: 'Move 607A:00 up' }).click();
  await expect(pdo.getByRole('listitem').first()).toContainText('Target position');
  await picture('pdos');
  await page.getByRole('button', { name: 'Write to the drive' }).click();
  await expect(page.getByText('PDOs of reference written')).toBeVisible();
  expect(await mapped()).toEqual(['607A:00', '6040:00']);

  await map('6041:00/16');
  await page.getByRole('button', { name: 'Write to the drive' }).click();
  const refusal = panel(page, 'Process data').getByRole('alert');
  await expect(refusal).toContainText('0604 0041h');
  expect(await mapped()).toEqual(['607A:00', '6040:00']);
  await page.getByRole('button', { name: 'Revert' }).click();
  await expect(refusal).toHaveCount(0);
  await expect(pdo.getByRole('listitem')).toHaveCount(2);
  expect(watched.splice(0).join()).toContain('409');
});

test.describe('on EtherCAT', () => {
  test.use({ lineText: lineFile().replace('type = "ethercat"\n', 'type = "ethercat"\nlinks = ["udp:127.0.0.1:0"]\n') });

  test('PDOs are assigned in Pre-Operational', async ({ page, open, line }) => {
    await open('/objects/jmc?view=pdos');
    await expect(page.getByText('The slave is in Init')).toBeVisible();
    // A master takes it there.
    const { links } = await line.call<{ links: { name: string }[] }>('GET', '/buses/ecat');
    await promisify(execFile)(servodrome, ['state', 'preop', '--bus', links[0].name]);
    await expect(page.getByText('The slave is in Init')).toHaveCount(0);
    await panel(page, 'RPDO 1, 1600h').getByText('assigned').click();
    await panel(page, 'RPDO 2, 1601h').getByText('assigned').click();
    await page.getByRole('button', { name: 'Write to the drive' }).click();
    await expect.poll(async () => (await line.call<{ receive: string[] }>('GET', '/axes/jmc/pdos')).receive).toEqual(['0x1601']);
  });
});
