// What is made by and by, and overtaken while it is made: layouts that come faster than their geometry, lines and graphics
// cards that go in between, files that are dropped one after the other. Each is held back on purpose, as long as it takes.

import type { Page, Route } from 'playwright-core';
import type {} from '../../../client/web/src/main';
import { countAlive, grown, mayLive } from './card';
import { converged, difference, drawn, pixels, said, sceneOf, SCENES, serveEach, squares, until } from './harness';

const { pages, serve } = serveEach();

declare global {
  interface Window {
    takeCardBack?: () => void;
  }
}

/** What of the viewer is nobody else's business. */
interface Inside {
  programs: { compile(scene: object): Promise<void> };
}

/** Requests for a path wait in `held` until each is let go; later ones go on when `open` is set. */
async function holdBack(page: Page, path: string): Promise<{ held: Route[]; open: boolean }> {
  const gate = { held: [] as Route[], open: false };
  await page.route(
    (url) => url.pathname === path,
    (route) => (gate.open ? route.continue() : void gate.held.push(route)),
  );
  return gate;
}

/** Until so many wait. */
async function heldBack({ held }: { held: Route[] }, count: number): Promise<void> {
  await until(
    async () => held.length,
    (now) => now >= count,
  );
}

const configure = (page: Page, texels: number) =>
  page.evaluate((t) => window.viewer!.connection.call('solve.configure', { texels: t }), texels);

const layout = (page: Page) => page.evaluate(() => window.viewer!.viewer.set!.note.layout);

/** What the browser's console tells of requests that a test has broken; nothing else may be told. */
function forgiveRequests(): void {
  const others = pages.complaints.splice(0).filter((text) => !/Failed to load resource/.test(text));
  expect(others).toEqual([]);
}

it('shows the newest of layouts that come faster than their geometry, and keeps nothing of the others', async () => {
  const server = await serve(`${SCENES}/cornell.glb`);
  const page = await pages.open('about:blank', 900, 600);
  await countAlive(page);
  await page.goto(server.url);
  await converged(page);
  await drawn(page);
  const before = await mayLive(page);

  // While it is on the line: what is not wanted any more does not go on being loaded.
  const given: string[] = [];
  page.on('requestfailed', (request) => given.push(new URL(request.url()).search));
  const gate = await holdBack(page, '/scene.glb');
  for (const [i, texels] of [9000, 10_000, 11_000].entries()) {
    await configure(page, texels);
    await heldBack(gate, i + 1);
  }
  await until(
    async () => given.length,
    (count) => count === 2,
  );
  expect(given).toEqual(gate.held.slice(0, 2).map((route) => new URL(route.request().url()).search));
  gate.open = true;
  await gate.held[2]!.continue();
  await converged(page);

  // While it is read, and while the card makes its programs.
  const kept = await page.evaluate(async () => {
    const { viewer } = window.viewer!;
    const { programs } = viewer as unknown as Inside;
    const glb = await (await fetch('/scene.glb')).arrayBuffer();
    const { note } = viewer.set!;
    const expect = (step: number) => viewer.layouts.expect({ ...note, layout: note.layout + 1000 + step })!;
    const first = expect(0);
    const reading = viewer.load(glb.slice(0), first);
    const second = expect(1);
    await reading;
    const compile = programs.compile.bind(programs);
    let begun = () => {};
    let release = () => {};
    const compiling = new Promise<void>((resolve) => (begun = resolve));
    const released = new Promise<void>((resolve) => (release = resolve));
    programs.compile = async (scene) => {
      await compile(scene);
      begun();
      await released;
    };
    const loading = viewer.load(glb.slice(0), second);
    await compiling;
    const third = expect(2);
    release();
    await loading;
    delete (programs as Partial<Inside['programs']>).compile;
    return { staged: viewer.layouts.stagedScene !== undefined, third: viewer.set === third };
  });
  expect(kept).toEqual({ staged: false, third: true });
  await configure(page, 12_000);
  await converged(page);
  await drawn(page);
  const more = await until(
    () => grown(page, before),
    (kinds) => kinds.length === 0,
  );
  expect(more).toEqual([]);
});

