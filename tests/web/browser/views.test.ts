// How views are shown: exposures, scales and legends, what a link says of them, and the meter on flat pages.

import type { Page } from 'playwright-core';
import type {} from '../../../client/web/src/main';
import { converged, drawn, pixels, putScene, said, SCENES, serveEach, squares, until } from './harness';

const { pages, serve } = serveEach();

const lamp = { emissiveFactor: [1, 1, 1], pbrMetallicRoughness: { baseColorFactor: [0.5, 0.5, 0.5, 1] } };
const coal = { pbrMetallicRoughness: { baseColorFactor: [0.01, 0.01, 0.01, 1], metallicFactor: 0 } };

/** A square of coal under a lamp that cannot be seen from above: of what little it reflects the whole picture is. */
const darkRoom = () =>
  squares([{ mesh: 0, translation: [0, 1, 0], rotation: [1, 0, 0, 0] }, { mesh: 1 }], [lamp, coal]);

const show = async (page: Page, mode: string) => {
  await page.evaluate((mode) => window.viewer!.view.setMode(mode), mode);
  await drawn(page);
};

const middle = (values: number[]) => values.sort((a, b) => a - b)[Math.floor(values.length / 2)]!;

it('exposes irradiance for itself, however dark the surfaces are, and goes back to the light it was', async () => {
  const server = await serve();
  await putScene(server, darkRoom());
  const page = await pages.open(`${server.url}/#camera=0,0.7,0.5,0,0,0,45,0`, 400, 400);
  await converged(page);
  const exposure = () => page.evaluate(() => window.viewer!.viewer.exposure.value);
  await pixels(page, 8); // until its exposure is exact
  const lit = await exposure();
  const shown: Record<string, number> = {};
  for (const mode of ['irradiance', 'patches', 'pages']) {
    await show(page, mode);
    const seen = await pixels(page, 40);
    shown[mode] = await exposure();
    const lightest = Math.max(...seen);
    expect(lightest, mode).toBeGreaterThan(70);
    expect(middle(seen.filter((v) => v > 20)), mode).toBeLessThan(230);
  }
  // Coal reflects a hundredth of what reaches it.
  expect(lit / shown['irradiance']!).toBeGreaterThan(30);
  expect(shown['patches']! / shown['irradiance']!).toBeCloseTo(1, 1);
  await page.evaluate(() => window.viewer!.view.setMode('lit'));
  expect((await exposure()) / lit).toBeCloseTo(1, 1); // at once, before anything is measured
});

it('says that there is nothing to measure, where there is no light, instead of a scale', async () => {
  const server = await serve();
  await putScene(server, squares([{ mesh: 0 }], [coal]));
  const page = await pages.open(server.url, 900, 600);
  await converged(page);
  await page.evaluate(() => window.viewer!.view.setMode('error'));
  const legend = page.locator('.legend');
  await legend.getByText('0 everywhere: nothing to measure').waitFor();
  expect(await legend.innerText()).not.toMatch(/1,000|≤|≥/);
});

it('says why all is black where nothing reflects, and shows the light that arrives', async () => {
  const server = await serve();
  const nodes = [{ mesh: 0, translation: [0, 1, 0], rotation: [1, 0, 0, 0] }, { mesh: 1 }];
  const metal = { pbrMetallicRoughness: { metallicFactor: 1 } };
  await putScene(server, squares(nodes, [lamp, metal]));
  const page = await pages.open(server.url, 900, 600);
  await converged(page);
  const banner = page.locator('.banner');
  expect(await banner.isVisible()).toBe(false); // the lamp is seen
  const extensions = { KHR_lights_punctual: { lights: [{ type: 'point', intensity: 100 }] } };
  const dark = JSON.parse(squares([{ mesh: 0 }, { translation: [0, 1, 0], name: 'lamp' }], [metal])) as object;
  const lit = { ...dark, extensions, extensionsUsed: ['KHR_lights_punctual'] } as unknown as { nodes: object[] };
  Object.assign(lit.nodes[1]!, { extensions: { KHR_lights_punctual: { light: 0 } } });
  await putScene(server, JSON.stringify(lit));
  await banner.getByText('All surfaces are metal, or black').waitFor();
  await banner.getByRole('button', { name: 'Show irradiance' }).click();
  await banner.waitFor({ state: 'hidden' });
  expect(await page.evaluate(() => window.viewer!.view.mode.id)).toBe('irradiance');
});

