import { existsSync, mkdtempSync, readFileSync, renameSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import type { Browser, Page } from '@playwright/test';
import { accessible } from './accessible';
import { choose, expect, panel, test as base, type, watch } from './fixtures';
import { identify, next } from './guide';
import { lineFile, ProjectServer } from './line';

// The page of `servodrome studio FOLDER`: it keeps its state in the project.

const test = base.extend<{ folder: string; project: ProjectServer }>({
  folder: async ({ page: _ }, use) => {
    const folder = mkdtempSync(join(tmpdir(), 'project-'));
    writeFileSync(join(folder, 'line.toml'), lineFile());
    writeFileSync(join(folder, 'project.toml'), 'name = "Door"\nschema = 1\n');
    await use(folder);
    rmSync(folder, { recursive: true, force: true });
  },
  project: async ({ folder }, use) => {
    const project = await new ProjectServer(folder).start();
    await use(project);
    await project.end();
  },
  line: async ({ project }, use) => use(project as never), // for the other fixtures
});

const stateOf = (folder: string, name: string) => {
  const file = join(folder, 'state', `${name}.json`);
  return existsSync(file) ? (JSON.parse(readFileSync(file, 'utf8')) as unknown) : null;
};
const dashboards = (page: Page) => page.getByRole('navigation', { name: 'Dashboards' }).getByRole('link');

async function makeBoard(page: Page, name: string) {
  await page.getByRole('textbox', { name: 'Name of a dashboard' }).fill(name);
  await page.getByRole('button', { name: 'New', exact: true }).click();
}

// Another browser: its storage is empty.
async function otherBrowser(browser: Browser, project: ProjectServer, found: string[]) {
  const context = await browser.newContext();
  const page = await context.newPage();
  watch(page, project, found);
  await page.addInitScript(() => localStorage.setItem('servodrome.tour', 'over'));
  return page;
}

test('another browser finds everything after a restart of the server', async ({ page, browser, project, folder, open, watched }) => {
  await open('/commission/reference');
  await next(page).click();
  await identify(page);
  await choose(page, 'Machine', 'Spindle', panel(page, 'Units'));
  await type(page, 'Lead of the spindle', 7);
  await expect.poll(() => stateOf(folder, 'guide.reference')).toMatchObject({ product: 'generic402', mechanics: { machine: 'spindle', feed_mm: 7 } });
  await open('/boards');
  await expect(page.getByText('It is kept in the project "Door"')).toBeVisible();
  await makeBoard(page, 'Test bench');
  await project.call('PUT', '/axes/reference/objects/6083/0', { value: 4321 });
  await open('/scope/?ch=reference/velocity_rpm');
  await page.getByRole('textbox', { name: 'Name of the layout' }).fill('speed');
  await panel(page, 'Layouts').getByRole('button', { name: 'Save' }).click();
  await expect(page.getByText('saved in the project "Door"')).toBeVisible();
  await page.getByText('with a move').click();
  await page.getByRole('button', { name: 'Record', exact: true }).click();
  const recordings = panel(page, 'Recordings');
  await recordings.getByRole('textbox', { name: 'Name' }).fill('before the change');
  await recordings.getByRole('textbox', { name: 'Name' }).press('Enter');
  await expect(recordings.getByRole('button', { name: '1 · before the change' })).toBeVisible();
  expect(await page.evaluate(() => Object.keys(localStorage))).toEqual(['servodrome.tour']);

  await project.stop();
  watched.splice(0); // the lost connection
  await project.start();
  const other = await otherBrowser(browser, project, watched);
  await other.goto(`${project.address}/commission/reference`);
  await expect(panel(other, 'Units')).toBeVisible();
  await expect(other.getByRole('textbox', { name: 'Lead of the spindle' })).toHaveValue('7');
  await other.goto(`${project.address}/boards`);
  await expect(dashboards(other)).toHaveText(['Test bench']);
  await other.goto(`${project.address}/scope`);
  await expect(panel(other, 'Layouts').getByRole('button', { name: 'speed', exact: true })).toBeVisible();
  await panel(other, 'Recordings').getByRole('button', { name: '1 · before the change' }).click();
  await expect(panel(other, 'Recordings').getByRole('button', { name: '1 · before the change' })).toHaveAttribute('aria-pressed', 'true');
  await other.goto(`${project.address}/objects/reference?view=changes`);
  const row = panel(other, 'Changes').getByRole('row', { name: /6083:00/ });
  await expect(row).toContainText('4321');
  await expect(row.getByRole('button', { name: /Undo/ })).toHaveCount(0);
  await project.call('PUT', '/axes/reference/objects/6081/0', { value: 1234 });
  await expect(panel(other, 'Changes').getByRole('button', { name: 'Undo change 2' })).toBeVisible();

  // The first page has found the server again, and knows that the recordings are there.
  await expect(page.getByText(/The server was restarted: simulated drives/)).toBeVisible();
  await other.context().close();
  watched.splice(0);
});

test('all pages see the same, and the last change wins', async ({ page, browser, project, folder, open, watched }) => {
  await open('/boards');
  await makeBoard(page, 'First');
  const other = await otherBrowser(browser, project, watched);
  await other.goto(`${project.address}/boards`);
  await expect(dashboards(other)).toHaveText(['First']);
  await makeBoard(other, 'Second');
  await expect(dashboards(page)).toHaveText(['First', 'Second']);
  await other.getByRole('button', { name: 'Delete', exact: true }).click();
  await other.getByRole('button', { name: 'Really delete "Second"' }).click();
  await expect(dashboards(page)).toHaveText(['First']);
  await expect.poll(() => stateOf(folder, 'boards')).toEqual([{ name: 'First', widgets: [] }]);
  await other.context().close();
});

test('the guide of another product under the same name is kept beside the new one', async ({ page, project, folder, open, watched }) => {
  await open('/commission/reference');
  await next(page).click();
  await expect.poll(() => stateOf(folder, 'guide.reference')).toMatchObject({ product: 'generic402' });
  await project.stop();
  writeFileSync(join(folder, 'line.toml'), lineFile().replace('product = "generic402"', 'product = "pronet"'));
  await project.start();
  watched.splice(0); // the lost connection
  await page.goto(`${project.address}/commission/reference`);
  await expect(panel(page, 'Find the drive')).toBeVisible();
  await next(page).click();
  await expect.poll(() => stateOf(folder, 'guide.reference')).toMatchObject({ product: 'pronet' });
  await expect.poll(() => stateOf(folder, 'guide.reference.before')).toMatchObject({ product: 'generic402' });
  watched.splice(0);
});

test('the page says that the project cannot be written, and what to do', async ({ page, folder, open }) => {
  await open('/boards');
  await makeBoard(page, 'First');
  await expect.poll(() => stateOf(folder, 'boards')).toHaveLength(1);
  renameSync(folder, `${folder}.away`);
  await makeBoard(page, 'Second');
  const banner = page.getByRole('alert').filter({ hasText: 'The project is not saved' });
  await expect(banner).toContainText('No such file or directory');
  await accessible(page);
  await page.reload();
  await expect(banner).toBeVisible();
  await expect(dashboards(page)).toHaveText(['First', 'Second']);
  renameSync(`${folder}.away`, folder);
  await expect(banner).toHaveCount(0, { timeout: 20_000 });
  expect(stateOf(folder, 'boards')).toHaveLength(2);
});

test('what is changed while the server is away reaches the project later', async ({ page, project, folder, open, watched }) => {
  await open('/boards');
  await makeBoard(page, 'First');
  await expect.poll(() => stateOf(folder, 'boards')).toHaveLength(1);
  await project.stop();
  await expect(page.getByText('Connection lost')).toBeVisible();
  await makeBoard(page, 'Second');
  await expect(page.getByText('the server does not answer')).toBeVisible();
  await project.start();
  await expect.poll(() => stateOf(folder, 'boards'), { timeout: 20_000 }).toHaveLength(2);
  await expect(dashboards(page)).toHaveText(['First', 'Second']);
  watched.splice(0); // the lost connection
});