it('fetches geometry again when the line broke, though its light is here', async () => {
  const server = await serve(`${SCENES}/cornell.glb`);
  const page = await pages.open('about:blank', 900, 600);
  const gate = await holdBack(page, '/scene.glb');
  await page.goto(server.url);
  await page.waitForFunction(
    () => window.viewer?.viewer.set?.complete === true && window.viewer.bookmark !== undefined,
  );
  await heldBack(gate, 1);
  // The server will say that it has nothing new: all light is here.
  await page.evaluate(() => {
    const { connection } = window.viewer! as unknown as { connection: { socket: WebSocket } };
    connection.socket.close();
  });
  gate.open = true;
  await gate.held[0]!.abort('connectionreset');
  await said(page, /^Reconnected$/);
  await converged(page);
  expect(Math.max(...(await pixels(page, 16)))).toBeGreaterThan(60);
  forgiveRequests();
});

it('takes a bookmark for the layout that it is of: one that is overtaken says nothing about the next', async () => {
  const server = await serve(`${SCENES}/cornell.glb`);
  const page = await pages.open(server.url, 900, 600);
  await converged(page);
  const { complete, moved } = await page.evaluate(async () => {
    const app = window.viewer!;
    const { viewer, bookmarks } = app;
    const { told } = app.session;
    const tiles = app.tiles as unknown as { sent: number; take(reply: { ticket: number; bytes: number }): void };
    const { tileVersion } = told.resume!;
    const ticket = ++tiles.sent; // a tile that is being decoded
    bookmarks.take({ ...app.bookmark!, tileVersion: tileVersion + 1 });
    const { note } = viewer.set!;
    const set = viewer.layouts.expect({ ...note, layout: note.layout + 1000 })!;
    tiles.take({ ticket, bytes: 0 });
    return { complete: set.complete, moved: told.resume!.tileVersion - tileVersion };
  });
  expect(complete).toBe(false);
  expect(moved).toBe(0);
});

it('shows a layout that has come while the graphics card was gone', async () => {
  const server = await serve(`${SCENES}/cornell.glb`);
  const page = await pages.open(server.url, 480, 480);
  await converged(page);
  await page.evaluate(async () => {
    const { canvas, renderer } = window.viewer!.viewer;
    const lost = new Promise((resolve) => canvas.addEventListener('webglcontextlost', resolve, { once: true }));
    const extension = renderer.getContext().getExtension('WEBGL_lose_context')!;
    window.takeCardBack = () => extension.restoreContext(); // one that is lost gives no extensions
    extension.loseContext();
    await lost;
  });
  const before = await layout(page);
  const loaded = page.waitForResponse((response) => new URL(response.url()).pathname === '/scene.glb');
  await configure(page, 9000);
  await (await loaded).finished();
  await until(
    () => layout(page),
    (now) => now !== before,
  );
  await page.waitForFunction(
    () =>
      window.viewer!.viewer.layouts.stagedScene !== undefined ||
      window.notes!.some((text) => text.startsWith('The geometry')),
  );
  await page.evaluate(async () => {
    const { canvas } = window.viewer!.viewer;
    const restored = new Promise((resolve) => canvas.addEventListener('webglcontextrestored', resolve, { once: true }));
    window.takeCardBack!();
    await restored;
  });
  await converged(page);
  const fresh = await pages.open(server.url, 480, 480);
  await converged(fresh);
  expect(difference(await pixels(page, 30), await pixels(fresh, 30)).mean).toBeLessThan(3);
});

