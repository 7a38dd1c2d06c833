// Lines that are slow, or gone for a while.

import type { CDPSession, Page } from 'playwright-core';
import type {} from '../../../client/web/src/main';
import { converged, difference, pixels, said, sceneOf, serveAll, SlowLine, until } from './harness';

const { server, pages } = serveAll('cornell.glb');

/** Chromium's own throttle; it works on WebSockets where the line is cut, and on HTTP. */
async function line(page: Page): Promise<CDPSession> {
  const session = await page.context().newCDPSession(page);
  await session.send('Network.enable');
  return session;
}

const emulate = (session: CDPSession, offline: boolean) =>
  session.send('Network.emulateNetworkConditions', {
    offline,
    latency: 0,
    downloadThroughput: -1,
    uploadThroughput: -1,
  });

it('says that the server does not answer, and comes back by itself with what was missed', async () => {
  const page = await pages.open(server.url, 900, 600);
  await converged(page);
  const before = await sceneOf(server);
  const light = before.materials.findIndex(({ name }) => name === 'light');
  // A machine that slept: what the socket was is gone, and nobody said so.
  await page.evaluate(() => {
    const { connection } = window.viewer! as unknown as { connection: { socket: WebSocket } };
    connection.socket.close();
  });
  const session = await line(page);
  await emulate(session, true);
  await page.getByText(/No connection/).waitFor();
  const patch = [{ op: 'replace', path: `/materials/${light}/emissiveFactor`, value: [0.1, 0.3, 1] }];
  const other = await pages.open(server.url, 900, 600);
  await converged(other);
  await other.evaluate((p) => window.viewer!.connection.call('scene.patch', { patch: p }), patch);
  await converged(other);
  await emulate(session, false);
  await said(page, /^Reconnected$/);
  await until(
    () => page.evaluate((m) => window.viewer!.edit.document.gltf.materials![m]!.emissiveFactor?.join(), light),
    (factor) => factor === '0.1,0.3,1',
  );
  await converged(page);
  expect(difference(await pixels(page, 30), await pixels(other, 30)).mean).toBeLessThan(4);
  await other.evaluate(() => window.viewer!.connection.call('scene.undo'));
  await converged(page);
});

it('takes a bookmark for what it is of: one of the errors that comes late says nothing about light', async () => {
  const page = await pages.open('about:blank', 900, 600);
  let tell = (_message: object) => undefined as void;
  await page.routeWebSocket(/\/ws$/, (socket) => {
    const upstream = socket.connectToServer();
    socket.onMessage((message) => upstream.send(message));
    upstream.onMessage((message) => socket.send(message));
    tell = (message) => socket.send(JSON.stringify(message));
  });
  await page.goto(server.url);
  await converged(page);
  const held = () => page.evaluate(() => window.viewer!.session.told.resume!);
  const before = await held();
  tell({
    jsonrpc: '2.0',
    method: 'bookmark',
    params: { revision: 1, tileVersion: before.tileVersion + 1, quantity: 'error' },
  });
  tell({ jsonrpc: '2.0', method: 'viewers', params: { count: 77 } }); // seen after it
  await page.locator('.people', { hasText: '77' }).waitFor();
  expect(await held()).toEqual(before);
});

it('asks for light less often on a slow line, and for less ahead', async () => {
  const slow = new SlowLine(server.url, 150_000);
  const url = await slow.start();
  const page = await pages.open(url, 900, 600);
  const many = () =>
    window.viewer!.connection.call('solve.configure', { texels: 200_000 }).then(
      () => true,
      () => false, // a slow line takes its time to connect
    );
  expect(
    await until(
      () => page.evaluate(many),
      (done) => done,
    ),
  ).toBe(true);
  await said(page, /^Slow network/);
  // Of the line's 150,000; a busy machine carries less for a while.
  const rate = () => page.evaluate(() => window.viewer!.connection.credit.rate);
  await until(rate, (bytes) => bytes > 50_000 && bytes < 400_000);
  // Turning needs no network.
  const eye = () => page.evaluate(() => window.viewer!.viewer.rig.camera.position.toArray().join());
  const before = await eye();
  await page.locator('canvas.view').focus();
  await page.keyboard.press('ArrowRight');
  expect(await until(eye, (now) => now !== before)).not.toBe(before);
  await converged(page);
  await page.evaluate(() => window.viewer!.connection.call('solve.configure', { texels: 16_000 }));
  await converged(page);
  await pages.closeAll();
  slow.stop();
});
