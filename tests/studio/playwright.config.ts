import { defineConfig } from '@playwright/test';
import { browser } from './browser';

// Debian's Chromium in front of the built program. The tests wait for what they see, not for a time: drives move no
// faster on an idle machine, and slower on a busy one.
const report = process.env.STUDIO_REPORT;
const asRoot = process.getuid?.() === 0;
// ./test leaves out the tests with the tag @all, which show for another product what others show for one.
const few = process.env.STUDIO_LOOKS === 'few';

export default defineConfig({
  testDir: '.',
  outputDir: '../../build/studio-tests',
  timeout: 120_000,
  expect: { timeout: 30_000 },
  retries: 2,
  maxFailures: 20,
  globalTimeout: 24 * 60_000,
  fullyParallel: true,
  grepInvert: few ? /@all/ : undefined,
  workers: Number(process.env.STUDIO_WORKERS ?? 3),
  // The JSON report tells which tests passed at a later try: ./test counts them.
  reporter: report ? [['line'], ['junit', { outputFile: report }], ['json', { outputFile: report.replace(/xml$/, 'json') }]] : 'line',
  use: {
    viewport: { width: 1280, height: 820 },
    contextOptions: { reducedMotion: 'reduce' }, // the page draws less often (studio/src/rates.ts)
    trace: 'on-first-retry', // recording one of each test takes time
    // Without a graphics processor, the process that emulates one takes a quarter of the browser's time.
    launchOptions: { executablePath: browser, args: ['--disable-gpu', ...(asRoot ? ['--no-sandbox'] : [])] },
  },
});