it('keeps no pages of a layout or a scene that is gone, whatever was looked at', async () => {
  const server = await serve(`${SCENES}/cornell.glb`);
  const page = await pages.open(server.url, 900, 600);
  await converged(page);
  const planes = () => page.evaluate(() => window.viewer!.viewer.pagesView.scene.children.length);
  await page.evaluate(() => window.viewer!.view.setMode('pages'));
  expect(await planes()).toBeGreaterThan(0);
  await page.evaluate(() => window.viewer!.view.setMode('lit'));
  await configure(page, 9000);
  await converged(page);
  expect(await planes()).toBe(0);
  await page.evaluate(() => window.viewer!.view.setMode('error'));
  await page.waitForFunction(() => window.viewer!.viewer.dataSet !== undefined);
  await server.stop();
  await page.getByText(/No connection/).waitFor();
  expect(await page.evaluate(() => window.viewer!.viewer.dataSet !== undefined)).toBe(true); // it may come back
  await page.evaluate(() => window.viewer!.viewer.clear());
  expect(await page.evaluate(() => window.viewer!.viewer.dataSet)).toBeUndefined();
});

/** A square that shines, somewhere. */
const square = (name: string, x: number) => squares([{ name, mesh: 0, translation: [x, 0, 0] }]);

it('shows the last of the files that are dropped, and one from where one was when that is no scene', async () => {
  const server = await serve(`${SCENES}/cornell.glb`);
  const page = await pages.open(server.url, 900, 600);
  await converged(page);
  await page.locator('canvas.view').focus();
  for (let i = 0; i < 3; ++i) await page.keyboard.press('ArrowRight');
  const eye = () => page.evaluate(() => window.viewer!.viewer.rig.camera.position.toArray());
  const drop = (name: string, text: string) =>
    page.evaluate(([n, t]) => void window.viewer!.scene.loadFile(new File([t!], n!)), [name, text]);
  const gate = await holdBack(page, '/uploads');
  const given: string[] = [];
  page.on('requestfailed', (request) => given.push(new URL(request.url()).search));

  const before = await eye();
  await drop('slow.gltf', square('slow', 200));
  await heldBack(gate, 1);
  await drop('notes.gltf', 'not a scene');
  await heldBack(gate, 2);
  await gate.held[1]!.continue();
  await said(page, /^notes\.gltf: /);
  await until(
    async () => given,
    (all) => all.length > 0,
  );
  expect(given).toEqual(['?name=slow.gltf']);
  await configure(page, 9000); // shown anew: from the same place
  await converged(page);
  expect(await eye()).toEqual(before);

  await drop('slow.gltf', square('slow', 200));
  await heldBack(gate, 3);
  await drop('quick.gltf', square('quick', 500));
  await heldBack(gate, 4);
  await gate.held[3]!.continue();
  await said(page, /quick\.gltf loaded/);
  const [x] = await until(eye, ([now]) => Math.abs(now! - 500) < 50);
  expect(Math.abs(x! - 500)).toBeLessThan(50);
  expect(await page.evaluate(() => window.notes!.filter((text) => text.startsWith('slow.gltf:')))).toEqual([]);

  // What was given up had left the page whole, and reaches the server only now: it is not loaded any more.
  const request = gate.held[2]!.request();
  const late = await fetch(request.url(), {
    method: request.method(),
    body: square('slow', 200),
    headers: { 'Content-Type': 'application/octet-stream' },
  });
  expect(late.ok).toBe(true);
  expect((await sceneOf(server)).nodes[0]!.name).toBe('quick');
  forgiveRequests();
});

