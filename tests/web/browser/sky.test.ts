// The sky behind the scene, in the colours of the server's pictures.

import type { Page } from 'playwright-core';
import type {} from '../../../client/web/src/main';
import { converged, difference, drawn, pixels, putScene, serveEach, squares, until } from './harness';

const { pages, serve } = serveEach();

const PLASTER = { doubleSided: true, pbrMetallicRoughness: { baseColorFactor: [0.5, 0.4, 0.3, 1], metallicFactor: 0 } };
const SKY = { upper: [300, 500, 900], lower: [60, 50, 40] };

/** A square in the air, which one looks down at, upright: the page turns its cameras so. */
function square(radiositySky?: object): string {
  const gltf = JSON.parse(
    squares(
      [{ mesh: 0 }, { translation: [0.3, 0.5, 1.6], rotation: [-0.12411, 0.09905, 0.01245, 0.98724] }],
      [PLASTER],
    ),
  ) as { nodes: object[]; extras?: object; cameras?: object[] };
  gltf.cameras = [{ type: 'perspective', perspective: { yfov: 1, znear: 0.01 } }];
  Object.assign(gltf.nodes[1]!, { camera: 0 });
  if (radiositySky) gltf.extras = { radiositySky };
  return JSON.stringify(gltf);
}

/** The page shows what the server does, as brightly, and exposes for nearly the same. */
async function expectTheSame(page: Page, what: string): Promise<number[]> {
  await converged(page);
  const ours = await pixels(page, 60);
  const exposures = await page.evaluate(async () => {
    const { connection, viewer } = window.viewer!;
    const { exposure } = await connection.call<{ exposure: number }>('snapshot', { width: 480, height: 480 });
    return { ours: viewer.exposure.value, theirs: exposure };
  });
  expect(Math.abs(exposures.ours / exposures.theirs - 1), what).toBeLessThan(0.05); // of 64 x 48 pixels
  const picture = `/snapshot.png?width=480&height=480&exposure=${exposures.ours}`;
  const { mean, p99 } = difference(ours, await pixels(page, 60, picture));
  // As for the Cornell box: edges are smoothed differently.
  expect(mean, what).toBeLessThan(1);
  expect(p99, what).toBeLessThan(12);
  return ours;
}

/** R, G, B in the upper left corner, and in the lower right one. */
const corners = (shown: readonly number[]) => [shown.slice(0, 3), shown.slice(-3)];

it("shows the sky in the server's colours, above the horizon and below it, and other skies after it", async () => {
  const server = await serve();
  await putScene(server, square(SKY));
  const page = await pages.open(`${server.url}/#ui=0`, 480, 480);
  const [up, down] = corners(await expectTheSame(page, 'of the scene'));
  expect(up![2]! - up![0]!, 'blue').toBeGreaterThan(20);
  expect(Math.min(...up!)).toBeGreaterThan(Math.max(...down!));
  expect(down![0]! - down![2]!, 'brown').toBeGreaterThan(10);

  await page.evaluate(() =>
    window.viewer!.connection.call('scene.patch', {
      patch: [{ op: 'replace', path: '/extras/radiositySky/upper', value: [900, 300, 100] }],
    }),
  );
  const upper = () => page.evaluate(() => window.viewer!.viewer.background.sky?.upper);
  await until(upper, (sky) => sky?.[0] === 900);
  const [red] = corners(await expectTheSame(page, 'edited'));
  expect(red![0]! - red![2]!).toBeGreaterThan(50);

  // Without one of its own it is that of the settings.
  await putScene(server, square());
  await page.evaluate(() =>
    window.viewer!.connection.call('solve.configure', { sky: { upper: [100, 400, 100], lower: [400, 100, 400] } }),
  );
  await until(upper, (sky) => sky?.[1] === 400);
  const [green, pink] = corners(await expectTheSame(page, 'configured'));
  expect(green![1]! - green![0]!).toBeGreaterThan(30);
  expect(pink![0]! - pink![1]!).toBeGreaterThan(30);
});

it('shows no sky in other quantities, nor where there is none', async () => {
  const server = await serve();
  await putScene(server, square(SKY));
  const page = await pages.open(`${server.url}/#ui=0`, 480, 480);
  await converged(page);
  const isDark = async () => corners(await pixels(page, 60)).every((colour) => Math.max(...colour) === 0);
  expect(await isDark()).toBe(false);
  for (const mode of ['irradiance', 'radiosity', 'albedo', 'normals']) {
    await page.evaluate((mode) => window.viewer!.view.setMode(mode), mode);
    await drawn(page);
    expect(await isDark(), mode).toBe(true);
  }
  await page.evaluate(() => window.viewer!.view.setMode('lit'));
  await page.evaluate(() =>
    window.viewer!.connection.call('scene.patch', {
      patch: [
        { op: 'replace', path: '/extras/radiositySky', value: { upper: [0, 0, 0], lower: [0, 0, 0] } },
        { op: 'replace', path: '/materials/0/emissiveFactor', value: [1, 1, 1] },
      ],
    }),
  );
  await until(() => page.evaluate(() => window.viewer!.viewer.background.sky), (sky) => sky === undefined); // prettier-ignore
  await converged(page);
  expect(await isDark()).toBe(true);
});
