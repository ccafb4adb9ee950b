import { accessible } from './accessible';
import { card, expect, test, watch, withoutTimeouts } from './fixtures';
import { Line, lineFile } from './line';

test('two browsers agree', async ({ page, open, line, browser, picture }) => {
  await open('/');
  const other = await (await browser.newContext()).newPage();
  const found: string[] = [];
  watch(other, line, found);
  await other.goto(line.address);
  await card(page, 'reference').getByRole('button', { name: 'Enable' }).click();
  for (const each of [page, other]) await expect(card(each, 'reference').locator('header .chip')).toHaveText('operation enabled');
  await other.goto(`${line.address}/axis/reference`);
  await other.getByRole('button', { name: 'Move +' }).click();
  await expect(other.getByText(/move: done/)).toBeVisible();
  for (const each of [page, other]) await expect(each.locator('body')).toContainText(/(1\.00\d|0\.99\d)\d?\s*rev/);
  await picture('line');
  expect(found).toEqual([]);
});

test('the loss of the server and its new start are said, and the page comes back', async ({ page, open, line, watched, picture }) => {
  await open('/');
  await line.stop();
  await expect(page.getByRole('alert')).toContainText('Connection lost: values are the last received.');
  await picture('lost');
  await line.start();
  await expect(page.getByText('The server was restarted')).toBeVisible();
  await expect(page.getByRole('alert')).toHaveCount(0);
  await card(page, 'ismc').getByRole('button', { name: 'Enable' }).click();
  await expect(card(page, 'ismc').locator('header .chip')).toHaveText('operation enabled');
  await page.getByRole('button', { name: 'Understood' }).click();
  await expect(page.getByText('The server was restarted')).toHaveCount(0);
  // The browser itself logs each connection that is refused meanwhile, and the answer to the page's question why (/jobs/0/alive).
  for (const message of watched.splice(0)) expect(message).toMatch(/ERR_CONNECTION_REFUSED|ERR_CONNECTION_RESET|ERR_EMPTY_RESPONSE|WebSocket connection|status of 404/);
});

test('a server that hangs is said as well, and the page comes back', async ({ page, open, line, watched }) => {
  await open('/');
  line.hang();
  try {
    await expect(page.getByRole('alert')).toContainText('Connection lost');
  } finally {
    line.goOn();
  }
  await expect(page.getByRole('alert')).toHaveCount(0);
  await card(page, 'ismc').getByRole('button', { name: 'Enable' }).click();
  await expect(card(page, 'ismc').locator('header .chip')).toHaveText('operation enabled');
  for (const message of watched.splice(0)) expect(message).toMatch(/WebSocket connection/);
});

test('an error in a page leaves the others, and the big stop', async ({ page, open, line, watched }) => {
  await withoutTimeouts(page);
  await page.route('**/api/v1/buses', (route) => route.fulfill({ json: { buses: [{ name: 'can0', type: 'can' }] } }));
  await page.goto(line.address);
  await expect(page.getByRole('alert')).toContainText('This part of the page has failed');
  await page.getByRole('button', { name: 'STOP', exact: true }).click();
  await expect(page.getByText('all axes stopped')).toBeVisible();
  await page.getByRole('link', { name: 'Axis', exact: true }).click();
  await expect(page.getByRole('heading', { name: 'State machine' })).toBeVisible();
  await expect(page.getByRole('alert')).toHaveCount(0);
  await page.unroute('**/api/v1/buses');
  await open('/');
  await expect(card(page, 'ismc')).toBeVisible();
  expect(watched.splice(0).join()).toContain('Cannot read properties');
});

test('an address that was cut off in an escape is no error', async ({ page, open }) => {
  await open('/');
  await page.evaluate(() => {
    history.pushState(null, '', '/axis/%E0%A4%A');
    dispatchEvent(new PopStateEvent('popstate'));
  });
  await expect(page.getByRole('alert')).toContainText('There is no axis');
});

test('from another machine the page asks for the token, and then works', async ({ page, watched }) => {
  // As another machine would: by an address that is not of the loopback range.
  const own = process.env.STUDIO_FAR_ADDRESS;
  test.skip(own === undefined, 'tools/test-studio gives that address where it may make a network namespace');
  const secret = 'one (of two), 100 %';
  const line = new Line(lineFile());
  line.listens = '0.0.0.0';
  line.environment = { SERVODROME_TOKEN: secret };
  await line.start();
  try {
    const address = line.address.replace('127.0.0.1', own!);
    await page.goto(address);
    await expect(page.getByRole('textbox', { name: 'Token' })).toBeVisible();
    await accessible(page);
    await page.getByRole('textbox', { name: 'Token' }).fill('no');
    await page.getByRole('button', { name: 'Connect' }).click();
    await expect(page.getByRole('alert')).toContainText('not the token of the running server');
    await page.getByRole('textbox', { name: 'Token' }).fill(secret);
    await page.getByRole('button', { name: 'Connect' }).click();
    await card(page, 'ismc').getByRole('button', { name: 'Enable' }).click();
    await expect(card(page, 'ismc').locator('header .chip')).toHaveText('operation enabled');
    await page.reload();
    await expect(card(page, 'ismc').locator('header .chip')).toHaveText('operation enabled');
    // Behind the address, from where it goes away.
    await page.evaluate(() => localStorage.clear());
    await page.goto('about:blank');
    await page.goto(`${address}/axis/ismc#token=${encodeURIComponent(secret)}`);
    await expect(page.getByRole('button', { name: 'Move +' })).toBeVisible();
    expect(new URL(page.url()).hash).toBe('');
  } finally {
    await line.end();
  }
  for (const message of watched.splice(0)) expect(message).toMatch(/401|WebSocket connection|request outside: (http|ws):\/\/[\d.]+:\d+\//);
});

test.describe('in virtual time', () => {
  test.use({ lineText: lineFile('virtual') });

  test('it is started, hurried and stopped', async ({ page, open, line }) => {
    await open('/');
    const time = async () => (await line.call<{ time_ms: number }>('GET', '/clock')).time_ms;
    const before = await time();
    await page.getByRole('button', { name: '+100 ms' }).click();
    await expect.poll(time).toBe(before + 100);
    await page.getByRole('button', { name: 'Speed of virtual time' }).click();
    await page.getByRole('option', { name: '× 10', exact: true }).click();
    await expect.poll(time).toBeGreaterThan(before + 2000);
    await card(page, 'reference').getByRole('button', { name: 'Enable' }).click();
    await expect(card(page, 'reference').locator('header .chip')).toHaveText('operation enabled');
    await page.getByRole('button', { name: 'Speed of virtual time' }).click();
    await page.getByRole('option', { name: 'stopped' }).click();
    await expect.poll(async () => (await line.call<{ speed: number }>('GET', '/clock')).speed).toBe(0);
  });
});