it('asks for the last of the files that are dropped after those before it, however soon it is there', async () => {
  const server = await serve(`${SCENES}/cornell.glb`);
  const page = await pages.open(server.url, 480, 480);
  await converged(page);
  // Both are on the server before the first is asked for.
  const asked = await page.evaluate(
    async ([first, second]) => {
      const { connection, scene } = window.viewer!;
      const call = connection.call.bind(connection);
      const urls: string[] = [];
      let dropped: Promise<void> | undefined;
      connection.call = <T>(method: string, params: { url?: string } = {}) => {
        if (method === 'scene.load') urls.push(params.url!);
        // The second is dropped when the first has just been asked for.
        if (method === 'scene.load') dropped ??= scene.loadFile(new File([second!], 'second.gltf'));
        return call<T>(method, params);
      };
      await scene.loadFile(new File([first!], 'first.gltf'));
      await dropped;
      return urls.length;
    },
    [square('first', 300), square('second', 600)],
  );
  expect(asked).toBe(2);
  expect((await sceneOf(server)).nodes[0]!.name).toBe('second');
  expect(await page.evaluate(() => window.notes!.filter((text) => /^first\.gltf loaded/.test(text)))).toEqual([]);
});

it('shows errors of the layout that is on the screen, until the next one takes its place', async () => {
  const server = await serve(`${SCENES}/cornell.glb`);
  const page = await pages.open(server.url, 480, 480);
  await converged(page);
  await page.evaluate(() => window.viewer!.view.setMode('error'));
  await page.waitForFunction(() => window.viewer!.viewer.layouts.shownData?.complete === true);
  await drawn(page);
  await page.evaluate(() => {
    const seen: { layout: number; data: (number | undefined)[]; scale: number }[] = [];
    (window as unknown as { seen: object[] }).seen = seen;
    const { view, viewer } = window.viewer!;
    const others = view.onDrawn.bind(view);
    view.onDrawn = () => {
      others();
      const data = new Set<number | undefined>();
      let scale = Infinity;
      viewer.shown!.eachMaterial(({ page, own }) => {
        if (!page) return;
        const isData = viewer.layouts.shownData?.pages.some(({ texture }) => texture === own.dataPage.value);
        data.add(isData ? viewer.layouts.shownData!.note.layout : undefined);
        scale = Math.min(scale, own.dataScale.value);
      });
      seen.push({ layout: viewer.shown!.set.note.layout, data: [...data], scale });
    };
  });
  const before = await layout(page);
  const gate = await holdBack(page, '/scene.glb');
  await configure(page, 9000);
  await heldBack(gate, 1);
  for (let i = 0; i < 3; ++i) await drawn(page); // tiles of the new layout are coming
  gate.open = true;
  await gate.held[0]!.continue();
  await until(
    () => page.evaluate(() => window.viewer!.viewer.shown!.set.note.layout),
    (now) => now !== before,
  );
  await drawn(page);
  const seen = await page.evaluate(
    () => (window as unknown as { seen: { layout: number; data: (number | undefined)[]; scale: number }[] }).seen,
  );
  expect(new Set(seen.map((frame) => frame.layout)).size).toBe(2);
  for (const frame of seen) expect(frame.data).toEqual([frame.layout]);
  for (const frame of seen) expect(frame.scale).toBeGreaterThan(0);
});

it('does not take the geometry of another layout than it has asked for', async () => {
  const server = await serve(`${SCENES}/cornell.glb`);
  const page = await pages.open(server.url, 480, 480);
  await converged(page);
  // A request that is on its way for long: the pages have another layout when it arrives.
  const gate = await holdBack(page, '/scene.glb');
  await configure(page, 9000);
  await heldBack(gate, 1);
  const old = gate.held[0]!.request().url();
  await configure(page, 10_000);
  await heldBack(gate, 2);
  const refused = await fetch(old);
  expect(refused.status).toBe(204);
  expect((await fetch(gate.held[1]!.request().url())).status).toBe(200);
  // One that is not there any more says nothing to the reader: the next is on its way.
  gate.open = true;
  await page.evaluate(async () => {
    const { viewer, geometry } = window.viewer!;
    await geometry.load({ ...viewer.set!.note, uvs: '/scene.glb?layout=0' }, viewer.set!);
  });
  await configure(page, 11_000);
  await converged(page);
  expect(await page.evaluate(() => window.notes!.filter((text) => text.startsWith('The geometry')))).toEqual([]);
  forgiveRequests();
});
