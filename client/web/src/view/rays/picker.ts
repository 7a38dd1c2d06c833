// Finds the object and the light under the pointer.

import { Mesh, Raycaster, Vector2, type Vector3, type Intersection, type PerspectiveCamera } from 'three';
import { luminance } from '../../page/colours';
import { LitMaterial } from '../scene/lit_material';
import type { LightmapPage } from '../light/lightmap_page';
import type { LitScene } from '../scene/lit_scene';

export interface Reading {
  /** Metres; undefined in a gap. */
  point: Vector3 | undefined;
  /** Irradiance in lux, linear R, G, B; undefined: no light is known. */
  irradiance: [number, number, number] | undefined;
  /** The place is between the charts of a page, where there is no surface. */
  isGap?: boolean;
  /** Its standard error (lux, luminance); undefined: the server does not stream errors. */
  error: number | undefined;
  /** Light that leaves, lm/m^2, luminance; undefined where it differs within the surface. */
  radiosity: number | undefined;
  node: number | undefined;
  material: number | undefined;
  page: number | undefined;
  texel: [number, number] | undefined;
}

const caster = new Raycaster();

/** The object to select, which may be the sign of a lamp. `x`, `y`: normalised device coordinates. */
export function pick(scene: LitScene, camera: PerspectiveCamera, x: number, y: number): Intersection | undefined {
  return hits(scene, camera, x, y)[0];
}

function shown(object: Mesh): boolean {
  for (let at: Mesh['parent'] = object; at; at = at.parent) if (!at.visible) return false;
  return true;
}

/** The nearest surface. Signs of lamps hide no light. */
export function pickSurface(
  scene: LitScene,
  camera: PerspectiveCamera,
  x: number,
  y: number,
): Intersection | undefined {
  return hits(scene, camera, x, y).find(
    ({ object }) => object instanceof Mesh && object.material instanceof LitMaterial,
  );
}

function hits(scene: LitScene, camera: PerspectiveCamera, x: number, y: number): Intersection[] {
  caster.setFromCamera(new Vector2(x, y), camera);
  caster.params.Line = { threshold: 0 };
  return caster
    .intersectObjects(scene.pickable(), true)
    .filter(({ object }) => object instanceof Mesh && shown(object));
}

export function readingAt(scene: LitScene, hit: Intersection, errors?: readonly LightmapPage[]): Reading {
  const page = hit.object.userData['page'] as LightmapPage | undefined;
  const uv = hit.uv1;
  const index = page ? scene.set.pages.indexOf(page) : -1;
  const error = uv ? errors?.[index]?.sample(uv.x, uv.y) : undefined;
  const irradiance = page && uv ? page.sample(uv.x, uv.y) : undefined;
  const material: unknown = hit.object instanceof Mesh ? hit.object.material : undefined;
  const radiance = irradiance && material instanceof LitMaterial && material.isPlain && material.radianceOf(irradiance);
  return {
    point: hit.point.clone(),
    irradiance,
    error: error && luminance(error),
    radiosity: radiance ? Math.PI * luminance(radiance) : undefined,
    node: scene.nodeOf(hit.object),
    material: scene.materialIndexOf(hit.object),
    page: page ? index : undefined,
    texel: page && uv ? [Math.floor(uv.x * page.width), Math.floor(uv.y * page.height)] : undefined,
  };
}
