import { expect, type Page } from '@playwright/test';
import { readFileSync } from 'node:fs';
import { createRequire } from 'node:module';

const axeSource = readFileSync(createRequire(import.meta.url).resolve('axe-core/axe.min.js'), 'utf8');
interface Violation {
  id: string;
  nodes: { html: string }[];
}

type Rules = 'all' | 'contrast';

// What is shown now has no accessibility violation, as axe sees it.
export async function accessible(page: Page, when = 'now', rules: Rules = 'all') {
  await page.evaluate(axeSource);
  const violations = await page.evaluate(async (only) => {
    const { axe } = window as unknown as { axe: { run(options: object): Promise<{ violations: Violation[] }> } };
    return (await axe.run(only)).violations;
  }, rules === 'all' ? {} : { runOnly: ['color-contrast'] });
  // A tooltip belongs to the element that it describes, and to no region.
  const isTooltip = ({ id, nodes }: Violation) => id === 'region' && nodes.every(({ html }) => html.includes('role="tooltip"'));
  expect(violations.filter((each) => !isTooltip(each)).map(({ id, nodes }) => `${id}: ${nodes[0].html}`), when).toEqual([]);
}

export const slow_ms = 300_000; // six runs of axe, which a busy machine does slowly

// STUDIO_LOOKS=few (./test): axe judges dark colours for contrast only, since other colours change nothing else, and leaves out the
// wider of two wide windows, which has the same elements, and one of two in dark colours. Else every look by all rules.
const few = process.env.STUDIO_LOOKS === 'few';
export const rulesFor = (colorScheme: 'light' | 'dark'): Rules => (few && colorScheme === 'dark' ? 'contrast' : 'all');
const isLeftOut = (colorScheme: 'light' | 'dark', width: number) => few && (width === 1920 || (colorScheme === 'dark' && width === 390));

// A page that is open, in three sizes, light and dark: it fits, STOP is in view, and it is accessible. Takes up to slow_ms.
export async function inEveryLook(page: Page, name: string, picture: (name: string) => Promise<void>) {
  await expect(page.locator('main')).not.toHaveText('');
  await page.waitForTimeout(500); // what comes over the stream is there as well
  for (const [width, height] of [[1366, 768], [1920, 1080], [390, 844]]) {
    await page.setViewportSize({ width, height });
    await expect(page.getByRole('button', { name: 'STOP', exact: true })).toBeInViewport({ ratio: 1 });
    await expect(page.locator('.top nav [aria-current]')).toBeInViewport({ ratio: 0.99 });
    if (width > 1000) await expect(page.locator('.top nav').getByRole('link', { name: 'Bus' })).toBeInViewport({ ratio: 1 });
    const overhang = await page.evaluate(() => Math.max(...[document.documentElement, document.querySelector('.page')!].map(({ scrollWidth, clientWidth }) => scrollWidth - clientWidth)));
    expect(overhang).toBeLessThanOrEqual(0);
    for (const colorScheme of ['light', 'dark'] as const) {
      await page.emulateMedia({ colorScheme });
      if (!isLeftOut(colorScheme, width)) await accessible(page, `${colorScheme}, ${width} px`, rulesFor(colorScheme));
      await picture(`${name}-${colorScheme}-${width}`);
    }
  }
}
