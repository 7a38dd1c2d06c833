// The light meter: how much light falls where the pointer is, and how sure that is.

import type {} from '../../../client/web/src/main';
import { converged, serveAll, until } from './harness';

const { server, pages } = serveAll('cornell.glb');

it('reads the light under the pointer', async () => {
  const page = await pages.open(server.url, 1200, 800);
  await converged(page);
  // First the pointer: a meter that has none reads the middle of the picture until the next frame.
  await page.mouse.move(400, 260);
  await page.keyboard.press('m');
  const text = await until(
    async () => (await page.locator('.meter').innerText()) || '',
    (t) => / ± .* lx/.test(t),
  );
  expect(text).toMatch(/^[\d.,]+ ± [\d.,]+ lx/);
  const reading = await page.evaluate(() => {
    const box = window.viewer!.viewer.canvas.getBoundingClientRect();
    return window.viewer!.viewer.readAt((400 / box.width) * 2 - 1, 1 - (260 / box.height) * 2)!.irradiance!;
  });
  // Against the lightmap file's own view of the page: the luminance shown is that of the texels sampled.
  const lux = Number(/^([\d.,]+)/.exec(text)![1]!.replaceAll(',', ''));
  const luminance = 0.2126 * reading[0] + 0.7152 * reading[1] + 0.0722 * reading[2];
  // It has as many decimals as its error lets it have.
  const decimals = /^[\d,]+\.?(\d*)/.exec(text)![1]!.length;
  expect(Math.abs(lux - luminance), `${text} for ${luminance}`).toBeLessThan(0.501 * 10 ** -decimals);
  expect(lux).toBeGreaterThan(0);
});

it('says of the texel under the pointer how sure its light is, in every view the same', async () => {
  const page = await pages.open(server.url, 1200, 800);
  await converged(page);
  await page.mouse.move(400, 260);
  await page.keyboard.press('m');
  const read = async (at: { x: number; y: number; texel: string }) => {
    await page.mouse.move(at.x, at.y);
    return until(
      () => page.locator('.meter').innerText(),
      (text) => / ± .* lx/.test(text) && text.includes(`${at.texel}\n`),
    );
  };
  const either = (text: string) => Number(/ ± ([\d.,]+) lx/.exec(text)![1]!.replaceAll(',', ''));
  // Of every object one that is well within its texel.
  const places = await page.evaluate(() => {
    const { viewer } = window.viewer!;
    const box = viewer.canvas.getBoundingClientRect();
    const found = new Map<string, { x: number; y: number; texel: string }>();
    for (let y = 100; y < 760; y += 5)
      for (let x = 40; x < 760; x += 5) {
        const at = (dx: number, dy: number) =>
          viewer.readAt(((x + dx - box.left) / box.width) * 2 - 1, 1 - ((y + dy - box.top) / box.height) * 2);
        const around = [at(0, 0), at(-2, 0), at(2, 0), at(0, -2), at(0, 2)];
        const name = (read: (typeof around)[number]) => `page ${read?.page}, texel ${read?.texel?.join(', ')}`;
        const texel = name(around[0]);
        if (!around[0]?.irradiance || around.some((read) => name(read) !== texel)) continue;
        const node = String(around[0].node);
        if (!found.has(node)) found.set(node, { x, y, texel });
      }
    return [...found.values()];
  });
  expect(places.length).toBeGreaterThan(3);
  const lit: string[] = [];
  for (const place of places) lit.push(await read(place));
  await page.evaluate(() => window.viewer!.view.setMode('error'));
  await page.waitForFunction(() => {
    const { dataSet } = window.viewer!.viewer;
    return dataSet?.quantity === 'error' && dataSet.complete && dataSet.waiting === 0;
  });
  const ratios: number[] = [];
  for (const [i, place] of places.entries()) {
    ratios.push(either(lit[i]!) / either(await read(place)));
  }
  // What is shown has one or two digits, and the other view looks up between texels.
  for (const ratio of ratios) expect(Math.abs(ratio - 1), ratios.join(' ')).toBeLessThan(0.25);
  // One figure for the whole scene would be the same part of the light everywhere.
  const parts = lit.map((text) => either(text) / Number(/^[\d.,]+/.exec(text)![0].replaceAll(',', '')));
  expect(Math.max(...parts) / Math.min(...parts)).toBeGreaterThan(2);
  // The texel's own, as exactly as the stream's format holds it.
  const [asked, streamed] = await page.evaluate(async (where) => {
    const [index, x, y] = where;
    const { connection, viewer } = window.viewer!;
    const { error } = await connection.call<{ error: number[] }>('texel', { page: index, x, y });
    const errors = viewer.dataSet!.pages[index]!;
    return [error, errors.sample((x! + 0.5) / errors.width, (y! + 0.5) / errors.height)!];
  }, /page (\d+), texel (\d+), (\d+)/.exec(lit[0]!)!.slice(1).map(Number) as [number, number, number]); // prettier-ignore
  const quantum = Math.max(...asked!) / 500;
  for (const [i, value] of asked!.entries()) expect(Math.abs(value - streamed![i]!)).toBeLessThan(quantum);
  await page.evaluate(() => window.viewer!.view.setMode('lit'));
  await page.keyboard.press('m');
});
