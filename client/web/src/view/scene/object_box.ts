// The surfaces of an object, and the box around them. The signs of lamps and planes are no surfaces.

import { Box3, Mesh, type BufferGeometry, type Object3D } from 'three';
import { LampMarker } from './lamp_marker';
import { PlaneMarker } from './plane_marker';

/** The meshes of an object, without the signs of lamps and planes. */
export function surfacesOf(object: Object3D): Mesh<BufferGeometry>[] {
  const surfaces: Mesh<BufferGeometry>[] = [];
  object.traverse((child) => {
    if (child instanceof Mesh && !isSign(child)) surfaces.push(child as Mesh<BufferGeometry>);
  });
  return surfaces;
}

export function isSign({ parent }: Object3D): boolean {
  return parent instanceof LampMarker || parent?.parent instanceof PlaneMarker;
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