it('carries exposure, tone mapping and scale in a link, and shows them again', async () => {
  const server = await serve(`${SCENES}/cornell.glb`);
  const page = await pages.open(server.url, 900, 600);
  await converged(page);
  await show(page, 'irradiance');
  await page.getByLabel('Auto exposure').uncheck();
  await page.getByLabel('Exposure', { exact: true }).fill('1.5');
  await page.getByLabel('Tone mapping').selectOption('agx');
  await page.getByLabel('False colour').check();
  await page.getByLabel('Auto scale').uncheck();
  for (const [end, value] of [
    ['Lowest', '2'],
    ['Highest', '300'],
  ] as const) {
    const field = page.getByLabel(`${end} value of the scale`);
    await field.fill(value);
    await field.press('Enter');
  }
  const state = (p: Page) =>
    p.evaluate(() => {
      const { brightness, exposure, uniforms } = window.viewer!.viewer;
      const { falseRange } = uniforms.all;
      const { automatic, base, stops } = exposure;
      return {
        mode: window.viewer!.view.mode.id,
        automatic,
        base,
        stops,
        tone: uniforms.defines.TONE_CURVE,
        autoRange: brightness.autoRange,
        range: brightness.autoRange ? [] : falseRange.value.toArray(),
      };
    });
  const made = await state(page);
  expect(made).toMatchObject({ automatic: false, stops: 1.5, tone: 2, autoRange: false, range: [2, 300] });
  const hash = await page.evaluate(() => window.viewer!.view.linkHash());
  const other = await pages.open(`${server.url}/#${hash}`, 900, 600);
  await converged(other);
  await drawn(other);
  const seen = await state(other);
  expect({ ...seen, base: made.base }).toEqual(made);
  expect(seen.base / made.base).toBeCloseTo(1, 3); // links carry four digits
  expect(await other.getByLabel('Tone mapping').inputValue()).toBe('agx');
  expect(await other.getByLabel('Lowest value of the scale').inputValue()).toBe('2');
  expect(await other.locator('.legend').innerText()).toMatch(/≤ 2\b[^]*≥ 300/);
  const shown = await other.evaluate(() => window.viewer!.viewer.exposure.value);
  expect(shown / (made.base * 2 ** 1.5)).toBeCloseTo(1, 2);
  // What such a link does not say is as it is without one, and what nobody can mean is not said.
  await other.goto(`${server.url}/#view=irradiance&stops=99&tone=toString&scale=5,1&exposure=-3`);
  const plain = { automatic: true, stops: 0, tone: 0, autoRange: true };
  await until(() => state(other), (now) => now.automatic && now.autoRange); // prettier-ignore
  expect(await state(other)).toMatchObject(plain);
});

it('reads the light on flat pages', async () => {
  const server = await serve(`${SCENES}/cornell.glb`);
  const page = await pages.open(server.url, 900, 600);
  await converged(page);
  await show(page, 'pages');
  const at = await page.evaluate(() => {
    const { viewer } = window.viewer!;
    const box = viewer.canvas.getBoundingClientRect();
    // Somewhere on the first page there is light: the texels of the meter are those of the lightmap.
    for (let y = -0.9; y < 0.9; y += 0.06)
      for (let x = -0.9; x < 0.9; x += 0.06) {
        const read = viewer.readAt(x, y);
        if (!read?.irradiance || read.irradiance[0] < 1) continue;
        const { point } = read;
        const page = viewer.shown!.set.pages[read.page!]!;
        const [u, v] = read.texel!.map((t, i) => (t + 0.5) / [page.width, page.height][i]!);
        const [left, top] = [box.left + ((x + 1) / 2) * box.width, box.top + ((1 - y) / 2) * box.height];
        return { left, top, read: read.irradiance, sample: page.sample(u!, v!), point };
      }
    return undefined;
  });
  expect(at!.read).toEqual(at!.sample);
  expect(at!.point).toBeDefined();
  await page.mouse.move(at!.left, at!.top);
  await page.keyboard.press('m');
  const meter = page.locator('.meter');
  await meter.getByText(/page 0, texel \d+, \d+/).waitFor();
  await meter.getByText(/ ± .* lx/).waitFor();
  expect(await meter.innerText()).toMatch(/^[\d.,]+ ± [\d.,]+ lx/);
  expect(await meter.innerText()).toMatch(/\n(floor|ceiling|back|left|right|short|tall|lamp|light)[^]* m$/i); // whose it is
  // Between the charts nothing is lit, which is not the same as dark.
  const gap = await page.evaluate(() => {
    const { viewer } = window.viewer!;
    const box = viewer.canvas.getBoundingClientRect();
    for (let y = -0.99; y < 0.99; y += 0.01)
      for (let x = -0.99; x < 0.99; x += 0.01)
        if (viewer.readAt(x, y)?.isGap)
          return { left: box.left + ((x + 1) / 2) * box.width, top: box.top + ((1 - y) / 2) * box.height };
    return undefined;
  });
  await page.mouse.move(gap!.left, gap!.top);
  await meter.getByText('no surface here').waitFor();
  expect(await meter.innerText()).toMatch(/^no surface here\npage 0, texel \d+, \d+$/);
  // Beside the pages there is nothing to read.
  const box = (await page.locator('canvas.view').boundingBox())!;
  await page.mouse.move(box.x + 4, box.y + box.height / 2);
  await until(() => meter.isHidden(), (hidden) => hidden); // prettier-ignore
});

