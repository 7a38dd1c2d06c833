// What `radiosity solve --for` writes shows in the engine what a path tracer says is there.

import { execFileSync } from 'node:child_process';
import { existsSync, readFileSync } from 'node:fs';
import { extname, join, normalize } from 'node:path';
import { fileURLToPath } from 'node:url';
import { FloatType } from 'three';
import { EXRLoader } from 'three/addons/loaders/EXRLoader.js';
import { Pages } from '../browser/harness';
import { readGlb, withGlass, withOddMaterials, withTexture } from './glb';
import { compare, expectTheSame, fromBase64, HEIGHT, traced, WIDTH, type Difference } from './pictures';
import { folder, SCENES, solve } from './solve';
import { WebServer } from './web_server';

const TYPES: Record<string, string> = { '.html': 'text/html', '.js': 'text/javascript', '.mjs': 'text/javascript' };
const QUALITY = ['--quiet', '--error', '0.01', '--texels', '80000', '--time-limit', '20'];
const PACKAGES = fileURLToPath(new URL('../../../client/web/', import.meta.url));

const out = folder();
const pages = new Pages([WIDTH, HEIGHT]);
/** What is served: a folder as it was written, with node_modules as if npm had been run in it. */
let shown = '';

function fileOf(path: string): string {
  if (path.startsWith('/node_modules/')) return join(PACKAGES, path);
  if (path.startsWith('/draw/')) return fileURLToPath(new URL(`.${path}`, import.meta.url));
  return join(shown, path === '/' ? 'index.html' : path);
}

const server = new WebServer((url) => {
  const file = fileOf(normalize(decodeURIComponent(url)));
  return { body: readFileSync(file), type: TYPES[extname(file)] ?? 'application/octet-stream' };
});

beforeAll(async () => {
  await server.launch();
  await pages.launch();
});
afterAll(async () => {
  await pages.quit();
  server.quit();
});

async function openPage() {
  const page = await pages.open(server.url);
  await page.waitForFunction(() => !document.getElementById('note'));
  return page;
}

/** By the script of the folder, with the scene's camera. */
async function drawn(engine: string): Promise<Float32Array> {
  const page = await openPage();
  await page.addScriptTag({ type: 'module', url: `/draw/${engine}.js` });
  await page.waitForFunction(() => 'draw' in window);
  const text = await page.evaluate(
    async ([width, height]) => {
      const { draw } = window as unknown as { draw(width: number, height: number): Promise<Float32Array> };
      const pixels = await draw(width, height);
      const bytes = new Uint8Array(pixels.buffer, pixels.byteOffset, pixels.byteLength);
      let text = '';
      for (let i = 0; i < bytes.length; i += 0x8000) text += String.fromCharCode(...bytes.subarray(i, i + 0x8000));
      return btoa(text);
    },
    [WIDTH, HEIGHT] as const,
  );
  await pages.closeAll();
  expect(pages.complaints.splice(0)).toEqual([]);
  return fromBase64(text);
}

interface Seen {
  /** Of R, G and B, from 0 to 1. */
  mean: number;
  /** Of the picture that is magenta, which engines draw where they lack a texture. */
  magenta: number;
  isEmpty: boolean;
}

/** Runs in the page. */
async function lookAt(png: string): Promise<Seen> {
  const bitmap = await createImageBitmap(await (await fetch(`data:image/png;base64,${png}`)).blob());
  const context = new OffscreenCanvas(bitmap.width, bitmap.height).getContext('2d')!;
  context.drawImage(bitmap, 0, 0);
  const { data } = context.getImageData(0, 0, bitmap.width, bitmap.height);
  let magenta = 0;
  for (let i = 0; i < data.length; i += 4) magenta += Number(Math.min(data[i]!, data[i + 2]!) > 2 * data[i + 1]! + 20);
  const sum = data.reduce((sum, value, i) => sum + (i % 4 < 3 ? value : 0), 0);
  const isEmpty = data.every((value, i) => value === data[i % 4]);
  return { mean: sum / (0.75 * 255 * data.length), magenta: (4 * magenta) / data.length, isEmpty };
}

/** The page as one sees it, once something is drawn: shaders may not be ready in the first frames. */
async function seen(picture: string): Promise<Seen> {
  const page = await openPage();
  const look = async () => {
    const png = await page.screenshot({ path: join(out, picture) });
    return page.evaluate(lookAt, png.toString('base64'));
  };
  let what = await look();
  for (const end = Date.now() + 60_000; what.isEmpty && Date.now() < end; what = await look()) await page.waitForTimeout(100); // prettier-ignore
  await pages.closeAll();
  expect(pages.complaints.splice(0)).toEqual([]);
  return what;
}

const truths = new Map<string, Promise<Float32Array>>();

