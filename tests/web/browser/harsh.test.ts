// Scenes that are large, odd or mean, and whether the page gives back what it takes.

import type { Page } from 'playwright-core';
import type {} from '../../../client/web/src/main';
import { alive, countAlive, grown, mayLive } from './card';
import { converged, drawn, type GltfNode, pixels, putScene, said, SCENES, serveEach, squares, until } from './harness';

const { pages, serve } = serveEach();

/** Until the page shows the scene that the server has, lit. */
async function shown(page: Page, node: string): Promise<void> {
  await page.waitForFunction((name) => window.viewer?.edit.document.gltf.nodes?.some((n) => n.name === name), node);
  await converged(page);
}

it('takes names for text, however they are written and however long they are', async () => {
  const server = await serve();
  const evil = '<img src=x onerror="window.hacked=1"><script>window.hacked=1</script>';
  const long = 'W'.repeat(10_000);
  await putScene(
    server,
    squares(
      [
        { name: evil, mesh: 0 },
        { name: long, mesh: 0, translation: [0, 1, 0] },
        { name: 'last', mesh: 0, translation: [2, 0, 0] },
      ],
      [{ name: evil, emissiveFactor: [1, 1, 1] }],
      long,
    ),
  );
  const page = await pages.open(server.url, 1200, 800);
  await shown(page, 'last');
  await page.getByRole('tab', { name: 'Scene' }).click();
  for (const index of [0, 1]) {
    await page.locator('.tree button').nth(index).click();
    await page.getByText(/^Material: /).waitFor();
  }
  // Another page, of such a name, changes such an object: that is told, too.
  await page.evaluate(
    async ({ name, address }) => {
      const socket = new WebSocket(`ws://${address}/ws`, 'radiosity.v1');
      await new Promise((resolve) => (socket.onopen = resolve));
      const send = (id: number, method: string, params: object) =>
        socket.send(JSON.stringify({ jsonrpc: '2.0', id, method, params }));
      send(1, 'hello', { client: name });
      for (const [i, node] of [0, 1].entries())
        send(2 + i, 'scene.patch', {
          patch: [{ op: 'replace', path: `/nodes/${node}/translation`, value: [0, 0.5 + node, 0] }],
        });
    },
    { name: evil.slice(0, 40), address: new URL(server.url).host },
  );
  await said(page, /changed .*position/);
  expect(await page.evaluate(() => 'hacked' in window)).toBe(false);
  expect(await page.locator('img').count()).toBe(0);
  // Nothing grows out of its place.
  const wide = await page.evaluate(() =>
    [...document.querySelectorAll('.panel *, .toasts *')]
      .filter((e) => e.getBoundingClientRect().right > innerWidth + 1)
      .map((e) => e.className || e.tagName),
  );
  expect(wide).toEqual([]);
  const tall = await page.evaluate(() =>
    Math.max(...[...document.querySelectorAll('.toast, .panel h3')].map((e) => e.clientHeight)),
  );
  expect(tall).toBeLessThan(400);
});

it('lists ten thousand objects, and finds one of them by its name', async () => {
  const server = await serve();
  const nodes: GltfNode[] = Array.from({ length: 10_000 }, (_, i) => ({
    name: `object ${i}`,
    ...(i % 100 === 0 ? { mesh: 0, translation: [(i / 100) % 10, 0, Math.floor(i / 1000)] } : {}),
  }));
  nodes.push({ name: 'the last', mesh: 0, translation: [0, 1, 0] });
  await putScene(server, squares(nodes));
  const page = await pages.open(server.url, 1200, 800);
  await shown(page, 'the last');
  await page.getByRole('tab', { name: 'Scene' }).click();
  await page.getByText(/and 9601 more/).waitFor();
  await page.getByLabel('Find an object by name').fill('THE LAST');
  await page.getByRole('button', { name: 'the last', exact: true }).click();
  await page.getByText('Position, m').waitFor();
  expect(await page.locator('.tree button').count()).toBe(1);
  await page.getByLabel('Find an object by name').fill('nothing of that name');
  await page.locator('.tree').getByText('None found.').waitFor();
});