it('offers of a lamp the handles that change something', async () => {
  const server = await serve(`${SCENES}/cornell.glb`);
  const page = await pages.open(server.url, 1200, 800);
  await converged(page);
  await page.locator('canvas.view').focus();
  await page.keyboard.press('r');
  await page.keyboard.press('l');
  await page.getByLabel('Intensity, cd').waitFor();
  const tool = (name: string) => page.getByRole('toolbar').getByRole('button', { name, exact: true });
  const offered = async () => Promise.all(['Move', 'Rotate', 'Scale'].map((name) => tool(name).isEnabled()));
  expect(await offered()).toEqual([true, false, false]);
  expect(await page.evaluate(() => window.viewer!.viewer.gizmo.mode)).toBe('translate');
  expect(await page.getByText('Rotation, °').count()).toBe(0);
  // A spot can be turned, and what was chosen before is in the hand again.
  await page.evaluate(() => {
    const { document } = window.viewer!.edit;
    const path = '/extensions/KHR_lights_punctual/lights/0';
    const light = { ...document.gltf.extensions!.KHR_lights_punctual!.lights[0]!, type: 'spot', spot: {} };
    return document.edit('Kind', [{ op: 'replace', path, value: light as never }]);
  });
  expect(await offered()).toEqual([true, true, false]);
  expect(await page.evaluate(() => window.viewer!.viewer.gizmo.mode)).toBe('rotate');
  await page.keyboard.press('Escape');
  expect(await offered()).toEqual([true, true, true]);
});

it('tells which scene somebody else has loaded, and not of its own', async () => {
  const server = await serve(`${SCENES}/cornell.glb`);
  const page = await pages.open(server.url, 900, 600);
  await converged(page);
  await putScene(server, darkRoom());
  await said(page, /^Ann loaded squares/);
  const headers = { 'Content-Type': 'model/gltf+json', 'User-Agent': 'curl/7.88.1' };
  await fetch(`${server.url}/scene`, { method: 'PUT', body: darkRoom(), headers });
  await said(page, /^curl\/7\.88\.1 loaded a scene without a name$/);
  await page.evaluate((text) => window.viewer!.scene.loadFile(new File([text], 'mine.gltf')), squares([{ mesh: 0 }]));
  await said(page, /^mine\.gltf loaded/);
  await converged(page);
  const notes = await page.evaluate(() => window.notes!.filter((text) => / loaded /.test(`${text} `)));
  expect(notes.filter((text) => !text.startsWith('mine.gltf'))).toHaveLength(2);
});

it('tells who has loaded the first scene of a server, and of none that it began with', async () => {
  const server = await serve(undefined);
  const [sender, watcher] = [await pages.open(server.url, 900, 600), await pages.open(server.url, 900, 600)];
  await watcher.waitForFunction(() => window.viewer?.connection.isOpen);
  await sender.evaluate((text) => window.viewer!.scene.loadFile(new File([text], 'mine.gltf')), squares([{ mesh: 0 }]));
  await said(watcher, /^viewer \w+ loaded mine\.gltf/);
  await converged(sender);
  expect(await sender.evaluate(() => window.notes!.filter((text) => /^viewer/.test(text)))).toEqual([]);
  const late = await pages.open(server.url, 900, 600);
  await converged(late);
  expect(await late.evaluate(() => window.notes!.filter((text) => /loaded/.test(text)))).toEqual([]);
});
