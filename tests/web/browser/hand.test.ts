// What hands do beside moving things: turning and scaling by the handles, taking files away.

import { readFileSync } from 'node:fs';
import type { Download, Page } from 'playwright-core';
import type {} from '../../../client/web/src/main';
import { answered, converged, said, sceneOf, serveAll, until } from './harness';

const { server, pages } = serveAll('cornell.glb');

const SIDE = { width: 1200, height: 800 };

type Placement = { translation: number[]; rotation: number[]; scale: number[] };

async function placementOf(node: number): Promise<Placement> {
  return (await sceneOf(server)).nodes[node] as unknown as Placement;
}

/**
 * Chooses the object, and drags the handles of a mode from so far beside their middle, in pixels. Returns its node.
 * `held`: what is done before it is let go.
 */
async function drag(
  page: Page,
  key: string,
  from: [number, number],
  by: [number, number],
  held: () => Promise<void> = async () => undefined,
): Promise<number> {
  const node = await page.evaluate(() => {
    const { edit } = window.viewer!;
    const index = edit.document.gltf.nodes!.findIndex(({ name }) => name === 'tall_block');
    edit.select({ node: index, material: undefined });
    return index;
  });
  await page.locator('canvas.view').focus();
  await page.keyboard.press(key);
  const middle = await page.evaluate(() => {
    const { viewer } = window.viewer!;
    viewer.rig.camera.updateMatrixWorld();
    const at = viewer.gizmo.middle.project(viewer.rig.camera);
    const box = viewer.canvas.getBoundingClientRect();
    return { x: box.left + ((at.x + 1) / 2) * box.width, y: box.top + ((1 - at.y) / 2) * box.height };
  });
  const [x, y] = [middle.x + from[0], middle.y + from[1]];
  await page.mouse.move(x, y);
  await page.mouse.down();
  for (let step = 1; step <= 8; ++step) await page.mouse.move(x + (by[0] * step) / 8, y + (by[1] * step) / 8);
  await held();
  await page.mouse.up();
  return node;
}

/** Where the middle of an object is, in metres. */
const middleOf = (page: Page, node: number) =>
  page.evaluate((n) => {
    window.viewer!.edit.select({ node: n, material: undefined });
    return window.viewer!.viewer.gizmo.middle.toArray();
  }, node);

const distance = (a: readonly number[], b: readonly number[]) => Math.hypot(...a.map((v, i) => v - b[i]!));

it.each([
  { name: 'turns', key: 'r', from: [55, 55], by: [-60, 40], member: 'rotation' },
  { name: 'scales', key: 'y', from: [0, 0], by: [50, -30], member: 'scale' },
] as const)('$name an object about its middle, in one step of undo', async ({ key, from, by, member }) => {
  const page = await pages.open(server.url, SIDE.width, SIDE.height);
  await converged(page);
  const index = (await sceneOf(server)).nodes.findIndex(({ name }) => name === 'tall_block');
  const before = await placementOf(index);
  const middle = await middleOf(page, index);
  const node = await drag(page, key, [...from], [...by]);
  expect(node).toBe(index);
  await answered(page);
  const after = await placementOf(node);
  expect(distance(after[member], before[member])).toBeGreaterThan(0.01);
  if (member === 'rotation') expect(Math.hypot(...after.rotation)).toBeCloseTo(1, 8);
  // The middle handle, which is taken hold of where a ratio of distances says nothing: 80 pixels, less what few moves miss.
  if (member === 'scale')
    for (const factor of after.scale.map((s, i) => s / before.scale[i]!)) {
      expect(factor).toBeGreaterThan(1.2);
      expect(factor).toBeLessThan(2.5);
    }
  expect(await page.evaluate(() => window.viewer!.edit.document.undoStack.length)).toBe(1);
  // Its middle stays where it was, though its origin lies elsewhere (the file's blocks stand in a corner of the box).
  expect(distance(await middleOf(page, node), middle)).toBeLessThan(0.05);
  // The last edit can be taken to a shell: it says the turn, and where that brings the origin.
  const patch = await page.evaluate(() => window.viewer!.edit.document.lastEdit!.map(({ path }) => path));
  expect(patch).toEqual([`/nodes/${node}/translation`, `/nodes/${node}/${member}`]);
  await page.keyboard.press('Control+z');
  const undone = await until(
    () => placementOf(node),
    (now) => JSON.stringify(now) === JSON.stringify(before),
  );
  expect(undone).toEqual(before);
  await converged(page);
});

