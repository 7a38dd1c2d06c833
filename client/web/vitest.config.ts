import { fileURLToPath } from 'node:url';
import { defineConfig } from 'vitest/config';

const here = (path: string) => fileURLToPath(new URL(path, import.meta.url));
// Tests lie with all other tests of the project, where no node_modules is above them.
const resolve = {
  alias: {
    'gltf-validator': here('node_modules/gltf-validator/index.js'),
    'playwright-core': here('node_modules/playwright-core/index.mjs'),
    'three/addons': here('node_modules/three/examples/jsm'),
    three: here('node_modules/three'),
  },
};

const server = { fs: { allow: [here('../..')] } };

export default defineConfig({
  resolve, // for vite-node, which runs the benchmark
  server,
  test: {
    projects: [
      {
        resolve,
        server,
        test: {
          name: 'unit',
          root: here('../../tests/web'),
          include: ['unit/**/*.test.ts'],
          globals: true,
          testTimeout: 60_000,
        },
      },
      {
        resolve,
        server,
        test: {
          name: 'browser',
          root: here('../../tests/web'),
          include: ['browser/**/*.test.ts'],
          globals: true,
          pool: 'forks',
          poolOptions: { forks: { singleFork: true } }, // one browser and one server at a time: they share two cores
          testTimeout: 300_000, // more than the harness waits for anything
          hookTimeout: 300_000,
        },
      },
      {
        resolve,
        server,
        test: {
          name: 'outputs',
          root: here('../../tests/web'),
          include: ['outputs/**/*.test.ts'],
          globals: true,
          pool: 'forks',
          poolOptions: { forks: { singleFork: true } },
          testTimeout: 900_000, // programs in folders under a sanitizer take long
          hookTimeout: 300_000,
        },
      },
    ],
  },
});
