// A tree of bounding boxes over the shown surfaces, in which a ray finds its hit in time that hardly grows with the
// number of triangles. A snapshot, in world space.

import { DoubleSide, Mesh, Vector3 } from 'three';
import { LitMaterial } from '../scene/lit_material';
import type { LitScene } from '../scene/lit_scene';
import { trianglesOf } from '../scene/object_box';

export interface RayHit {
  distance: number;
  mesh: Mesh<Mesh['geometry'], LitMaterial>;
  /** Of unit length, towards the origin of the ray. */
  normal: Vector3;
  /** Index of the triangle in the tree. */
  triangle: number;
}

/**
 * The faces that stop rays. `drawn`: those that a camera sees. `solid`: those that light does not pass, from any side.
 */
export type Stops = 'drawn' | 'solid';

const LEAF_TRIANGLES = 4;
const NODE_NUMBERS = 6;
const MOST_DEPTH = 64;

type LitMesh = RayHit['mesh'];

export class RayTree {
  /** Corners of the triangles, nine numbers each. */
  private readonly corners: Float64Array;
  /** Middles of the triangles. */
  private readonly middles: Float64Array;
  private readonly meshes: LitMesh[] = [];
  private readonly meshOf: Uint32Array;
  /** Triangles in the order of the leaves. */
  private readonly order: Uint32Array;
  /** Lowest and highest corner of each node. */
  private readonly boxes: number[] = [];
  /** A leaf's first triangle in `order`, or an inner node's left child, which the right one follows. */
  private readonly first: number[] = [];
  /** Number of a leaf's triangles; 0: an inner node. */
  private readonly count: number[] = [];

  constructor(scene: LitScene) {
    scene.root.updateMatrixWorld(true);
    scene.root.traverseVisible((object) => {
      if (object instanceof Mesh && object.material instanceof LitMaterial) this.meshes.push(object as LitMesh);
    });
    const triangles = this.meshes.reduce((sum, mesh) => sum + trianglesOf(mesh.geometry), 0);
    this.corners = new Float64Array(9 * triangles);
    this.meshOf = new Uint32Array(triangles);
    let at = 0;
    this.meshes.forEach((mesh, index) => {
      this.take(mesh, at);
      this.meshOf.fill(index, at, (at += trianglesOf(mesh.geometry)));
    });
    this.middles = Float64Array.from({ length: 3 * triangles }, (_, i) => {
      const corner = 9 * Math.floor(i / 3) + (i % 3);
      return (this.corners[corner]! + this.corners[corner + 3]! + this.corners[corner + 6]!) / 3;
    });
    this.order = Uint32Array.from({ length: triangles }, (_, i) => i);
    this.build();
  }

  /** The nearest hit between `least` and `most`. Distances are multiples of the length of `direction`. */
  cast(from: Vector3, direction: Vector3, stops: Stops, least: number, most = Infinity): RayHit | undefined {
    const [o, d] = [from.toArray(), direction.toArray()];
    const inverse = d.map((v) => 1 / v);
    let [best, nearest, faces] = [-1, most, 0];
    const waiting = this.order.length > 0 ? [0] : [];
    for (let node = waiting.pop(); node !== undefined; node = waiting.pop()) {
      if (!this.crosses(node, o, inverse, nearest)) continue;
      const [first, count] = [this.first[node]!, this.count[node]!];
      if (count === 0) waiting.push(first, first + 1);
      for (let i = first; i < first + count; ++i) {
        const triangle = this.order[i]!;
        const [distance, facing] = meet(this.corners, 9 * triangle, o, d);
        if (!(distance > least && distance <= nearest) || !this.stops(triangle, facing, stops)) continue;
        [best, nearest, faces] = [triangle, distance, facing];
      }
    }
    if (best < 0) return undefined;
    const normal = this.normalOf(best).multiplyScalar(Math.sign(faces));
    return { distance: nearest, mesh: this.meshes[this.meshOf[best]!]!, normal, triangle: best };
  }

  private stops(triangle: number, facing: number, what: Stops): boolean {
    const { material } = this.meshes[this.meshOf[triangle]!]!;
    return what === 'solid' ? !material.transparent : facing > 0 || material.side === DoubleSide;
  }

  private normalOf(triangle: number): Vector3 {
    const [a, b, c] = [0, 3, 6].map((i) => new Vector3().fromArray(this.corners, 9 * triangle + i));
    return b!.sub(a!).cross(c!.sub(a!)).normalize();
  }

  /** Stores a mesh's corners from triangle `at` on, counter-clockwise as seen from the front. */
  private take(mesh: LitMesh, at: number): void {
    const { index, attributes } = mesh.geometry;
    const position = attributes['position']!;
    const mirrored = mesh.matrixWorld.determinant() < 0;
    const corner = new Vector3();
    for (let i = 0; i < 3 * trianglesOf(mesh.geometry); ++i) {
      const of = mirrored ? i - (i % 3) + [0, 2, 1][i % 3]! : i;
      corner.fromBufferAttribute(position, index ? index.getX(of) : of).applyMatrix4(mesh.matrixWorld);
      corner.toArray(this.corners, 9 * at + 3 * i);
    }
  }

