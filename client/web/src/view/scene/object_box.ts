// The surfaces of an object, and the box around them. The sign of a lamp is no surface.

import { Box3, Mesh, type BufferGeometry, type Object3D } from 'three';
import { LampMarker } from './lamp_marker';

/** The meshes of an object, without the signs of lamps. */
export function surfacesOf(object: Object3D): Mesh<BufferGeometry>[] {
  const surfaces: Mesh<BufferGeometry>[] = [];
  object.traverse((child) => {
    if (child instanceof Mesh && !(child.parent instanceof LampMarker)) surfaces.push(child as Mesh<BufferGeometry>);
  });
  return surfaces;
}

export function trianglesOf({ index, attributes }: BufferGeometry): number {
  return Math.floor((index?.count ?? attributes['position']!.count) / 3);
}

/** In metres of the scene; empty if the object has no surface. */
export function surfaceBox(object: Object3D): Box3 {
  const box = new Box3();
  object.updateWorldMatrix(true, true);
  for (const { geometry, matrixWorld } of surfacesOf(object)) {
    if (!geometry.boundingBox) geometry.computeBoundingBox();
    box.union(geometry.boundingBox!.clone().applyMatrix4(matrixWorld));
  }
  return box;
}
