import { readFileSync } from 'node:fs';
import { mkdtempSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import type {} from '../../../client/web/src/main';
import { converged, difference, pixels, said, SCENES, serveEach } from './harness';

const { pages, serve } = serveEach();

it('outlives a server that is killed and started again', async () => {
  const server = await serve(`${SCENES}/cornell.glb`);
  const page = await pages.open(server.url, 900, 600);
  await converged(page);
  const before = await pixels(page, 60);
  await server.stop('SIGKILL');
  await page.getByText(/No connection/).waitFor();
  // The picture stays, and can be turned about.
  expect(difference(before, await pixels(page, 60)).p99).toBeLessThanOrEqual(1);
  await server.start();
  await said(page, /^Reconnected$/);
  await converged(page);
  expect(await page.locator('.banner').isVisible()).toBe(false);
  expect(difference(before, await pixels(page, 60)).mean).toBeLessThan(2);
});

it('waits for a scene, and loads one that is dropped', async () => {
  const server = await serve();
  const page = await pages.open(server.url, 900, 600);
  await page.getByText('No scene yet').waitFor();
  const bytes = readFileSync(`${SCENES}/cornell.glb`).toString('base64');
  await page.evaluate((base64) => {
    const transfer = new DataTransfer();
    const data = Uint8Array.from(atob(base64), (c) => c.charCodeAt(0));
    transfer.items.add(new File([data], 'box.glb'));
    window.dispatchEvent(new DragEvent('drop', { dataTransfer: transfer, cancelable: true }));
  }, bytes);
  await said(page, /box\.glb loaded/);
  await converged(page);
  expect(await page.locator('.welcome').isVisible()).toBe(false);
  expect(Math.max(...(await pixels(page, 16)))).toBeGreaterThan(60);
});

it('offers to take a file for as long as one is held over the page, and nothing else', async () => {
  const server = await serve(`${SCENES}/cornell.glb`);
  const page = await pages.open(server.url, 900, 600);
  const offersAfter = (type: string, what: 'file' | 'text', to?: string) =>
    page.evaluate(
      ({ type, what, to }) => {
        const dataTransfer = new DataTransfer();
        if (what === 'file') dataTransfer.items.add(new File([], 'box.glb'));
        else dataTransfer.setData('text/plain', 'box');
        const relatedTarget = to ? document.querySelector(to) : null;
        const init = { dataTransfer, relatedTarget, cancelable: true, bubbles: true };
        document.querySelector('canvas.view')!.dispatchEvent(new DragEvent(type, init));
        return document.body.classList.contains('dropping');
      },
      { type, what, to },
    );
  await page.waitForFunction(() => window.viewer !== undefined);
  expect(await offersAfter('dragover', 'text')).toBe(false);
  expect(await offersAfter('dragover', 'file')).toBe(true);
  expect(await offersAfter('dragleave', 'file', '.tools')).toBe(true); // to another part of the page
  expect(await offersAfter('dragleave', 'file')).toBe(false);
});

it('says what is wrong with a file that is no scene', async () => {
  const server = await serve(`${SCENES}/cornell.glb`);
  const page = await pages.open(server.url, 900, 600);
  await converged(page);
  await page.evaluate(() => void window.viewer!.scene.loadFile(new File(['not a scene'], 'notes.glb')));
  await said(page, /^notes\.glb: /);
  await converged(page); // the scene that was there is there
  // The refusal is an answer of 400, which the browser's console tells of; nothing else may.
  expect(pages.complaints.splice(0).filter((text) => !text.includes('status of 400'))).toEqual([]);
});

it('asks for the token, and works with it', async () => {
  const token = 'a-token-of-32-characters-or-more';
  const file = join(mkdtempSync(join(tmpdir(), 'viewer-')), 'token');
  writeFileSync(file, token);
  const server = await serve(`${SCENES}/cornell.glb`, '--token-file', file);
  const page = await pages.open(server.url, 900, 600);
  await page.getByLabel('Token').fill(token);
  await page.getByRole('button', { name: 'Connect' }).click();
  await converged(page);
  // A link may carry it; it does not stay in the address.
  const linked = await pages.open(`${server.url}/#token=${token}`, 900, 600);
  await converged(linked);
  expect(linked.url()).not.toContain(token);
  const asked = await pages.open(server.url, 900, 600);
  await asked.getByLabel('Token').waitFor();
  await asked.goto(`${server.url}/#token=${token}`); // in the same tab, which is not loaded anew
  await converged(asked);
  expect(asked.url()).not.toContain(token);
});

it('loads nothing from anywhere else', async () => {
  const server = await serve(`${SCENES}/cornell.glb`);
  const page = await pages.open('about:blank');
  const hosts = new Set<string>();
  page.on('request', (request) => hosts.add(new URL(request.url()).host));
  const response = await page.goto(server.url);
  await converged(page);
  hosts.delete(''); // blob:
  expect([...hosts]).toEqual([new URL(server.url).host]);
  expect(response!.headers()['content-security-policy']).toContain("script-src 'self';");
});
