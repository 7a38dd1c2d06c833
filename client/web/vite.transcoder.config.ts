import { defineConfig } from 'vite';

/** The script that `radiosity` has Node.js run: one file, with nothing beside it. */
export default defineConfig({
  publicDir: false,
  build: {
    outDir: process.env['RADIOSITY_WEB_OUT'] ?? 'dist-transcoder',
    emptyOutDir: true,
    target: 'node18',
    ssr: 'src/textures/transcode_file.ts',
    rollupOptions: { output: { entryFileNames: 'transcode.mjs' } },
  },
});
