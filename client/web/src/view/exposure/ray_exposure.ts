// The exposure of a scene's first light from some rays, where these can tell it: a small picture that the card draws and
// gives back (exposure.ts) is exact, but the first waits for a program to be compiled, a second where drawing is slow.

import { Mesh, type PerspectiveCamera } from 'three';
import { exposureOf } from './exposure';
import { LitMaterial } from '../scene/lit_material';
import type { LitScene } from '../scene/lit_scene';
import { pickSurface } from '../rays/picker';
import { luminance } from '../../page/colours';

/** Of so many, even a picture whose luminances differ by factors of three is told to a fifth of a stop. */
const MOST_RAYS = 128;
const LEAST_RAYS = 48;
/** Every ray asks every triangle: some 10 ms in all. */
const MOST_TESTS = 400_000;

/** Undefined: there are pictures on the surfaces, something is seen through, or there are too many triangles. */
export function exposureByRays(scene: LitScene, camera: PerspectiveCamera): number | undefined {
  const rays = Math.min(MOST_RAYS, Math.floor(MOST_TESTS / Math.max(1, scene.triangles)));
  if (rays < LEAST_RAYS) return undefined;
  scene.root.updateMatrixWorld(true);
  camera.updateMatrixWorld();
  const seen: number[] = [];
  for (let i = 1; i <= rays; ++i) {
    // Evenly spread for every number of rays (the R2 sequence of Martin Roberts, 2018).
    const hit = pickSurface(
      scene,
      camera,
      2 * ((i * 0.7548776662466927) % 1) - 1,
      2 * ((i * 0.5698402909980532) % 1) - 1,
    );
    const material: unknown = hit?.object instanceof Mesh ? hit.object.material : undefined;
    if (!hit || !(material instanceof LitMaterial)) continue;
    if (!material.isPlain) return undefined;
    const irradiance = material.page && hit.uv1 ? material.page.sample(hit.uv1.x, hit.uv1.y) : undefined;
    if (irradiance || !material.page) seen.push(luminance(material.radianceOf(irradiance ?? [0, 0, 0])));
  }
  return exposureOf(seen);
}
