// Scenes that take another's place while somebody is at work on that.

import { mkdtempSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import type { Page } from 'playwright-core';
import type {} from '../../../client/web/src/main';
import { converged, putScene, said, sceneOf, serveEach, squares, until } from './harness';

const { pages, serve } = serveEach();

declare global {
  interface Window {
    letHear?: () => void;
  }
}

const room = (...names: string[]) => squares(names.map((name, i) => ({ name, mesh: 0, translation: [2 * i, 0, 0] })));
const FIRST = room('floor', 'box', 'shelf');
const OTHER = room('lawn', 'tree', 'bench');

async function names(page: Page): Promise<(string | undefined)[]> {
  return page.evaluate(() => (window.viewer!.edit.document.gltf.nodes ?? []).map(({ name }) => name));
}

/** Without a line, as long as the test wants it. Returns what brings it back. */
async function withoutLine(page: Page): Promise<() => Promise<void>> {
  await page.evaluate(() => {
    const { connection } = window.viewer! as unknown as { connection: { socket: WebSocket; open: () => void } };
    connection.open = () => undefined;
    connection.socket.close();
  });
  await page.getByText(/No connection/).waitFor();
  return () =>
    page.evaluate(() => {
      const connection = window.viewer!.connection as { open?: () => void };
      delete connection.open;
      connection.open!();
    });
}

const move = (page: Page, node: number, x: number) =>
  page.evaluate(
    ({ node, x }) => {
      const { document } = window.viewer!.edit;
      document
        .edit('Move', [{ op: 'replace', path: `/nodes/${node}/translation`, value: [x, 0, 0] }])
        .catch(() => undefined);
    },
    { node, x },
  );

it('makes edits that waited for the line once it is back, and none of them in a scene that was loaded meanwhile', async () => {
  const server = await serve();
  await putScene(server, FIRST);
  const page = await pages.open(server.url, 900, 600);
  await converged(page);
  let back = await withoutLine(page);
  await move(page, 1, 3);
  await move(page, 2, 9);
  await back();
  await until(
    async () => (await sceneOf(server)).nodes.map(({ translation }) => translation[0]),
    (all) => all.join() === '0,3,9',
  );
  await converged(page);
  back = await withoutLine(page);
  await page.evaluate(() => window.viewer!.edit.select({ node: 1, material: 0 }));
  await move(page, 1, 30);
  await move(page, 2, 90);
  await putScene(server, OTHER);
  await back();
  await said(page, /^Move: another scene was loaded meanwhile$/);
  await converged(page);
  expect(await names(page)).toEqual(['lawn', 'tree', 'bench']);
  expect((await sceneOf(server)).nodes.map(({ translation }) => translation[0])).toEqual([0, 2, 4]);
  expect(await page.evaluate(() => window.viewer!.edit.selection)).toBeUndefined();
});

it('makes no edit in a scene that it has not heard of yet', async () => {
  const server = await serve();
  await putScene(server, FIRST);
  const page = await pages.open(server.url, 900, 600);
  await converged(page);
  // What is on its way to the server while the news comes: here the news waits, as long as it takes.
  await page.evaluate(() => {
    const { scene } = window.viewer!;
    const held: number[] = [];
    scene.onLoaded = (revision) => void held.push(revision);
    window.letHear = () => {
      delete (scene as Partial<typeof scene>).onLoaded;
      for (const revision of held) scene.onLoaded(revision);
    };
  });
  await putScene(server, OTHER);
  await move(page, 1, 30);
  await said(page, /^Move: another scene was loaded$/);
  await page.evaluate(() => window.letHear!());
  await until(() => names(page), (all) => all[0] === 'lawn'); // prettier-ignore
  expect((await sceneOf(server)).nodes.map(({ translation }) => translation[0])).toEqual([0, 2, 4]);
  await move(page, 1, 3);
  await until(
    async () => (await sceneOf(server)).nodes.map(({ translation }) => translation[0]),
    (all) => all.join() === '0,3,4',
  );
});

it('lets go of what is dragged when somebody loads another scene, and moves nothing in that', async () => {
  const server = await serve();
  await putScene(server, FIRST);
  const page = await pages.open(server.url, 900, 600);
  await converged(page);
  await page.evaluate(() => window.viewer!.edit.select({ node: 1, material: 0 }));
  const handle = await until(
    () =>
      page.evaluate(() => {
        const { gizmo, rig, canvas } = window.viewer!.viewer;
        const { x, y } = gizmo.middle.project(rig.camera);
        const box = canvas.getBoundingClientRect();
        return { x: box.left + ((x + 1) / 2) * box.width, y: box.top + ((1 - y) / 2) * box.height };
      }),
    ({ x }) => Number.isFinite(x),
  );
  await page.mouse.move(handle.x, handle.y);
  await page.waitForFunction(() => window.viewer!.viewer.gizmo.busy);
  await page.mouse.down();
  await page.mouse.move(handle.x + 40, handle.y, { steps: 4 });
  await page.waitForFunction(() => window.viewer!.viewer.gizmo.dragging);
  await putScene(server, OTHER);
  await until(() => names(page), (all) => all[0] === 'lawn'); // prettier-ignore
  await page.mouse.move(handle.x + 90, handle.y + 20, { steps: 6 });
  // The picture is still of the scene before: what is clicked in it has a number that means another object now.
  await page.evaluate(() => window.viewer!.edit.selectHit(window.viewer!.viewer.shown!.nodes.get(2)));
  expect(await page.evaluate(() => window.viewer!.edit.selection)).toBeUndefined();
  await page.mouse.up();
  await converged(page);
  expect((await sceneOf(server)).nodes.map(({ translation }) => translation[0])).toEqual([0, 2, 4]);
  // What was held by the handles does not keep the camera from being turned.
  const eye = () => page.evaluate(() => window.viewer!.viewer.rig.camera.position.toArray().join());
  const before = await eye();
  await page.mouse.move(450, 80);
  await page.mouse.down();
  await page.mouse.move(520, 90, { steps: 4 });
  await page.mouse.up();
  await until(eye, (now) => now !== before);
});

it('looks at the scene that a server has come back with, and not at its objects by the numbers of the last', async () => {
  const folder = mkdtempSync(join(tmpdir(), 'viewer-'));
  const file = join(folder, 'scene.gltf');
  const far = squares([
    { name: 'far', mesh: 0, translation: [500, 0, 0] },
    { name: 'away', mesh: 0, translation: [502, 0, 0] },
  ]);
  writeFileSync(file, FIRST);
  const server = await serve(file);
  const page = await pages.open(server.url, 900, 600);
  await converged(page);
  await page.evaluate(() => window.viewer!.edit.select({ node: 1, material: 0 }));
  const eye = () => page.evaluate(() => window.viewer!.viewer.rig.camera.position.toArray());
  await page.locator('canvas.view').focus();
  for (let i = 0; i < 3; ++i) await page.keyboard.press('ArrowRight');
  let before: number[] = [];
  await until(eye, (now) => now.join() === before.join() || !(before = now)); // it comes to rest by and by
  await server.stop();
  await server.start(); // with the same one
  await said(page, /^Reconnected$/);
  await converged(page);
  (await eye()).forEach((v, i) => expect(v).toBeCloseTo(before[i]!, 6));
  expect(await page.evaluate(() => window.viewer!.edit.selection?.node)).toBe(1);
  await server.stop();
  writeFileSync(file, far);
  await server.start();
  await until(() => names(page), (all) => all[0] === 'far'); // prettier-ignore
  await converged(page);
  const after = await until(eye, ([x]) => Math.abs(x! - 500) < 50);
  expect(Math.abs(after[0]! - 500)).toBeLessThan(50);
  expect(await page.evaluate(() => window.viewer!.edit.selection)).toBeUndefined();
});

it('tells of a scene that somebody loaded while the own one was asked for, where that does not come', async () => {
  const server = await serve();
  await putScene(server, FIRST);
  const page = await pages.open(server.url, 900, 600);
  await converged(page);
  await page.evaluate(async (text) => {
    const { connection, edit, scene } = window.viewer!;
    const call = connection.call.bind(connection) as (method: string, params?: object) => Promise<never>;
    connection.call = async (method: string, params?: object) => {
      if (method !== 'scene.load') return call(method, params);
      const { revision } = edit.document;
      const headers = { 'Content-Type': 'model/gltf+json' };
      await fetch('/scene?name=hers.gltf&client=Ann', { method: 'PUT', body: text, headers });
      while (edit.document.revision === revision) await new Promise((resolve) => setTimeout(resolve, 20));
      throw new Error('is no scene');
    };
    await scene.loadFile(new File(['x'], 'mine.gltf'));
    connection.call = call;
  }, OTHER);
  await said(page, /^mine\.gltf: is no scene$/);
  await said(page, /^Ann loaded hers\.gltf$/);
});
