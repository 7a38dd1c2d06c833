// The exposure of a scene's first light, estimated by rays. A small picture that the card draws (exposure.ts) is exact,
// but the first one waits for a program to be compiled, which takes a second in software.

import { Mesh, type PerspectiveCamera } from 'three';
import { exposureOf } from './exposure';
import { LitMaterial } from '../scene/lit_material';
import type { LitScene } from '../scene/lit_scene';
import { pickSurface } from '../rays/picker';
import { spreadPoint } from '../rays/spread';
import { luminance } from '../../page/colours';

/** So many rays give a fifth of a stop, even in a picture whose luminances differ by factors of three. */
const MOST_RAYS = 128;
const LEAST_RAYS = 48;
/** Each ray tests each triangle; so many tests take some 10 ms. */
const MOST_TESTS = 400_000;

/** Undefined: rays cannot tell, because of textures, transparency or too many triangles. */
export function exposureByRays(scene: LitScene, camera: PerspectiveCamera): number | undefined {
  const rays = Math.min(MOST_RAYS, Math.floor(MOST_TESTS / Math.max(1, scene.triangles)));
  if (rays < LEAST_RAYS) return undefined;
  scene.root.updateMatrixWorld(true);
  camera.updateMatrixWorld();
  const seen: number[] = [];
  for (let i = 1; i <= rays; ++i) {
    const hit = pickSurface(scene, camera, ...spreadPoint(i));
    const material: unknown = hit?.object instanceof Mesh ? hit.object.material : undefined;
    if (!hit || !(material instanceof LitMaterial)) continue;
    if (!material.isPlain) return undefined;
    const irradiance = material.page && hit.uv1 ? material.page.sample(hit.uv1.x, hit.uv1.y) : undefined;
    if (irradiance || !material.page) seen.push(luminance(material.radianceOf(irradiance ?? [0, 0, 0])));
  }
  return exposureOf(seen);
}
