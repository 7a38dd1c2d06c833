import { gzipSync } from 'node:zlib';
import { readdirSync, readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { defineConfig, type Plugin } from 'vite';

/** Leaves a packed copy beside every file: the server has both and sends what the browser takes. */
function packed(): Plugin {
  let folder = '';
  const pack = (at: string) => {
    for (const entry of readdirSync(at, { withFileTypes: true })) {
      const path = join(at, entry.name);
      if (entry.isDirectory()) pack(path);
      else if (!path.endsWith('.gz')) writeFileSync(`${path}.gz`, gzipSync(readFileSync(path), { level: 9 }));
    }
  };
  return {
    name: 'packed',
    apply: 'build',
    configResolved: (config) => void (folder = config.build.outDir),
    closeBundle: () => pack(folder),
  };
}

/** The transcoder of Basis Universal as a module: three.js ships it as a script that names BASIS. */
function basisModule(): Plugin {
  return {
    name: 'basis-module',
    enforce: 'pre',
    transform: (code, id) => (id.endsWith('/basis_transcoder.js') ? `${code}\nexport default BASIS;` : undefined),
  };
}

const server = process.env['RADIOSITY_SERVER'] ?? 'http://127.0.0.1:8765';
const routes = ['/scene', '/lightmaps', '/snapshot', '/status', '/uploads'];

export default defineConfig({
  plugins: [packed(), basisModule()],
  worker: { format: 'es', plugins: () => [basisModule()] },
  optimizeDeps: { exclude: ['three/examples/jsm/libs/basis/basis_transcoder.js'] },
  build: {
    outDir: process.env['RADIOSITY_WEB_OUT'] ?? 'dist',
    emptyOutDir: true,
    target: 'es2022',
    // One page of one program: the code that every visit needs comes in one piece.
    chunkSizeWarningLimit: 1500,
    modulePreload: { polyfill: false },
    assetsInlineLimit: 0, // data: addresses would need holes in the Content-Security-Policy
  },
  server: {
    proxy: {
      ...Object.fromEntries(routes.map((route) => [route, server])),
      '/ws': { target: server, ws: true },
    },
  },
});
