// Where one looks from, and that it gets elsewhere: in links, to others, and through scenes that somebody makes far larger.

import type { Page } from 'playwright-core';
import type {} from '../../../client/web/src/main';
import { answered, converged, putScene, serveEach, SCENES, squares, until, type Server } from './harness';

const { pages, serve } = serveEach();

const place = (page: Page) => page.evaluate(() => window.viewer!.viewer.rig.camera.matrixWorld.toArray());

/** Opens the link of a page, and expects the same picture there. Of so many metres no one can tell the difference. */
async function follows(page: Page, server: Server, metres: number): Promise<void> {
  const hash = await page.evaluate(() => window.viewer!.view.linkHash());
  const other = await pages.open(`${server.url}/#${hash}`, 900, 600);
  await converged(other);
  const [a, b] = [await place(page), await place(other)];
  a.forEach((v, i) => expect(Math.abs(v - b[i]!), `${i}`).toBeLessThan(i < 12 ? 1e-3 : metres)); // axes; the eye
  await other.context().close();
}

it('carries the camera in a link', async () => {
  const server = await serve(`${SCENES}/cornell.glb`);
  const page = await pages.open(server.url, 900, 600);
  await converged(page);
  await page.locator('canvas.view').focus();
  for (let i = 0; i < 5; ++i) await page.keyboard.press('ArrowRight');
  await follows(page, server, 1e-3);
});

it('carries it in the first person too: where one looks to, after looking about and walking', async () => {
  const server = await serve(`${SCENES}/cornell.glb`);
  const page = await pages.open(server.url, 900, 600);
  await converged(page);
  const before = await place(page);
  await page.locator('canvas.view').focus();
  await page.keyboard.press('v');
  await page.mouse.move(450, 300);
  await page.mouse.down();
  await page.mouse.move(650, 340, { steps: 5 });
  await page.mouse.up();
  await page.mouse.wheel(0, -100);
  await page.keyboard.press('ArrowUp');
  const after = await place(page);
  expect(Math.abs(after[8]! - before[8]!)).toBeGreaterThan(0.1); // it looks elsewhere
  await follows(page, server, 1e-3);
  // The others are told the same.
  const told = await page.evaluate(() => window.viewer!.viewer.rig.place);
  const way = told.target.map((v, i) => v - told.position[i]!);
  const length = Math.hypot(...way);
  way.forEach((v, i) => expect(v / length).toBeCloseTo(-after[8 + i]!, 3));
});

it.each([
  ['far from the origin', { translation: [12345, 0, -54321] }, 2e-3],
  ['where all is a thousandth of a millimetre wide', { scale: [1e-6, 1e-6, 1e-6] }, 1e-9],
])('carries it %s', async (_, placed, metres) => {
  const server = await serve();
  await putScene(server, squares([{ mesh: 0, ...placed }]));
  const page = await pages.open(server.url, 900, 600);
  await converged(page);
  await page.locator('canvas.view').focus();
  for (let i = 0; i < 5; ++i) await page.keyboard.press('ArrowRight');
  await follows(page, server, metres);
});

it('stays where it is while something is a million metres away by mistake', async () => {
  const server = await serve(`${SCENES}/cornell.glb`);
  const page = await pages.open(server.url, 900, 600);
  await converged(page);
  const before = await place(page);
  const move = (x: number) =>
    page.evaluate(async (x) => {
      const patch = [{ op: 'replace', path: '/nodes/@tall_block/translation', value: [x, 0, 0] }];
      await window.viewer!.connection.call('scene.patch', { patch });
    }, x);
  const size = () => page.evaluate(() => window.viewer!.viewer.rig.sceneSize);
  await move(1e6);
  expect(await until(size, (metres) => metres > 1e5)).toBeGreaterThan(1e5);
  expect(await place(page)).toEqual(before);
  await page.evaluate(() => window.viewer!.connection.call('scene.undo'));
  await until(size, (metres) => metres < 100);
  await answered(page);
  expect(await place(page)).toEqual(before);
});
