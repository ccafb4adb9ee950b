import { choose, expect, panel, test, type } from './fixtures';

// Texts of the page on which a user depends: each test fails if the text, or what it says, goes away.

interface Recorded {
  id: number;
  state: string;
}

test('a search for an object shows a match of its name first', async ({ page, open }) => {
  await open('/objects/reference?q=profile velocity');
  const options = page.getByRole('listbox', { name: 'Objects' }).getByRole('option');
  // 606Dh comes earlier in the dictionary, and only its explanation has the words.
  await expect(options.first()).toContainText('6081:00');
  await expect(options.filter({ hasText: '606D:00' })).toHaveCount(1);
  await page.getByRole('button', { name: /Group/ }).click();
  await expect(page.getByRole('option', { name: 'Manufacturer-specific' })).toBeVisible();
});

test('a recording keeps its length when the settings change', async ({ page, open, line }) => {
  const { id } = await line.call<Recorded>('POST', '/recordings', { name: 'short', channels: [{ axis: 'reference', signal: 'velocity_rpm' }], rate_hz: 1000, duration_ms: 300 });
  await expect.poll(async () => (await line.call<Recorded>('GET', `/recordings/${id}`)).state).toBe('done');
  await open(`/scope?ch=reference/velocity_rpm&ms=700&rate=1000&rec=${id}`);
  const status = panel(page, 'short').getByRole('status');
  await expect(status).toContainText('300 ms at 1\u2009000 Hz');
  await type(page, 'Duration', 900);
  await choose(page, 'Rate', '500 Hz');
  await expect(page.getByRole('textbox', { name: 'Duration', exact: true })).toHaveValue('900');
  await expect(status).toContainText('300 ms at 1\u2009000 Hz');
});

test('a disturbance has the shares of the frames that are lost, corrupted and delayed', async ({ page, open, line }) => {
  await open('/plant/reference');
  const disturbance = panel(page, 'Disturbance of can0');
  for (const [i, name] of ['Lost', 'Corrupted', 'Delayed'].entries()) await type(page, name, i + 1, disturbance);
  await expect(disturbance.getByText('% of frames')).toHaveCount(3);
  await disturbance.getByRole('button', { name: 'Disturb' }).click();
  await expect(disturbance).toContainText('disturbed');
  const { disturbance: set } = await line.call<{ disturbance: object }>('GET', '/buses/can0');
  expect(set).toMatchObject({ drop: 0.01, corrupt: 0.02, delay: 0.03 });
});

test('the page of the tuning says what it does, and of what its limit is a percentage', async ({ page, open }) => {
  const job = { id: 7, axis: 'ismk', do: 'tune', state: 'done' };
  await page.route('**/api/v1/jobs', (route) => route.fulfill({ json: { jobs: [job] } }));
  await page.route('**/api/v1/jobs/7', (route) => route.fulfill({ json: { ...job, found: { result: 'applied', gains: [], changes: 'bandwidth 20 to 60 Hz, phase margin 70 to 55°' } } }));
  await open('/tuning/ismk');
  const tune = panel(page, 'Tune the velocity loop');
  await expect(tune).toContainText('excited with a small test signal');
  await expect(tune.getByRole('textbox', { name: /^Target bandwidth/ })).toBeVisible();
  await expect(tune.getByRole('textbox', { name: 'Torque limit' })).toBeVisible();
  await expect(tune).toContainText('% of peak current');
  await expect(panel(page, 'Tuning results').getByRole('note')).toHaveText('bandwidth 20 to 60 Hz, phase margin 70 to 55°');
  await open('/tuning/reference');
  await expect(tune).toContainText('% of rated torque');
});

test('a job that another job keeps from its axis is refused without the words of the API', async ({ page, open, line, watched }) => {
  await line.call('POST', '/axes/ismc/jobs', { do: 'enable' });
  await expect.poll(async () => (await line.call<{ state: string }>('GET', '/axes/ismc')).state).toBe('operation enabled');
  await line.call('POST', '/axes/ismc/jobs', { do: 'move', units: 'revolutions', by: 8, velocity: 0.01, acceleration: 10 }); // 800 s
  await open('/');
  await page.getByRole('button', { name: 'Enable all' }).click();
  const notice = page.locator('.notice.bad');
  await expect(notice).toContainText('the axis has a job: move');
  await expect(notice).toContainText('wait until the job has ended, or cancel it on the Axis page');
  await expect(notice).not.toContainText(/DELETE|\/api/);
  expect(watched.splice(0).join()).toContain('409'); // the browser itself logs the refusal
});

test('a JMC whose velocity is above its limits says which objects limit it', async ({ page, open }) => {
  await open('/axis/jmc');
  await type(page, 'Velocity', 6000);
  await page.getByRole('button', { name: 'Move +' }).click();
  const notice = page.locator('.notice.bad');
  await expect(notice).toContainText('over-speed');
  await expect(notice).toContainText('607Fh or 6080h');
});

test('the banner about the project has no words of the API', async ({ page, open, watched }) => {
  const problem = { what: 'no space is left', where: '/bench/project.toml', hint: 'make space on the disk; GET /api/v1/project shows it' };
  await page.route('**/api/v1/project', (route) => route.fulfill({ json: { project: { name: 'bench', folder: '/bench', problem } } }));
  await page.route('**/api/v1/project/state', (route) => route.fulfill({ json: { state: {} } }));
  await open('/');
  const banner = page.getByRole('alert').filter({ hasText: 'The project is not saved' });
  await expect(banner).toContainText('/bench/project.toml: no space is left; make space on the disk.');
  await expect(banner).not.toContainText('/api/');
  watched.splice(0);
});