it.each([
  { name: 'moved', key: 't', from: [0, 0], by: [-60, -20] },
  { name: 'turned', key: 'r', from: [55, 55], by: [-60, 40] },
  { name: 'scaled', key: 'y', from: [0, 0], by: [50, -30] },
] as const)('Escape puts back what is being $name, here and on the server, and keeps it selected', async (hand) => {
  const page = await pages.open(server.url, SIDE.width, SIDE.height);
  await converged(page);
  const camera = () => page.evaluate(() => window.viewer!.viewer.rig.camera.matrixWorld.toArray());
  const index = (await sceneOf(server)).nodes.findIndex(({ name }) => name === 'tall_block');
  const [before, place] = [await placementOf(index), await camera()];
  const shown = () =>
    page.evaluate((n) => {
      const { position, quaternion, scale } = window.viewer!.viewer.shown!.nodes.get(n)!;
      return [...position.toArray(), ...quaternion.toArray(), ...scale.toArray()];
    }, index);
  const stood = await shown();
  await drag(page, hand.key, [...hand.from], [...hand.by], async () => {
    // The server has heard of it before it is cancelled, ...
    await until(
      () => placementOf(index),
      (now) => JSON.stringify(now) !== JSON.stringify(before),
    );
    await page.keyboard.press('Escape');
    expect(distance(await shown(), stood)).toBeLessThan(1e-5);
    // ... and what the hand goes on to do means nothing, not even to the camera.
    for (let step = 1; step <= 4; ++step) await page.mouse.move(300 + 20 * step, 300);
  });
  await answered(page);
  expect(await placementOf(index)).toEqual(before);
  expect(distance(await shown(), stood)).toBeLessThan(1e-5);
  expect(await camera()).toEqual(place);
  const state = () =>
    page.evaluate(() => {
      const { document, selection } = window.viewer!.edit;
      return { node: selection?.node, steps: document.undoStack.length };
    });
  expect(await state()).toEqual({ node: index, steps: 0 });
  // With nothing in the hand it lets go of the selection, as ever.
  await page.keyboard.press('Escape');
  expect((await state()).node).toBeUndefined();
  await converged(page);
});

async function bytesOf(download: Download): Promise<Buffer> {
  return readFileSync(await download.path());
}

const PNG = Buffer.from([0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a]);

/** Width and height from a PNG's header. */
const sizeOf = (png: Buffer) => [png.readUInt32BE(16), png.readUInt32BE(20)];

it('saves files that are what their names say', async () => {
  const page = await pages.open(server.url, SIDE.width, SIDE.height);
  await converged(page);
  await page.getByRole('tab', { name: 'Share' }).click();
  const save = async (button: string): Promise<[string, Buffer]> => {
    const download = page.waitForEvent('download');
    await page.getByRole('button', { name: button }).click();
    const file = await download;
    return [file.suggestedFilename(), await bytesOf(file)];
  };
  const [viewName, view] = await save('Save picture');
  expect(viewName).toBe('view.png');
  expect(view.subarray(0, 8)).toEqual(PNG);
  const canvas = await page.evaluate(() => {
    const { canvas } = window.viewer!.viewer;
    return [canvas.clientWidth, canvas.clientHeight];
  });
  expect(sizeOf(view)).toEqual(canvas); // all pixels of the screen, however few are drawn while frames are slow

  for (const button of ['Lit scene (.glb)', 'Baked scene (.glb)']) {
    const [name, glb] = await save(button);
    expect(name, button).toMatch(/\.glb$/);
    expect(glb.toString('latin1', 0, 4)).toBe('glTF');
    expect(glb.readUInt32LE(8)).toBe(glb.length);
    const gltf = JSON.parse(glb.toString('utf8', 20, 20 + glb.readUInt32LE(12))) as {
      meshes: { primitives: { attributes: object }[] }[];
    };
    expect(gltf.meshes[0]!.primitives[0]!.attributes).toHaveProperty('TEXCOORD_1');
  }

  // What other tests did to the scene may have taken a page more.
  let pageCount = 1;
  while ((await fetch(`${server.url}/lightmaps/${pageCount}.exr`)).ok) ++pageCount;
  const saved: string[] = [];
  page.on('download', (file) => saved.push(file.suggestedFilename()));
  const [exrName, exr] = await save('Lightmaps (.exr)');
  await until(async () => saved.length, (n) => n === pageCount); // prettier-ignore
  expect(exrName).toBe('lightmap.0.exr');
  expect(exr.readUInt32LE(0)).toBe(20000630); // OpenEXR's magic number
  const served = Buffer.from(await (await fetch(`${server.url}/lightmaps/0.exr`)).arrayBuffer());
  expect(exr.equals(served)).toBe(true);

  const [, snapshot] = await save('Server snapshot (.png)');
  expect(snapshot.subarray(0, 8)).toEqual(PNG);
  expect(sizeOf(snapshot)).toEqual([1920, 1080]);
});

