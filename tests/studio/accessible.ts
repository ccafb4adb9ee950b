import { expect, type Page } from '@playwright/test';
import { readFileSync } from 'node:fs';
import { createRequire } from 'node:module';

const axeSource = readFileSync(createRequire(import.meta.url).resolve('axe-core/axe.min.js'), 'utf8');
interface Violation {
  id: string;
  nodes: { html: string }[];
}

// What is shown now has no accessibility violation, as axe sees it.
export async function accessible(page: Page, when = 'now') {
  await page.evaluate(axeSource);
  const violations = await page.evaluate(async () => {
    const { axe } = window as unknown as { axe: { run(): Promise<{ violations: Violation[] }> } };
    return (await axe.run()).violations;
  });
  expect(violations.map(({ id, nodes }) => `${id}: ${nodes[0].html}`), when).toEqual([]);
}