  private build(): void {
    const waiting: [node: number, first: number, count: number, depth: number][] = [];
    if (this.order.length > 0) waiting.push([this.addNode(), 0, this.order.length, 0]);
    for (let next = waiting.pop(); next; next = waiting.pop()) {
      const [node, first, count, depth] = next;
      const around = this.bound(node, first, count);
      const left = count > LEAF_TRIANGLES && depth < MOST_DEPTH ? this.divide(first, count, around) : 0;
      this.first[node] = first;
      this.count[node] = count;
      if (left === 0) continue;
      const child = this.addNode();
      this.addNode();
      [this.first[node], this.count[node]] = [child, 0];
      waiting.push([child, first, left, depth + 1], [child + 1, first + left, count - left, depth + 1]);
    }
  }

  private addNode(): number {
    this.first.push(0);
    this.count.push(0);
    this.boxes.push(0, 0, 0, 0, 0, 0);
    return this.first.length - 1;
  }

  /** Sets a node's box. Returns the box of its triangles' middles, as lowest and highest corner. */
  private bound(node: number, first: number, count: number): number[] {
    const { boxes, corners, middles, order } = this;
    const around = [Infinity, Infinity, Infinity, -Infinity, -Infinity, -Infinity];
    for (let axis = 0; axis < 3; ++axis) {
      let [low, high, lowest, highest] = [Infinity, -Infinity, Infinity, -Infinity];
      for (let i = first; i < first + count; ++i) {
        const at = 9 * order[i]! + axis;
        const [a, b, c, middle] = [corners[at]!, corners[at + 3]!, corners[at + 6]!, middles[3 * order[i]! + axis]!];
        low = Math.min(low, a, b, c);
        high = Math.max(high, a, b, c);
        lowest = Math.min(lowest, middle);
        highest = Math.max(highest, middle);
      }
      [boxes[NODE_NUMBERS * node + axis], boxes[NODE_NUMBERS * node + axis + 3]] = [low, high];
      [around[axis], around[axis + 3]] = [lowest, highest];
    }
    return around;
  }

  /**
   * Halves the longest side, and puts the triangles of the lower half first. Returns their number; 0: no side is long.
   */
  private divide(first: number, count: number, around: readonly number[]): number {
    const sizes = [0, 1, 2].map((axis) => around[axis + 3]! - around[axis]!);
    const axis = sizes.indexOf(Math.max(...sizes));
    if (!(sizes[axis]! > 0)) return 0;
    const at = (around[axis]! + around[axis + 3]!) / 2;
    const { middles, order } = this;
    let next = first;
    for (let i = first; i < first + count; ++i) {
      const triangle = order[i]!;
      if (middles[3 * triangle + axis]! > at) continue;
      order[i] = order[next]!;
      order[next++] = triangle;
    }
    return next - first === count ? 0 : next - first;
  }

  private crosses(node: number, o: readonly number[], inverse: readonly number[], most: number): boolean {
    let [near, far] = [0, most];
    for (let axis = 0; axis < 3; ++axis) {
      const a = (this.boxes[NODE_NUMBERS * node + axis]! - o[axis]!) * inverse[axis]!;
      const b = (this.boxes[NODE_NUMBERS * node + 3 + axis]! - o[axis]!) * inverse[axis]!;
      if (a !== a || b !== b) continue; // the ray runs within a side of the box
      near = Math.max(near, Math.min(a, b));
      far = Math.min(far, Math.max(a, b));
    }
    return near <= far * (1 + 1e-12);
  }
}

/** Möller and Trumbore, 1997. Distance to the triangle, or NaN; and a number above 0 where the ray meets its front. */
function meet(p: Float64Array, at: number, o: readonly number[], d: readonly number[]): [number, number] {
  const [ax, ay, az] = [p[at]!, p[at + 1]!, p[at + 2]!];
  const [e1x, e1y, e1z] = [p[at + 3]! - ax, p[at + 4]! - ay, p[at + 5]! - az];
  const [e2x, e2y, e2z] = [p[at + 6]! - ax, p[at + 7]! - ay, p[at + 8]! - az];
  const [dx, dy, dz] = [d[0]!, d[1]!, d[2]!];
  const [hx, hy, hz] = [dy * e2z - dz * e2y, dz * e2x - dx * e2z, dx * e2y - dy * e2x];
  const facing = e1x * hx + e1y * hy + e1z * hz;
  const [sx, sy, sz] = [o[0]! - ax, o[1]! - ay, o[2]! - az];
  const u = (sx * hx + sy * hy + sz * hz) / facing;
  const [qx, qy, qz] = [sy * e1z - sz * e1y, sz * e1x - sx * e1z, sx * e1y - sy * e1x];
  const v = (dx * qx + dy * qy + dz * qz) / facing;
  if (!(u >= 0 && v >= 0 && u + v <= 1)) return [NaN, 0];
  return [(e2x * qx + e2y * qy + e2z * qz) / facing, facing];
}