it('saves all of many lightmaps', async () => {
  const page = await pages.open(server.url, SIDE.width, SIDE.height);
  await converged(page);
  await page.route('**/lightmaps/*.exr', (route) => route.fulfill({ body: route.request().url() }));
  const count = 14; // browsers take ten at a time
  await page.evaluate((count) => {
    const { pages } = window.viewer!.viewer.set!.note;
    while (pages.length < count) pages.push(pages[0]!);
  }, count);
  const names: string[] = [];
  page.on('download', (download) => names.push(download.suggestedFilename()));
  await page.evaluate(() => window.viewer!.share.download('exr'));
  await until(async () => names.length, (n) => n === count); // prettier-ignore
  expect(names).toEqual(Array.from({ length: count }, (_, i) => `lightmap.${i}.exr`));
});

it('refuses a scale of 0 with a reason, by hand and by the handles', async () => {
  const page = await pages.open(server.url, SIDE.width, SIDE.height);
  await converged(page);
  const node = await page.evaluate(() => {
    const { edit, frame } = window.viewer!;
    const index = edit.document.gltf.nodes!.findIndex(({ name }) => name === 'tall_block');
    edit.select({ node: index, material: undefined });
    frame.showTab('Scene');
    return index;
  });
  const before = await placementOf(node);
  const field = page.getByLabel('Scale, y');
  const shown = await field.inputValue();
  await field.fill('0');
  await field.press('Enter');
  await said(page, /^“0” is not accepted: enter a number other than 0$/);
  expect(await field.inputValue()).toBe(shown);
  // Handles that are dragged over the middle of the object, and one that was taken hold of there.
  const factors = await page.evaluate((node) => {
    const { edit, viewer } = window.viewer!;
    edit.setGizmo('scale');
    const { controls, pivot } = viewer.gizmo as unknown as {
      controls: { dispatchEvent(event: object): void };
      pivot: { scale: { set(x: number, y: number, z: number): void } };
    };
    const { scale } = viewer.shown!.nodes.get(node)!;
    const was = scale.clone();
    pivot.scale.set(0, -3, NaN);
    controls.dispatchEvent({ type: 'objectChange' });
    return scale.divide(was).toArray();
  }, node);
  [0.01, 0.01, 1].forEach((factor, i) => expect(factors[i]).toBeCloseTo(factor, 6));
  await answered(page);
  await page.evaluate(() => window.viewer!.edit.document.endGesture());
  // What glTF allows is taken: an object turned inside out.
  await field.fill('-0.5');
  await field.press('Enter');
  await until(
    () => placementOf(node),
    ({ scale }) => scale[1] === -0.5,
  );
  await page.locator('canvas.view').focus();
  await page.keyboard.press('Control+z');
  await page.keyboard.press('Control+z');
  await until(
    () => placementOf(node),
    (now) => JSON.stringify(now) === JSON.stringify(before),
  );
});

it('takes a number with a comma, and says so where there is none', async () => {
  const page = await pages.open(server.url, SIDE.width, SIDE.height);
  await converged(page);
  await page.getByRole('tab', { name: 'Solve' }).click();
  const goal = page.getByLabel('Error, %');
  await goal.fill('1,9');
  await goal.press('Enter');
  const settings = () =>
    page.evaluate(
      async () => (await window.viewer!.connection.call<{ settings: { targetError: number } }>('status')).settings,
    );
  const changed = await until(settings, ({ targetError }) => targetError !== 0.02);
  expect(changed.targetError).toBeCloseTo(0.019, 12);
  await page.getByText('(target 1.9 %)').waitFor();
  await goal.fill('half');
  await goal.press('Enter');
  await said(page, /^“half” is not accepted: enter a percentage above 0, up to 100$/);
  expect(await goal.inputValue()).toBe('1.9');
  // What the server refuses does not stay in the field either.
  const texels = page.getByLabel('Texels, approx.');
  const before = await texels.inputValue();
  await texels.fill('1e15');
  await texels.press('Enter');
  await until(
    () => texels.inputValue(),
    (value) => value === before,
  );
  // What somebody else asks for is shown here, and what is being typed stays.
  await texels.pressSequentially('5');
  const other = await pages.open(server.url, SIDE.width, SIDE.height);
  await converged(other);
  await other.evaluate(() => window.viewer!.connection.call('solve.configure', { targetError: 0.01 }));
  await page.getByText('(target 1 %)').waitFor();
  // So it is where the solve has nothing to do for it, and tells of no progress.
  await converged(page);
  await other.evaluate(() => window.viewer!.connection.call('solve.configure', { targetError: 0.012 }));
  await page.getByText('(target 1.2 %)').waitFor();
  await other.evaluate(() => window.viewer!.connection.call('solve.configure', { targetError: 0.01 }));
  await page.getByText('(target 1 %)').waitFor();
  await until(() => goal.inputValue(), (value) => value === '1'); // prettier-ignore
  expect(await texels.inputValue()).toBe(`${before}5`);
  await texels.fill(before);
  await page.evaluate(() => window.viewer!.connection.call('solve.configure', { targetError: 0.02 }));
});
