// Finds the surface at a place of a lightmap page.

import { type BufferAttribute, type BufferGeometry, type Intersection, Mesh, Triangle, Vector2, Vector3 } from 'three';
import type { LightmapPage } from '../light/lightmap_page';
import type { LitScene } from '../scene/lit_scene';

interface Box {
  least: Vector2;
  most: Vector2;
}

const boxes = new WeakMap<BufferGeometry, Box>();

/**
 * Undefined: the place is between charts, or of a hidden object. Where charts overlap, the first surface of the scene.
 */
export function surfaceAt(scene: LitScene, page: LightmapPage, at: Vector2): Intersection | undefined {
  let found: Intersection | undefined;
  scene.root.traverseVisible((object) => {
    if (!found && object instanceof Mesh && object.userData['page'] === page) found = placeOn(object, at);
  });
  return found;
}

function placeOn(mesh: Mesh, at: Vector2): Intersection | undefined {
  const geometry = mesh.geometry as BufferGeometry;
  const { least, most } = boxOf(geometry);
  if (at.x < least.x || at.y < least.y || at.x > most.x || at.y > most.y) return undefined;
  const uv = geometry.getAttribute('uv1') as BufferAttribute;
  const [flat, weights] = [new Vector3(at.x, at.y, 0), new Vector3()];
  const corners = [new Vector3(), new Vector3(), new Vector3()] as const;
  for (let first = 0; first + 2 < (geometry.index?.count ?? uv.count); first += 3) {
    corners.forEach((corner, i) => {
      const vertex = vertexOf(geometry, first + i);
      corner.set(uv.getX(vertex), uv.getY(vertex), 0);
    });
    if (!Triangle.getBarycoord(flat, ...corners, weights) || Math.min(...weights.toArray()) < 0) continue;
    const point = new Vector3();
    weights.toArray().forEach((weight, i) => {
      point.addScaledVector(corners[0].fromBufferAttribute(positions(geometry), vertexOf(geometry, first + i)), weight);
    });
    return { distance: 0, point: point.applyMatrix4(mesh.matrixWorld), object: mesh, uv1: at.clone() };
  }
  return undefined;
}

function positions(geometry: BufferGeometry): BufferAttribute {
  return geometry.getAttribute('position') as BufferAttribute;
}

function vertexOf(geometry: BufferGeometry, corner: number): number {
  return geometry.index ? geometry.index.getX(corner) : corner;
}

function boxOf(geometry: BufferGeometry): Box {
  const known = boxes.get(geometry);
  if (known) return known;
  const box: Box = { least: new Vector2(Infinity, Infinity), most: new Vector2(-Infinity, -Infinity) };
  const uv = geometry.getAttribute('uv1') as BufferAttribute;
  for (let i = 0; i < uv.count; ++i) {
    const place = new Vector2(uv.getX(i), uv.getY(i));
    box.least.min(place);
    box.most.max(place);
  }
  boxes.set(geometry, box);
  return box;
}
