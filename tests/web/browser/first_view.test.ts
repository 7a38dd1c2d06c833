// Where one looks from at first, in scenes without a camera.

import type {} from '../../../client/web/src/main';
import { converged, putScene, serveEach, squares, type GltfNode } from './harness';

const { pages, serve } = serveEach();

const PLASTER = { doubleSided: true, pbrMetallicRoughness: { baseColorFactor: [0.6, 0.6, 0.6, 1], metallicFactor: 0 } };
const LAMP = { emissiveFactor: [1, 1, 1] };
const H = Math.SQRT1_2;

/** One metre wide, and 1.1 m high under its roof; one looks in where the front is left out. */
const FLOOR: GltfNode = { name: 'floor', mesh: 0 };
const ROOM: GltfNode[] = [
  FLOOR,
  { name: 'back', mesh: 0, translation: [0, 0.5, -0.5], rotation: [H, 0, 0, H] },
  { name: 'left', mesh: 0, translation: [-0.5, 0.5, 0], rotation: [0, 0, -H, H] },
  { name: 'right', mesh: 0, translation: [0.5, 0.5, 0], rotation: [0, 0, H, H] },
  { name: 'lamp', mesh: 1, translation: [0, 0.99, 0], rotation: [1, 0, 0, 0] },
  { name: 'roof', mesh: 0, translation: [0, 1, 0] },
];
const FRONT: GltfNode = { name: 'front', mesh: 0, translation: [0, 0.5, 0.5], rotation: [H, 0, 0, H] };

async function eyeIn(nodes: GltfNode[]): Promise<number[]> {
  const server = await serve();
  await putScene(server, squares(nodes, [PLASTER, LAMP]));
  const page = await pages.open(server.url);
  await converged(page);
  return page.evaluate(() => window.viewer!.viewer.rig.camera.position.toArray());
}

const isInside = ([x, y, z]: number[]) => Math.max(Math.abs(x!), Math.abs(y! - 0.5), Math.abs(z!)) < 0.5;

it('looks at a closed room whose lamp is inside from inside, where all else is dark', async () => {
  expect(isInside(await eyeIn([...ROOM, FRONT]))).toBe(true);
});

it('looks from outside where light is seen from there', async () => {
  const [, , z] = await eyeIn(ROOM);
  expect(z).toBeGreaterThan(1);
});

it('takes no camera of a link from which there would be no way back', async () => {
  const server = await serve();
  await putScene(server, squares(ROOM, [PLASTER, LAMP]));
  const page = await pages.open(`${server.url}/#camera=1e300,0,0,0,0,0,50,0`);
  await converged(page);
  const eye = await page.evaluate(() => window.viewer!.viewer.rig.camera.position.toArray());
  expect(
    eye.every((v) => Math.abs(v) < 10),
    eye.join(),
  ).toBe(true);
});
