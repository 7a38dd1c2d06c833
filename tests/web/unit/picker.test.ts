import {
  Color,
  Mesh,
  MeshStandardMaterial,
  PerspectiveCamera,
  PlaneGeometry,
  Raycaster,
  Texture,
  Vector3,
} from 'three';
import { LitMaterial, ViewUniforms } from '../../../client/web/src/view/scene/lit_material';
import type { LightmapPage } from '../../../client/web/src/view/light/lightmap_page';
import type { LitScene } from '../../../client/web/src/view/scene/lit_scene';
import { LampMarker } from '../../../client/web/src/view/scene/lamp_marker';
import { pick, pickSurface, readingAt, type Reading } from '../../../client/web/src/view/rays/picker';
import { luminance } from '../../../client/web/src/page/colours';

type Rgb = [number, number, number];

/** What the meter reads a quarter from the left and the lower edge of a page on a wall. */
function reading(irradiance: Rgb | undefined, source: MeshStandardMaterial, error?: Rgb): Reading {
  const pageOf = (light: Rgb | undefined) =>
    ({
      texture: new Texture(),
      scale: 1,
      uniforms: {},
      width: 64,
      height: 32,
      sample: () => light,
    }) as unknown as LightmapPage;
  const page = pageOf(irradiance);
  const geometry = new PlaneGeometry(2, 2);
  geometry.setAttribute('uv1', geometry.getAttribute('uv'));
  const wall = new Mesh(geometry, new LitMaterial(source, new ViewUniforms(), page));
  wall.userData = { page };
  wall.updateMatrixWorld();
  const ray = new Raycaster(new Vector3(-0.5, -0.5, 3), new Vector3(0, 0, -1));
  const scene = { set: { pages: [page] }, nodeOf: () => 7, materialIndexOf: () => 2 } as unknown as LitScene;
  return readingAt(scene, ray.intersectObject(wall)[0]!, error && [pageOf(error)]);
}

const grey = () => new MeshStandardMaterial({ color: new Color(0.5, 0.5, 0.5), metalness: 0 });

describe('the light meter', () => {
  it('reads the light that falls and its error where it points', () => {
    const read = reading([300, 200, 100], grey(), [3, 2, 1]);
    expect(read.irradiance).toEqual([300, 200, 100]);
    expect(read.error).toBeCloseTo(luminance([3, 2, 1]), 10);
    expect([read.page, read.texel, read.node, read.material]).toEqual([0, [16, 8], 7, 2]);
    expect(read.point!.toArray().map((v) => Math.round(v * 1e6) / 1e6 + 0)).toEqual([-0.5, -0.5, 0]);
  });

  it('reads the light that leaves a plain surface: what it reflects and what it emits', () => {
    expect(reading([300, 200, 100], grey()).radiosity).toBeCloseTo(0.5 * luminance([300, 200, 100]), 10);
    const lamp = grey();
    lamp.emissive = new Color(1, 1, 1);
    lamp.emissiveIntensity = 20;
    expect(reading([300, 300, 300], lamp).radiosity).toBeCloseTo(20 * Math.PI + 0.5 * 300, 10);
    const metal = grey();
    metal.metalness = 0.75;
    expect(reading([400, 400, 400], metal).radiosity).toBeCloseTo(0.25 * 0.5 * 400, 10);
  });

  it('reads the surface behind the sign of a lamp, which is for the hand', () => {
    const wall = new Mesh(new PlaneGeometry(2, 2), new LitMaterial(grey(), new ViewUniforms(), undefined));
    const sign = new LampMarker(3);
    sign.position.z = 1;
    sign.scale.setScalar(0.1);
    sign.updateMatrixWorld(true);
    const camera = new PerspectiveCamera();
    camera.position.z = 3;
    camera.updateMatrixWorld();
    const scene = { pickable: () => [wall, sign] } as unknown as LitScene;
    expect(pick(scene, camera, 0, 0)?.object.parent).toBe(sign);
    expect(pickSurface(scene, camera, 0, 0)?.object).toBe(wall);
  });

  it('says nothing of what leaves where that differs within the surface, or where no light is known', () => {
    const printed = grey();
    printed.map = new Texture();
    expect(reading([300, 300, 300], printed).radiosity).toBeUndefined();
    expect(reading(undefined, grey()).radiosity).toBeUndefined();
    expect(reading([0, 0, 0], grey()).radiosity).toBe(0);
  });
});
