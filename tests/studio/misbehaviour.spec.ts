import { execFile } from 'node:child_process';
import { join } from 'node:path';
import { fileURLToPath } from 'node:url';
import { promisify } from 'node:util';
import { accessible } from './accessible';
import { choose, expect, panel, test as base } from './fixtures';
import { Line, lineFile } from './line';

// Misbehaviours fired by hand: what a program of another project (canopen) sees of them on the bus.

const root = fileURLToPath(new URL('../..', import.meta.url));
const python = process.env.SERVODROME_PYTHON ?? join(root, '.venv/bin/python');

const test = base.extend({
  line: async ({ page: _ }, use) => {
    const line = await new Line(lineFile(), ['can0=socketcand:127.0.0.1:0/can0']).start();
    await use(line);
    await line.end();
  },
});

async function read(line: Line, index: string): Promise<string> {
  const link = line.linkOf('can0').replace('socketcand:', '');
  return (await promisify(execFile)(python, [join(root, 'tests/studio/read_object.py'), link, '2', index])).stdout.trim();
}

test('an SDO abort by hand reaches a client, until the rule is removed', async ({ page, open, line, picture }) => {
  await open('/misbehaviour/reference');
  const form = panel(page, 'CANopen: abort');
  await expect(form).toContainText('Breaks: CiA 301 7.2.4.3.17, table 22');
  expect(await read(line, '1000')).toBe('131474');
  await form.getByRole('textbox', { name: 'code' }).fill('0x06010002');
  await form.getByRole('button', { name: 'Arm' }).click();
  const rules = panel(page, 'Rules in force');
  await expect(rules.getByRole('row', { name: /abort 1 reference in force/ })).toBeVisible();
  expect(await read(line, '1000')).toBe('abort 06010002');
  expect(await read(line, '1000')).toBe('abort 06010002');
  await expect(rules.getByRole('row', { name: /abort 1 reference in force 2/ })).toBeVisible();
  await accessible(page);
  await picture('misbehaviour');
  await rules.getByRole('button', { name: 'Remove abort 1' }).click();
  await expect(rules).toContainText('No rule');
  expect(await read(line, '1000')).toBe('131474');
});

test('fired once, it acts on one message; the keyboard is enough', async ({ page, open, line }) => {
  await open('/misbehaviour/reference');
  await page.getByRole('region', { name: 'CANopen', exact: true }).getByRole('button', { name: 'replace' }).focus();
  await page.keyboard.press('Enter');
  const form = panel(page, 'CANopen: replace');
  await form.getByRole('textbox', { name: 'data' }).focus();
  await page.keyboard.press('Control+A');
  await page.keyboard.type('80 00 10 00 00 00 06 06');
  await form.getByRole('button', { name: 'Fire once' }).focus();
  await page.keyboard.press('Enter');
  const rules = panel(page, 'Rules in force');
  await expect(rules.getByRole('row', { name: /replace 1 reference in force 0/ })).toBeVisible();
  expect([await read(line, '1000'), await read(line, '1000')]).toEqual(['abort 06060000', '131474']);
  await expect(rules.getByRole('row', { name: /replace 1 reference over 1/ })).toBeVisible();
});

test('what the drive shows is another thing than what it is, for one second', async ({ page, open, line }) => {
  await open('/misbehaviour/reference');
  await page.getByRole('region', { name: 'CiA 402 and the machine' }).getByRole('button', { name: 'show' }).click();
  const form = panel(page, 'CiA 402 and the machine: show');
  await form.getByRole('textbox', { name: 'object' }).fill('1000');
  await form.getByRole('textbox', { name: 'set bits' }).fill('0x1');
  await form.getByRole('button', { name: 'Arm' }).click();
  await expect(panel(page, 'Rules in force').getByRole('row', { name: /show 1 reference in force/ })).toBeVisible();
  expect(await read(line, '1000')).toBe('131475');
  await form.getByRole('button', { name: 'Fire for 1 s' }).click();
  await expect(panel(page, 'Rules in force').getByRole('row', { name: /show 2 reference over/ })).toBeVisible();
  await panel(page, 'Rules in force').getByRole('button', { name: 'Remove all' }).click();
  await expect(panel(page, 'Rules in force')).toContainText('No rule');
  expect(await read(line, '1000')).toBe('131474');
});

test('a mistake is shown where it is made, and the library fits the bus', async ({ page, open, watched }) => {
  await open('/misbehaviour/reference');
  const form = panel(page, 'CANopen: abort');
  await form.getByRole('textbox', { name: 'code' }).fill('ten');
  await expect(form).toContainText('a number, such as 12 or 0x0C');
  await expect(form.getByRole('button', { name: 'Arm' })).toBeDisabled();
  await form.getByRole('textbox', { name: 'code' }).fill('1');
  await form.getByText('Only some of these messages').click();
  await form.getByRole('textbox', { name: 'object' }).fill('60G1');
  await form.getByRole('button', { name: 'Arm' }).click();
  await expect(page.getByText('"60G1" is no object')).toBeVisible();
  watched.splice(0); // the browser reports the refusal, too
  await choose(page, /Message/, 'SDO request', form);
  await page.getByRole('navigation', { name: 'Axes' }).getByRole('link', { name: 'jmc' }).click();
  await expect(page.getByRole('region', { name: 'EtherCAT', exact: true })).toBeVisible();
  await expect(page.getByRole('region', { name: 'CANopen', exact: true })).toHaveCount(0);
});
