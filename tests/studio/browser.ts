import { existsSync } from 'node:fs';

// Debian's Chromium. The headless shell takes half the processor time of the whole browser.
const paths = ['/usr/bin/chromium-headless-shell', '/usr/bin/chromium'];

export const browser = process.env.CHROMIUM ?? paths.find((path) => existsSync(path)) ?? paths[0];
