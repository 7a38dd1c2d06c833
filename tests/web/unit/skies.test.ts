import { PerspectiveCamera, Vector3 } from 'three';
import type { Gltf } from '../../../client/web/src/document/gltf';
import { pictureKey, setSkyPicture, setSkyTurn, skyTurn } from '../../../client/web/src/document/skies';
import { luminance } from '../../../client/web/src/page/colours';
import { SkyFetch } from '../../../client/web/src/scenes/sky_fetch';
import { ViewUniforms } from '../../../client/web/src/view/scene/lit_material';
import { SkyBackground } from '../../../client/web/src/view/scene/sky';
import { SkyPicture } from '../../../client/web/src/view/scene/sky_picture';

const document = (radiositySky: unknown) => ({ asset: { version: '2.0' }, extras: { radiositySky } }) as Gltf;

/** Two rows, four columns: 1 above the horizon but 4 towards +Z, 0.5 below it. */
function hdr(): Uint8Array<ArrayBuffer> {
  const head = new TextEncoder().encode('#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 2 +X 4\n');
  const pixels = [129, 129, 131, 129, 128, 128, 128, 128].flatMap((exponent) => [128, 128, 128, exponent]);
  return new Uint8Array([...head, ...pixels]);
}

it('knows which skies are pictures, and what they depend on', () => {
  for (const colours of [undefined, null, { upper: [1, 2, 3] }, 7])
    expect(pictureKey(document(colours))).toBeUndefined();
  const key = pictureKey(document({ bufferView: 3, rotation: 10 }));
  expect(key).toBeDefined();
  expect(pictureKey(document({ bufferView: 3, rotation: 20 }))).not.toBe(key);
  expect(pictureKey(document({ daylight: {} }))).toBeDefined();
  const extension = {
    asset: { version: '2.0' },
    scenes: [{ extensions: { EXT_lights_image_based: { light: 0 } } }],
    extensions: { EXT_lights_image_based: { lights: [{}] } },
  } as unknown as Gltf;
  expect(pictureKey(extension)).toContain('light');
});

it('turns them, and puts another in their place', () => {
  expect(skyTurn(document({ upper: [1, 2, 3] }))).toBeUndefined();
  expect(skyTurn(document({ daylight: {} }))).toEqual({ rotation: 0, strength: 1 });
  expect(setSkyTurn('rotation', 30)).toEqual([{ op: 'add', path: '/extras/radiositySky/rotation', value: 30 }]);
  const gltf = { ...document({ bufferView: 0, strength: 5 }), buffers: [{}], bufferViews: [{}, {}] } as Gltf;
  expect(setSkyPicture(gltf, '/uploads/a', 99)).toEqual([
    { op: 'add', path: '/buffers/-', value: { uri: '/uploads/a', byteLength: 99 } },
    { op: 'add', path: '/bufferViews/-', value: { buffer: 1, byteLength: 99 } },
    { op: 'add', path: '/extras/radiositySky', value: { rotation: 0, strength: 5, bufferView: 2 } },
  ]);
  const bare = setSkyPicture({ asset: { version: '2.0' } }, '/uploads/a', 1);
  expect(bare.map(({ path }) => path)).toEqual([
    '/buffers',
    '/bufferViews',
    '/buffers/-',
    '/bufferViews/-',
    '/extras',
    '/extras/radiositySky',
  ]);
});

it('reads pictures as the server sends them, and draws them whole', () => {
  expect(SkyPicture.from(new Uint8Array([1, 2, 3]))).toBeUndefined();
  expect(SkyPicture.from(hdr().subarray(0, 60))).toBeUndefined();
  const picture = SkyPicture.from(hdr())!;
  expect([picture.width, picture.height]).toEqual([4, 2]);
  expect(picture.at(new Vector3(-0.1, 0.1, 1))).toEqual([1, 1, 1]);
  expect(picture.at(new Vector3(0.1, 0.1, 1))).toEqual([4, 4, 4]);
  expect(picture.at(new Vector3(0.1, -0.1, 1))).toEqual([0.5, 0.5, 0.5]);
  const background = new SkyBackground(new ViewUniforms());
  background.ofSettings = { upper: [9, 9, 9], lower: [9, 9, 9] };
  background.setPicture(picture);
  background.refresh(true);
  expect(background.mesh.visible).toBe(true);
  const camera = new PerspectiveCamera(60, 1);
  camera.rotation.set(0.2, Math.PI + 0.1, 0, 'YXZ'); // towards +Z, and up
  camera.updateMatrixWorld();
  expect(background.luminanceAt(camera, 0, 0)).toBeCloseTo(luminance([4, 4, 4]), 9);
  background.setPicture(undefined);
  expect(background.luminanceAt(camera, 0, 0)).toBeCloseTo(luminance([9, 9, 9]), 9);
});

it('asks again for a picture that did not come', async () => {
  vi.useFakeTimers();
  try {
    let asked = 0;
    const shown: (number | undefined)[] = [];
    const sky = new SkyFetch({
      fetch: () => (++asked < 3 ? Promise.reject(new Error('gone')) : Promise.resolve(new Response(hdr()))),
      show: (bytes) => shown.push(bytes?.length),
    });
    sky.onDocument(document({ bufferView: 1 }), true);
    await vi.runAllTimersAsync();
    expect([asked, shown]).toEqual([3, [hdr().length]]);
  } finally {
    vi.useRealTimers();
  }
});

it('fetches a picture once the document names another, and none for colours', async () => {
  vi.useFakeTimers();
  try {
    const asked: string[] = [];
    const shown: (number | undefined)[] = [];
    const sky = new SkyFetch({
      fetch: (path) => {
        asked.push(path);
        return Promise.resolve(new Response(hdr()));
      },
      show: (bytes) => shown.push(bytes?.length),
    });
    sky.onDocument(document({ upper: [1, 1, 1] }), true);
    sky.onDocument(document({ bufferView: 1 }), false);
    sky.onDocument(document({ bufferView: 1, rotation: 1 }), false);
    await vi.runAllTimersAsync();
    expect(asked).toEqual(['/sky.hdr']);
    expect(shown).toEqual([hdr().length]);
    sky.onDocument(document({ bufferView: 1, rotation: 1 }), false);
    await vi.runAllTimersAsync();
    expect(asked).toHaveLength(1);
    // Another scene, whose picture has the same number.
    sky.onDocument(document({ bufferView: 1, rotation: 1 }), true);
    await vi.runAllTimersAsync();
    expect(asked).toHaveLength(2);
    sky.onDocument(document(undefined), false);
    expect(shown).toEqual([hdr().length, hdr().length, undefined]);
    sky.onDocument(document(undefined), true);
    expect(shown).toHaveLength(3);
  } finally {
    vi.useRealTimers();
  }
});
