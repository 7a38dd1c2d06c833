import { Color, Group, Mesh, MeshStandardMaterial, PerspectiveCamera, PlaneGeometry, Texture } from 'three';
import { LitMaterial, ViewUniforms } from '../../../client/web/src/view/scene/lit_material';
import type { LightmapPage } from '../../../client/web/src/view/light/lightmap_page';
import type { LitScene } from '../../../client/web/src/view/scene/lit_scene';
import { exposureByRays } from '../../../client/web/src/view/exposure/ray_exposure';

type Irradiance = [number, number, number] | undefined;

/** A wall before the camera, wider than the picture, under so many lux. */
function wall(irradiance: Irradiance, change: (source: MeshStandardMaterial) => void = () => undefined): LitScene {
  const page = { texture: new Texture(), scale: 1, uniforms: {}, sample: () => irradiance } as unknown as LightmapPage;
  const source = new MeshStandardMaterial({ color: new Color(0.5, 0.5, 0.5), metalness: 0 });
  change(source);
  const geometry = new PlaneGeometry(50, 50);
  geometry.setAttribute('uv1', geometry.getAttribute('uv'));
  const root = new Group().add(new Mesh(geometry, new LitMaterial(source, new ViewUniforms(), page)));
  return { root, triangles: 2, pickable: () => [root] } as unknown as LitScene;
}

const camera = new PerspectiveCamera(50, 1, 0.1, 100);
camera.position.z = 5;

it('tells the exposure of plain surfaces as the meter would', () => {
  expect(exposureByRays(wall([300, 300, 300]), camera)).toBeCloseTo(0.18 / ((0.5 * 300) / Math.PI), 10);
  const glowing = wall([300, 300, 300], (source) => {
    source.emissive = new Color(1, 1, 1);
    source.emissiveIntensity = 20;
  });
  expect(exposureByRays(glowing, camera)).toBeCloseTo(0.18 / (20 + (0.5 * 300) / Math.PI), 10);
});

it('says nothing of what it cannot tell', () => {
  expect(exposureByRays(wall(undefined), camera)).toBeUndefined(); // no light has come
  expect(exposureByRays(wall([0, 0, 0]), camera)).toBeUndefined();
  expect(
    exposureByRays(
      wall([9, 9, 9], (source) => (source.map = new Texture())),
      camera,
    ),
  ).toBeUndefined();
  expect(
    exposureByRays(
      wall([9, 9, 9], (source) => (source.transparent = true)),
      camera,
    ),
  ).toBeUndefined();
  expect(exposureByRays({ ...wall([9, 9, 9]), triangles: 10_000 } as LitScene, camera)).toBeUndefined();
});
