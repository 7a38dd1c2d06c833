// What a user sees who puts the lightmap on the lit scene in three.js is what a path tracer says is there.

import { readFileSync } from 'node:fs';
import { basename, join, normalize } from 'node:path';
import { fileURLToPath } from 'node:url';
import { Pages } from '../browser/harness';
import { withTexture } from './glb';
import { compare, expectTheSame, fromBase64, HEIGHT, traced, WIDTH, type Difference } from './pictures';
import { filesBelow, folder, SCENES, solve } from './solve';
import { WebServer, type Served } from './web_server';

const out = folder();
const pages = new Pages();

/** three.js as npm brings it, the stage, and what was solved. */
function serve(url: string): Served {
  const path = normalize(decodeURIComponent(url));
  const here = (name: string) => fileURLToPath(new URL(name, import.meta.url));
  if (path === '/') return { body: readFileSync(here('stage.html')), type: 'text/html' };
  if (path.startsWith('/three/'))
    return { body: readFileSync(here(`../../../client/web/node_modules${path}`)), type: 'text/javascript' };
  if (path.startsWith('/draw/')) return { body: readFileSync(here(`.${path}`)), type: 'text/javascript' };
  return { body: readFileSync(join(out, basename(path))), type: 'application/octet-stream' };
}

const server = new WebServer(serve);

beforeAll(async () => {
  await server.launch();
  await pages.launch();
});
afterAll(async () => {
  await pages.quit();
  server.quit();
});

/** R, G, B of each pixel, rows from the top. Without a kind of material: the file alone, as it is. */
async function drawn(name: string, kind?: string): Promise<Float32Array> {
  const maps = kind ? filesBelow(out, new RegExp(`^${name}-lit\\.lightmap\\.\\d+\\.exr$`)) : [];
  const page = await pages.open(server.url);
  await page.waitForFunction(() => 'draw' in window);
  const what = {
    lit: `/${name}-lit.glb`,
    pages: maps.map((_, i) => `/${name}-lit.lightmap.${i}.exr`),
    width: WIDTH,
    height: HEIGHT,
    kind,
  };
  const text = await page.evaluate(
    (what) => (window as unknown as { draw(what: unknown): Promise<string> }).draw(what),
    what,
  );
  await pages.closeAll();
  return fromBase64(text);
}

const QUALITY = ['--quiet', '--error', '0.01', '--texels', '80000', '--time-limit', '20'];

async function solved(name: string, scene = join(SCENES, `${name}.glb`)): Promise<string> {
  await solve(scene, join(out, `${name}-lit.glb`), ...QUALITY);
  return scene;
}

async function differenceOf(name: string, scene?: string): Promise<Difference> {
  const file = await solved(name, scene);
  const difference = compare(await drawn(name, 'MeshLambertMaterial'), await traced(file, join(out, `${name}.f32`)));
  console.log(`${name}: ratio ${difference.ratio.toFixed(4)}, RMS ${difference.rms.toFixed(4)}, worst ${difference.worst.toFixed(3)}`); // prettier-ignore
  expect(pages.complaints.splice(0)).toEqual([]);
  return difference;
}

it('the Cornell box', async () => expectTheSame(await differenceOf('cornell')));

it('a furnished room', async () => expectTheSame(await differenceOf('room_small')));

it('the same room with double-sided walls and furniture', async () =>
  expectTheSame(await differenceOf('room_small_double')));

it('a room lit by a bulb and a spot light', async () => expectTheSame(await differenceOf('room_lights')));

it('a ball and a barrel of few facets, smooth by their normals', async () =>
  expectTheSame(await differenceOf('room_smooth')));

it('a room with textures', async () => {
  const scene = join(out, 'room_textured.glb');
  withTexture(join(SCENES, 'room_small.glb'), scene, ['floor', 'red_wall']);
  expectTheSame(await differenceOf('room_textured', scene));
});

it('is a little darker in MeshStandardMaterial, which keeps light for a gloss that nothing lights', async () => {
  const lambert = await drawn('cornell', 'MeshLambertMaterial');
  const { ratio } = compare(await drawn('cornell', 'MeshStandardMaterial'), lambert);
  expect(ratio).toBeGreaterThan(0.9);
  expect(ratio).toBeLessThan(0.99);
});

it('shows colours and lamps in the unlit file by itself, exposed and mapped', async () => {
  await solve(join(SCENES, 'cornell.glb'), join(out, 'unlit-lit.glb'), ...QUALITY, '--unlit');
  const picture = await drawn('unlit');
  const of = (x: number, y: number) => Array.from(picture.subarray(3 * (y * WIDTH + x), 3 * (y * WIDTH + x) + 3));
  const [left, right] = [of(WIDTH / 5, HEIGHT / 2), of((4 * WIDTH) / 5, HEIGHT / 2)];
  expect(left[0]! / left[1]!).toBeGreaterThan(3); // red
  expect(right[1]! / right[0]!).toBeGreaterThan(1.5); // green
  expect(picture.reduce((most, value) => Math.max(most, value), 0)).toBeGreaterThan(0.9); // the lamp
  const mean = picture.reduce((sum, value) => sum + value, 0) / picture.length;
  expect(mean).toBeGreaterThan(0.03);
  expect(mean).toBeLessThan(0.5);
});
