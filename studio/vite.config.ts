import react from '@vitejs/plugin-react';
import { defineConfig } from 'vitest/config';

// `npm run dev` serves the page with what changes in it at once, and hands /api to a running `servodrome up`.
const server = process.env.SERVODROME_API ?? 'http://127.0.0.1:8402';

export default defineConfig({
  plugins: [react()],
  // No module preload script inside the page, no data: URLs for scripts or fonts: the Content-Security-Policy forbids both.
  build: { outDir: '../build/studio', emptyOutDir: true, target: 'es2022', modulePreload: false, assetsInlineLimit: 0, chunkSizeWarningLimit: 1000 },
  server: {
    // As if the page came from that server: it refuses writes and streams of other origins.
    proxy: { '/api': { target: server, ws: true, changeOrigin: true, headers: { origin: server } } },
  },
  test: { include: ['src/**/*.test.ts'], environment: 'node' },
});
