import { expect, panel, test } from './fixtures';

const write = (object: string, value: number) => ['PUT', `/axes/reference/objects/${object.replace(':', '/')}`, { value }] as const;
const read = (object: string) => ['GET', `/axes/reference/objects/${object.replace(':', '/')}`] as const;

test('changes appear by themselves, are filtered and undone', async ({ page, open, line, picture, watched }) => {
  const before = (await line.call<{ value: number }>(...read('6083:0'))).value;
  await open('/objects/reference');
  await page.getByRole('link', { name: 'Changes' }).click();
  const list = panel(page, 'Changes');
  await expect(list).toContainText('Nothing was written yet.');

  await line.call(...write('6083:0', 4321));
  await line.call(...write('6081:0', 1234));
  const row = list.getByRole('row', { name: /6083:00/ });
  await expect(row).toContainText('Profile acceleration');
  await expect(row).toContainText(`${before}`);
  await expect(row).toContainText('4321');
  await expect(list.getByRole('row')).toHaveCount(3);
  await picture('changes');

  await list.getByPlaceholder('Filter by object, name or author').fill('velocity');
  await expect(list.getByRole('row')).toHaveCount(2);
  await expect(page).toHaveURL(/q=velocity/);
  await list.getByPlaceholder('Filter by object, name or author').fill('');

  await row.getByRole('button', { name: /Undo change/ }).click();
  await expect(list.getByText('1 object has the former value.')).toBeVisible();
  expect((await line.call<{ value: number }>(...read('6083:0'))).value).toBe(before);
  await expect(list.getByRole('row', { name: /undo by API \(page\)/ })).toBeVisible();

  // Another master changes it meanwhile: the first change cannot be undone, and the page says why.
  await line.call(...write('6083:0', 7777));
  await expect(list.getByRole('row', { name: /7777/ })).toBeVisible();
  await list.getByRole('row', { name: /4321/ }).last().getByRole('button', { name: /Undo change/ }).click();
  await expect(list.getByRole('alert')).toContainText('has changed the value since');
  expect(watched.splice(0).join()).toContain('409'); // the browser itself logs the refusal

  await list.getByRole('button', { name: 'Undo all' }).click();
  await list.getByRole('button', { name: 'Write these values' }).click();
  await expect(list.getByText(/former value/)).toBeVisible();
  expect((await line.call<{ value: number }>(...read('6083:0'))).value).toBe(before);

  // A command cannot be undone: it stays, and is named.
  await line.call(...write('6060:0', 3));
  await list.getByRole('button', { name: 'Undo all' }).click();
  await expect(list.getByText(/6060:00.*stays/)).toBeVisible();
});

test('the changes of all drives are undone, after the list of what is written', async ({ page, open, line, picture }) => {
  const value = async (axis: string) => (await line.call<{ value: number }>('GET', `/axes/${axis}/objects/6083/0`)).value;
  const write = (axis: string, to: number) => line.call('PUT', `/axes/${axis}/objects/6083/0`, { value: to });
  const names = (await line.call<{ axes: { name: string }[] }>('GET', '/axes')).axes.map(({ name }) => name);
  const before = Object.fromEntries(await Promise.all(names.map(async (name) => [name, await value(name)] as const)));
  for (const name of names) await write(name, 4321);
  const off = names.find((name) => name !== 'reference')!;
  await line.call('POST', `/axes/${off}/power`, { action: 'off' });

  await open('/objects/reference?view=changes');
  const list = panel(page, 'Changes');
  await expect(list.getByRole('row', { name: /4321/ })).toHaveCount(1);
  await list.getByText('all drives', { exact: true }).click();
  await expect(list.getByRole('row', { name: /4321/ })).toHaveCount(names.length);
  await expect(page).toHaveURL(/drives=all/);

  const planned = list.getByRole('region', { name: 'What the undo writes' });
  await list.getByRole('button', { name: 'Undo all of all drives' }).click();
  await expect(planned.getByRole('row', { name: /6083:00/ })).toHaveCount(names.length - 1);
  await expect(planned.getByRole('listitem')).toContainText([`${off} 6083:00`]);
  await expect(planned).toContainText('the axis has no power');
  await picture('changes-all-drives');
  await planned.getByRole('button', { name: 'Leave all as it is' }).click();
  await expect(planned).toHaveCount(0);
  expect(await value('reference')).toBe(4321); // nothing was written

  // What another writes while the list is on the page stays.
  await list.getByRole('button', { name: 'Undo all of all drives' }).click();
  await expect(planned.getByRole('row', { name: /6083:00/ })).toHaveCount(names.length - 1);
  await write('reference', 7777);
  await planned.getByRole('button', { name: 'Write these values' }).click();
  await expect(list.getByText(/reference 6083:00 .*has changed the value since/)).toBeVisible();
  expect(await value('reference')).toBe(7777);
  for (const name of names.filter((each) => each !== 'reference' && each !== off)) expect(await value(name), name).toBe(before[name]);
});

test('a CAN identifier is shown in hexadecimal', async ({ page, open, line }) => {
  await line.call(...write('1014:0', 0x80000082));
  await open('/objects/reference?view=changes');
  const row = panel(page, 'Changes').getByRole('row', { name: /1014:00/ });
  await expect(row).toContainText('00000082h');
  await expect(row).toContainText('80000082h');
  await expect(row).not.toContainText('130');
});

test('the drive is compared with the stored values', async ({ page, open, line }) => {
  await line.call(...write('6081:0', 4321));
  await open('/objects/reference?view=changes');
  await panel(page, 'Changes').getByRole('link', { name: 'Parameters' }).click();
  await page.getByRole('button', { name: 'Compare with stored values' }).click();
  const differences = panel(page, 'Compared with stored');
  await expect(differences.getByRole('row', { name: /6081:00/ })).toContainText('4321');
  await differences.getByRole('button', { name: 'Write 6081:00 of stored' }).click();
  await expect(differences).toContainText('No differences.');
});
