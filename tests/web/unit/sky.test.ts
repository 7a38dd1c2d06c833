import { PerspectiveCamera } from 'three';
import type { Gltf } from '../../../client/web/src/document/gltf';
import { ViewUniforms } from '../../../client/web/src/view/scene/lit_material';
import { luminance } from '../../../client/web/src/page/colours';
import { SkyBackground, skyOf } from '../../../client/web/src/view/scene/sky';

const BLUE: [number, number, number] = [1, 2, 4];
const GREEN: [number, number, number] = [0, 1, 0];
const document = (radiositySky: unknown) => ({ asset: { version: '2.0' }, extras: { radiositySky } }) as Gltf;

it('reads the sky of a document as the server does', () => {
  expect(skyOf(document({ upper: BLUE, lower: GREEN }))).toEqual({ upper: BLUE, lower: GREEN });
  expect(skyOf(document({ upper: BLUE }))).toEqual({ upper: BLUE, lower: BLUE });
  for (const wrong of [undefined, null, 7, [], {}, { upper: [1, 2] }, { upper: [1, -2, 3] }, { upper: BLUE, lower: 1 }])
    expect(skyOf(document(wrong)), JSON.stringify(wrong)).toBeUndefined();
  expect(skyOf({ asset: { version: '2.0' } })).toBeUndefined();
  expect(skyOf({ asset: { version: '2.0' }, extras: 'a text' })).toBeUndefined();
});

it("takes that of the settings only where the scene has none of its own, be the scene's black", () => {
  const background = new SkyBackground(new ViewUniforms());
  expect(background.sky).toBeUndefined();
  background.ofSettings = { upper: BLUE, lower: GREEN };
  expect(background.sky?.upper).toEqual(BLUE);
  background.ofScene = { upper: GREEN, lower: GREEN };
  expect(background.sky?.upper).toEqual(GREEN);
  background.ofScene = { upper: [0, 0, 0], lower: [0, 0, 0] };
  expect(background.sky).toBeUndefined();
  background.refresh(true);
  expect(background.mesh.visible).toBe(false);
});

it('is seen by the direction of each place in the picture', () => {
  const background = new SkyBackground(new ViewUniforms());
  background.ofScene = { upper: BLUE, lower: GREEN };
  background.refresh(true);
  expect(background.mesh.visible).toBe(true);
  background.refresh(false);
  expect(background.mesh.visible).toBe(false);
  const camera = new PerspectiveCamera(60, 1);
  camera.position.set(3, 50, 1);
  camera.rotation.x = 0.1; // the horizon is a little below the middle
  camera.updateMatrixWorld();
  const edge = -Math.tan(0.1) / Math.tan(Math.PI / 6);
  expect(background.luminanceAt(camera, 0.3, edge + 0.01)).toBeCloseTo(luminance(BLUE), 9);
  expect(background.luminanceAt(camera, -0.3, edge - 0.01)).toBeCloseTo(luminance(GREEN), 9);
});
