// What is written passes the Khronos validator.

import { readFileSync } from 'node:fs';
import { basename, join } from 'node:path';
import { validateBytes } from 'gltf-validator';
import { withOddMaterials, withTexture } from './glb';
import { filesBelow, folder, inTurns, SCENES, SHARED, solve } from './solve';

const out = folder();

/** How the file is written is at stake, not how true its light is. */
const QUICK = ['--quiet', '--error', '0.3', '--time-limit', '2', '--texels', '2000'];

interface Faults {
  errors: string[];
  cutoffs: string[];
}

async function faultsOf(file: string): Promise<Faults> {
  const { issues } = await validateBytes(new Uint8Array(readFileSync(file)), { maxIssues: 0 });
  const named = issues.messages.map(({ code, pointer, severity }) => ({
    text: `${code} at ${pointer ?? '?'}`,
    severity,
  }));
  return {
    errors: named.filter(({ severity }) => severity === 0).map(({ text }) => text),
    cutoffs: named.filter(({ text }) => text.startsWith('MATERIAL_ALPHA_CUTOFF')).map(({ text }) => text),
  };
}

/** Lit and unlit files of all scenes, and what is wrong with them. */
async function faultsOfAll(scenes: readonly string[]): Promise<Record<string, Faults>> {
  const all: Record<string, Faults> = {};
  const wanted = scenes.flatMap((scene, i) => [
    { scene, name: `${i}-${basename(scene)}`, options: [] },
    { scene, name: `${i}-unlit-${basename(scene)}`, options: ['--unlit'] },
  ]);
  await inTurns(wanted, 2, async ({ scene, name, options }) => {
    const file = join(out, name.replace(/\.gltf$/, '.glb'));
    const faults = await solve(scene, file, ...QUICK, ...options).then(
      () => faultsOf(file),
      (failure: Error) => ({ errors: [failure.message], cutoffs: [] }),
    );
    if (faults.errors.length + faults.cutoffs.length > 0) all[name] = faults;
  });
  return all;
}

it('finds what is wrong with a file', async () => {
  // POSITION of a primitive that is not there.
  const json = JSON.stringify({
    asset: { version: '2.0' },
    meshes: [{ primitives: [{ attributes: { POSITION: 7 } }] }],
  });
  const { issues } = await validateBytes(new TextEncoder().encode(json));
  expect(issues.numErrors).toBeGreaterThan(0);
});

it('every scene of our own, lit and unlit', async () => {
  const scenes = filesBelow(SCENES, /\.glb$/);
  expect(scenes.length).toBeGreaterThan(5);
  expect(await faultsOfAll(scenes)).toEqual({});
});

it('scenes for engines', async () => {
  const room = join(out, 'room_textured.glb');
  const odd = join(out, 'room_odd.glb');
  withTexture(join(SCENES, 'room_small.glb'), room, ['floor', 'red_wall']);
  withOddMaterials(room, odd, 'floor', 'red_wall');
  const all: Record<string, Faults> = {};
  for (const scene of [odd, join(SCENES, 'room_lights.glb'), join(SCENES, 'room_small_shade.glb')]) {
    const folder = join(out, `three-${basename(scene)}`);
    await solve(scene, folder, ...QUICK, '--for', 'three');
    const faults = await faultsOf(join(folder, 'scene.glb'));
    if (faults.errors.length + faults.cutoffs.length > 0) all[basename(scene)] = faults;
  }
  expect(all).toEqual({});
});

it.skipIf(!SHARED)(
  "every scene of others that is read, lit and unlit (skipped: '../shared' is not there)",
  async () => {
    const slow = /\/(cloud|leak|budget)-/; // nothing about them is special in how they are written
    const scenes = [
      ...filesBelow(join(SHARED, 'cases'), /\.glb$/),
      ...filesBelow(join(SHARED, 'scenes'), /\.(glb|gltf)$/),
    ];
    const read = scenes.filter((file) => !slow.test(file));
    expect(read.length).toBeGreaterThan(20);
    expect(await faultsOfAll(read)).toEqual({});
  },
);
