// The box around what an object is made of: its surfaces. The signs of lamps are none; of a lamp the place is what counts.

import { Box3, Mesh, type BufferGeometry, type Object3D } from 'three';
import { LampMarker } from './lamp_marker';

/** In metres of the scene; empty where an object has no surface. */
export function surfaceBox(object: Object3D): Box3 {
  const box = new Box3();
  object.updateWorldMatrix(true, true);
  object.traverse((child) => {
    if (!(child instanceof Mesh) || child.parent instanceof LampMarker) return;
    const geometry = child.geometry as BufferGeometry;
    if (!geometry.boundingBox) geometry.computeBoundingBox();
    box.union(geometry.boundingBox!.clone().applyMatrix4(child.matrixWorld));
  });
  return box;
}