async function differenceOf(engine: string, name: string, scene = join(SCENES, `${name}.glb`)): Promise<Difference> {
  shown = join(out, `${engine}-${name}`);
  await solve(scene, shown, ...QUALITY, '--for', engine);
  const truth = truths.get(name) ?? traced(scene, join(out, `${name}.f32`));
  truths.set(name, truth);
  const difference = compare(await drawn(engine), await truth);
  console.log(`${engine}, ${name}: ratio ${difference.ratio.toFixed(4)}, RMS ${difference.rms.toFixed(4)}, worst ${difference.worst.toFixed(3)}`); // prettier-ignore
  return difference;
}

function textured(): string {
  const scene = join(out, 'room_textured.glb');
  withTexture(join(SCENES, 'room_small.glb'), scene, ['floor', 'red_wall']);
  return scene;
}

function oddlyTextured(): string {
  const scene = join(out, 'room_odd.glb');
  withOddMaterials(textured(), scene, 'floor', 'red_wall');
  return scene;
}

describe.each(['three', 'babylon', 'playcanvas'])('%s', (engine) => {
  it('the Cornell box, and the page of the folder', async () => {
    expectTheSame(await differenceOf(engine, 'cornell'));
    const { mean, magenta } = await seen(`${engine}.png`);
    console.log(`${engine}: mean ${mean.toFixed(3)}`);
    // 0.34, as the exposure has it. A factor of pi more or less makes that 0.6 or 0.2.
    expect(mean).toBeGreaterThan(0.27);
    expect(mean).toBeLessThan(0.45);
    expect(magenta).toBe(0);
  });

  it('a furnished room with double-sided walls', async () =>
    expectTheSame(await differenceOf(engine, 'room_small_double')));

  it('a room whose lamps the engine knows, and does not light with once more', async () => {
    expectTheSame(await differenceOf(engine, 'room_lights'));
    const { gltf } = readGlb(join(shown, 'scene.glb'));
    expect(JSON.stringify(gltf)).not.toContain('KHR_lights_punctual');
    const { bakedLights } = JSON.parse(readFileSync(join(shown, 'lighting.json'), 'utf8')) as { bakedLights: string[] };
    expect(bakedLights.length).toBe(2);
  });

  it('a room with textures', async () => expectTheSame(await differenceOf(engine, 'room_textured', textured())));

  it('a room with an unlit wall, and a floor of specular-glossiness with textures', async () =>
    expectTheSame(await differenceOf(engine, 'room_odd', oddlyTextured())));

  it('names the version that is tested', () => {
    const versionsIn = (file: string) => {
      const { dependencies = {}, devDependencies = {} } = JSON.parse(readFileSync(file, 'utf8')) as Record<string, Record<string, string>>; // prettier-ignore
      return { ...dependencies, ...devDependencies };
    };
    const ours = versionsIn(join(PACKAGES, 'package.json'));
    const named = Object.entries(versionsIn(join(PACKAGES, '../engines/files', engine, 'package.json')));
    expect(named.length).toBeGreaterThan(1);
    for (const [name, version] of named) expect(version, name).toBe(ours[name]);
  });
});

it('glass in PlayCanvas shows what is behind it', async () => {
  const scene = join(out, 'glass.glb');
  withGlass(join(SCENES, 'cornell.glb'), scene, 6); // the tall block
  shown = join(out, 'playcanvas-glass');
  await solve(
    scene,
    shown,
    '--quiet',
    '--error',
    '0.3',
    '--texels',
    '2000',
    '--time-limit',
    '2',
    '--for',
    'playcanvas',
  );
  const { mean, magenta } = await seen('glass.png');
  expect(mean).toBeGreaterThan(0.27); // as the box without glass
  expect(magenta).toBe(0);
});

describe.skipIf(!existsSync('/usr/bin/blender'))("blender (skipped: '/usr/bin/blender' is not there)", () => {
  /** scene.blend as Cycles renders it: R, G, B of each pixel, rows from the top. */
  function rendered(): Float32Array {
    const script = fileURLToPath(new URL('draw/blender.py', import.meta.url));
    const file = join(shown, 'out.exr');
    const args = ['--background', join(shown, 'scene.blend'), '--python-exit-code', '1', '--python', script, '--'];
    execFileSync('blender', [...args, file, String(WIDTH), String(HEIGHT)], { stdio: 'pipe' });
    const bytes = readFileSync(file);
    const { data } = new EXRLoader().setDataType(FloatType).parse(bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length)); // prettier-ignore
    return fromBase64(Buffer.from((data as Float32Array).buffer).toString('base64'));
  }

  it.each(['cornell', 'room_small_double', 'room_lights'])('%s', async (name) => {
    const scene = join(SCENES, `${name}.glb`);
    shown = join(out, `blender-${name}`);
    await solve(scene, shown, ...QUALITY, '--for', 'blender');
    const truth = await (truths.get(name) ?? traced(scene, join(out, `${name}.f32`)));
    const difference = compare(rendered(), truth);
    console.log(`blender, ${name}: ratio ${difference.ratio.toFixed(4)}, RMS ${difference.rms.toFixed(4)}, worst ${difference.worst.toFixed(3)}`); // prettier-ignore
    expectTheSame(difference);
  });
});
