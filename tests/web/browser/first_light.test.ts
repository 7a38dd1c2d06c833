// What a visitor sees first: never light that is shown too darkly or too brightly, and then mended.

import type { Page } from 'playwright-core';
import type {} from '../../../client/web/src/main';
import { converged, difference, drawn, putScene, SCENES, serveEach, squares } from './harness';

const { pages, serve } = serveEach();

const SIDE = 12;

interface Frame {
  /** Of the pages that were drawn; 0: no scene. */
  layout: number;
  light: boolean;
  exposure: number;
  /** SIDE x SIDE pixels, R, G, B of each, 0 to 255. */
  picture: number[];
}

declare global {
  interface Window {
    drawnFrames?: Frame[];
  }
}

/** In the page: every frame as it was drawn. */
function keepFrames(side: number): void {
  const frames: Frame[] = [];
  window.drawnFrames = frames;
  const context = new OffscreenCanvas(side, side).getContext('2d', { alpha: false, willReadFrequently: true })!;
  const keep = () => {
    const { viewer } = window.viewer!;
    context.clearRect(0, 0, side, side); // upon black
    context.drawImage(viewer.canvas, 0, 0, side, side);
    const { data } = context.getImageData(0, 0, side, side);
    frames.push({
      layout: viewer.shown?.set.note.layout ?? 0,
      light: viewer.shown?.set.showsLight ?? false,
      exposure: viewer.uniforms.all.toneMappingExposure.value,
      picture: Array.from(data).filter((_, i) => i % 4 !== 3),
    });
  };
  const hook = () => {
    if (!window.viewer) return void requestAnimationFrame(hook);
    const { view } = window.viewer;
    const others = view.onDrawn.bind(view);
    view.onDrawn = () => {
      others();
      keep();
    };
  };
  hook();
}

async function openWatched(url: string): Promise<Page> {
  const page = await pages.open('about:blank');
  await page.addInitScript(keepFrames, SIDE);
  await page.goto(url);
  return page;
}

/** When the exposure has come to rest. */
async function framesOf(page: Page): Promise<Frame[]> {
  await converged(page);
  await page.evaluate(() => window.viewer!.viewer.settle());
  await drawn(page);
  return page.evaluate(() => window.drawnFrames!);
}

it.each(['', 'view=irradiance', 'view=pages'])(
  'shows a solved scene in its final brightness at once (%s)',
  async (view) => {
    const server = await serve(`${SCENES}/cornell.glb`);
    const other = await pages.open(server.url);
    await converged(other);
    // So that what it is to be shown by is far from nothing, in all views.
    await other.evaluate(() => {
      const path = '/materials/@light/extensions/KHR_materials_emissive_strength/emissiveStrength';
      return window.viewer!.connection.call('scene.patch', { patch: [{ op: 'replace', path, value: 0.1 }] });
    });
    await converged(other);
    const frames = await framesOf(await openWatched(`${server.url}/#ui=0&${view}`));
    const first = frames.findIndex(({ light }) => light);
    const last = frames.at(-1)!;
    expect(first).toBeGreaterThanOrEqual(0);
    // What an exposure of nothing makes of it is far off: else the test would see nothing.
    expect(Math.abs(Math.log2(last.exposure))).toBeGreaterThan(1.5);
    // Where the machine is slow the first light is coarse: measured, it was 1.34 times as bright as with all its texels.
    const ratio = last.exposure / frames[first]!.exposure;
    expect(Math.abs(Math.log2(ratio)), `${ratio}`).toBeLessThan(0.6);
    // So much darker or brighter is 30 of 255 in the middle of the scale; at an exposure of 1 it would be 80.
    const far = frames.slice(first).map(({ picture }) => difference(picture, last.picture).mean);
    expect(Math.max(...far)).toBeLessThan(30);
  },
);

/** A wall that shines upon a floor, 500 m away. */
function bright(emissiveStrength: number): string {
  const extensions = { KHR_materials_emissive_strength: { emissiveStrength } };
  return squares(
    [
      { name: 'wall', mesh: 0, translation: [500, 0, 0], rotation: [Math.SQRT1_2, 0, 0, Math.SQRT1_2] },
      { name: 'floor', mesh: 1, translation: [500, -0.5, 0.5] },
    ],
    [
      { emissiveFactor: [1, 1, 1], extensions },
      { pbrMetallicRoughness: { baseColorFactor: [0.5, 0.5, 0.5, 1], metallicFactor: 0 } },
    ],
  );
}

it('shows a scene that takes the place of a darker one in its own brightness at once', async () => {
  const server = await serve(`${SCENES}/cornell.glb`);
  const page = await openWatched(`${server.url}/#ui=0`);
  const before = (await framesOf(page)).at(-1)!;
  await putScene(server, bright(1e5));
  await page.waitForFunction((layout) => window.drawnFrames!.at(-1)!.layout !== layout, before.layout);
  const frames = (await framesOf(page)).filter(({ layout, light }) => layout !== before.layout && light);
  const last = frames.at(-1)!;
  expect(before.exposure / last.exposure).toBeGreaterThan(20);
  // Its first light may be a part of what there will be: it is as bright on the screen all the same, where the exposure
  // of the scene before would make it white.
  const mean = ({ picture }: Frame) => picture.reduce((sum, v) => sum + v, 0) / picture.length;
  expect(mean(frames[0]!) / mean(last), `${frames[0]!.exposure}, ${last.exposure}`).toBeLessThan(1.5);
  expect(mean(frames[0]!) / mean(last)).toBeGreaterThan(0.5);
});
