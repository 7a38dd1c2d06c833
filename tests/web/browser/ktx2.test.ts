// Files with KTX2 pictures that are dropped on the page: the page unpacks them before it sends the file.

import type { Page } from 'playwright-core';
import type {} from '../../../client/web/src/main';
import { makeGlb, makeKtx2, type Colour } from '../ktx2_maker';
import { said, sceneOf, serveEach, until } from './harness';

const { pages, serve } = serveEach();
const RED: Colour = [200, 10, 20, 255];

const drop = (page: Page, name: string, glb: Uint8Array) =>
  page.evaluate(
    ({ name, bytes }) => {
      const transfer = new DataTransfer();
      const data = Uint8Array.from(atob(bytes), (c) => c.charCodeAt(0));
      transfer.items.add(new File([data], name));
      window.dispatchEvent(new DragEvent('drop', { dataTransfer: transfer, cancelable: true }));
    },
    { name, bytes: Buffer.from(glb).toString('base64') },
  );

it('sends PNGs in place of KTX2 pictures, and says which one is damaged', async () => {
  const server = await serve();
  const page = await pages.open(server.url, 900, 600);
  const errors: string[] = [];
  page.on('console', (message) => message.type() === 'error' && errors.push(message.text()));
  await drop(page, 'red.glb', makeGlb({ name: 'paint', bytes: makeKtx2([[RED]]), mimeType: 'image/ktx2' }));
  await said(page, /red\.glb loaded/);
  const scene = await until(
    async () => (await sceneOf(server).catch(() => undefined)) as { images?: { mimeType: string }[] } | undefined,
    (found) => found?.images !== undefined,
  );
  expect(scene!.images![0]!.mimeType).toBe('image/png');
  expect(JSON.stringify(scene)).not.toContain('KHR_texture_basisu');

  const spoilt = makeKtx2([[RED]], { change: (file) => file.setUint32(20, 2 ** 30, true) });
  await drop(page, 'spoilt.glb', makeGlb({ name: 'paint', bytes: spoilt, mimeType: 'image/ktx2' }));
  await said(page, /spoilt\.glb: \/images\/0 \(paint\): claims 1073741824 x 4 pixels/);
  expect(errors).toEqual([]);
});

it('shows a scene whose KTX2 picture light does not need, though another program sent it', async () => {
  const server = await serve();
  const glb = makeGlb({ name: 'bumps', bytes: makeKtx2([[RED]]), mimeType: 'image/ktx2' }, undefined, 'normalTexture');
  const answer = await fetch(`${server.url}/scene?name=bumps.glb`, {
    method: 'PUT',
    body: glb.slice(),
    headers: { 'Content-Type': 'model/gltf-binary' },
  });
  expect(answer.status, await answer.text()).toBe(200);
  const page = await pages.open(server.url, 900, 600);
  const triangles = () => page.evaluate(() => window.viewer?.viewer.shown?.triangles ?? 0);
  expect(await until(triangles, (count) => count > 0)).toBe(2);
});