it('shows scenes without anything, and forgets one that its server has no more', async () => {
  const server = await serve();
  await putScene(
    server,
    JSON.stringify({ asset: { version: '2.0' }, scenes: [{}], scene: 0, nodes: [{ name: 'nothing' }] }),
  );
  const page = await pages.open(server.url, 900, 600);
  await page.waitForFunction(() => window.viewer?.viewer.shown !== undefined);
  await page.keyboard.press('f');
  await page.keyboard.press('m');
  await putScene(server, squares([{ name: 'one', mesh: 0 }]));
  await shown(page, 'one');
  await server.stop();
  await page.getByText(/No connection/).waitFor();
  await server.start(); // without a scene
  await page.getByText('No scene yet').waitFor();
  await page.waitForFunction(() => window.viewer!.viewer.shown === undefined);
  await putScene(server, squares([{ name: 'two', mesh: 0 }]));
  await shown(page, 'two');
});

it('looks at a scene that somebody else has loaded, and stays where one was for the same one', async () => {
  const server = await serve(`${SCENES}/cornell.glb`);
  const page = await pages.open(server.url, 900, 600);
  await converged(page);
  await page.locator('canvas.view').focus();
  for (let i = 0; i < 3; ++i) await page.keyboard.press('ArrowRight');
  const eye = () => page.evaluate(() => window.viewer!.viewer.rig.camera.position.toArray());
  const before = await eye();
  await page.evaluate(() => window.viewer!.connection.call('solve.configure', { texels: 9000 }));
  await converged(page);
  expect(await eye()).toEqual(before);
  await putScene(server, squares([{ name: 'far away', mesh: 0, translation: [500, 0, 0] }]));
  await shown(page, 'far away');
  const after = await until(eye, ([x]) => Math.abs(x! - 500) < 50);
  expect(Math.abs(after[0]! - 500)).toBeLessThan(50);
});

it('keeps a page of many texels, and forty pages, within the memory that it states', async () => {
  // As the server would tell of them; tiles of all would take minutes here.
  const server = await serve(`${SCENES}/cornell.glb`);
  const page = await pages.open(server.url, 900, 600);
  await converged(page);
  const bytes = await page.evaluate(async () => {
    const { viewer } = window.viewer!;
    const taken: number[] = [];
    const layouts = [
      [{ width: 4096, height: 4096, mips: 13 }],
      Array.from({ length: 40 }, () => ({ width: 1024, height: 1024, mips: 11 })),
      Array.from({ length: 40 }, () => ({ width: 4096, height: 4096, mips: 13 })),
    ];
    for (const [i, pages] of layouts.entries()) {
      const note = { ...viewer.set!.note, layout: 1000 + i, pages };
      taken.push(viewer.layouts.expect(note)!.bytes);
      await new Promise((resolve) => setTimeout(resolve, 100));
    }
    return taken;
  });
  expect(bytes[0]).toBeLessThanOrEqual(86 * 2 ** 20);
  expect(bytes[1]).toBeLessThanOrEqual(214 * 2 ** 20);
  expect(bytes[2]).toBeLessThanOrEqual(512 * 2 ** 20);
});

it.each([
  ['forty pages', 40, 1024, 214],
  ['a page of 4096 x 4096', 1, 4096, 86],
])('takes up all tiles of %s, and keeps no more on the card than it states', async (_, count, side, mebibytes) => {
  const server = await serve(`${SCENES}/cornell.glb`);
  const page = await pages.open(server.url, 900, 600);
  await converged(page);
  const kept = await page.evaluate(
    async ({ count, side }) => {
      const { viewer } = window.viewer!;
      const gl = viewer.renderer.getContext() as WebGL2RenderingContext;
      for (let frame = 0; frame < 2; ++frame) {
        viewer.invalidate(); // what the scene itself has on the card is there by then
        await new Promise((resolve) => requestAnimationFrame(resolve));
      }
      let onCard = 0;
      const store = gl.texStorage2D.bind(gl);
      gl.texStorage2D = (target, levels, format, width, height) => {
        for (let level = 0; level < levels; ++level)
          onCard += 4 * Math.max(1, width >> level) * Math.max(1, height >> level);
        store(target, levels, format, width, height);
      };
      const shape = { width: side, height: side, mips: Math.log2(side) + 1 };
      const layout = new Array<typeof shape>(count).fill(shape);
      const set = viewer.layouts.expect({ ...viewer.set!.note, layout: 1000, pages: layout })!;
      let tiles = 0;
      for (let mip = shape.mips - 1; mip >= 0; --mip) {
        const width = Math.min(64, side >> mip);
        const texels = new Uint32Array(width * width).fill(0x80406030);
        const sent = { revision: 1, tileVersion: 1, shots: 1, error: 0.01, payloadBytes: 0, crc: 0, scaleExponent: 0 };
        const flags = { kind: 'irradiance', format: 'rgb9e5', deflated: false, final: false, reset: false } as const;
        for (let page = 0; page < count; ++page)
          for (let y = 0; y < side >> mip; y += 64)
            for (let x = 0; x < side >> mip; x += 64, ++tiles)
              set.enqueue({ header: { ...sent, ...flags, page, mip, x, y, width, height: width }, texels, exponent: 0 }, 0); // prettier-ignore
      }
      while (set.waiting > 0) {
        viewer.invalidate();
        await new Promise((resolve) => requestAnimationFrame(resolve));
      }
      return { tiles, taken: set.tilesTaken, covered: set.covered, stated: set.bytes, onCard, error: gl.getError() };
    },
    { count, side },
  );
  expect(kept.taken).toBe(kept.tiles);
  expect(kept.covered).toBe(true);
  expect(kept.error).toBe(0);
  expect(kept.onCard).toBeGreaterThan(4 * count * side * side);
  expect(kept.onCard).toBeLessThanOrEqual(kept.stated);
  expect(kept.stated).toBeLessThanOrEqual(mebibytes * 2 ** 20);
});

it('gives back what edits, loads and views have taken on the card', async () => {
  const server = await serve(`${SCENES}/cornell.glb`);
  const page = await pages.open('about:blank', 480, 360);
  await countAlive(page);
  await page.goto(server.url);
  await converged(page);
  // What is on the card is what was drawn: a slow machine draws by chance what a quick one leaves out.
  const round = async (i: number) => {
    const select = (name?: string) =>
      page.evaluate((wanted) => {
        const app = window.viewer!;
        const node = app.edit.document.gltf.nodes!.findIndex((one) => one.name === wanted);
        app.edit.select(wanted === undefined ? undefined : { node, material: undefined });
      }, name);
    await select('tall_block');
    for (const mode of ['error', 'pages']) {
      await page.evaluate((id) => window.viewer!.view.setMode(id), mode);
      await drawn(page);
    }
    await page.evaluate(() => window.viewer!.view.setMode('lit'));
    await select();
    await page.evaluate(async (step) => {
      const app = window.viewer!;
      const node = app.edit.document.gltf.nodes!.findIndex(({ name }) => name === 'tall_block');
      const value = [0.001 * (1 + (step % 2)), 0, 0];
      await app.connection.call('scene.patch', {
        patch: [{ op: 'replace', path: `/nodes/${node}/translation`, value }],
      });
      await app.connection.call('solve.configure', { texels: 9000 + 1000 * (step % 2) });
    }, i);
    await converged(page);
    await pixels(page, 8);
  };
  // What is made once is made in the first rounds, those handles too that only show from where these put the object.
  for (let i = 0; i < 2; ++i) await round(i);
  // While a layout takes the place of another both are there.
  const counts: string[] = [];
  const settled = () => counts.length > 4 && new Set(counts.slice(-4)).size === 1;
  await until(async () => counts.push(JSON.stringify(await alive(page))), settled);
  const before = await mayLive(page);
  for (let i = 2; i < 8; ++i) await round(i);
  expect(before['Texture']).toBeGreaterThan(0);
  const more = await until(
    () => grown(page, before),
    (kinds) => kinds.length === 0,
  );
  expect(more).toEqual([]);
});

it('shows the first light of a scene of many texels while they are being made', async () => {
  const server = await serve(`${SCENES}/cornell.glb`, '--texels', '1200000');
  const page = await pages.open('about:blank', 900, 600);
  await page.addInitScript(() => {
    const seen: { texels: number; lit: boolean; covered: boolean }[] = [];
    (window as unknown as { seen: object[] }).seen = seen;
    const look = () => {
      const set = window.viewer?.viewer.shown?.set;
      const texels = set?.note.pages.reduce((sum, { width, height }) => sum + width * height, 0) ?? 0;
      const card = document.querySelector<HTMLElement>('.welcome');
      if (set?.lit && seen.at(-1)?.texels !== texels) seen.push({ texels, lit: true, covered: card?.hidden === false });
      requestAnimationFrame(look);
    };
    look();
  });
  await page.goto(server.url);
  const seen = await until(
    () => page.evaluate(() => (window as unknown as { seen: { texels: number; covered: boolean }[] }).seen),
    (all) => all.length > 0 && all.at(-1)!.texels > 1_000_000,
  );
  // A page that opens later than the load takes finds all texels there.
  expect(seen.at(-1)!.texels).toBeGreaterThan(1_000_000);
  for (const { covered } of seen) expect(covered).toBe(false);
  for (const { texels } of seen.slice(0, -1)) expect(texels).toBeLessThan(300_000);
});
