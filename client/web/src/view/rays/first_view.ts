// The first view of a scene without a camera. An overview from outside shows only the unlit outer walls of a closed
// room with its lamps inside; there the first view is from inside the room, at the end of its longest line of sight.

import { DoubleSide, Mesh, Triangle, Vector3, type PerspectiveCamera } from 'three';
import { LitMaterial } from '../scene/lit_material';
import type { LitScene } from '../scene/lit_scene';
import { trianglesOf } from '../scene/object_box';
import { RayTree } from './ray_tree';
import { spreadPoint } from './spread';

export interface Place {
  eye: Vector3;
  target: Vector3;
}

/** A point of a lamp, and the direction in which it shines; undefined: all directions. */
interface LampPoint {
  at: Vector3;
  facing: Vector3 | undefined;
  /** The light comes from far away, wherever the lamp is placed. */
  isSun: boolean;
}

/** Stay outside where so large a part of the view is lit, or where no place inside shows so many times more. */
const LEAST_LIT = 0.5;
const LEAST_GAIN = 1.5;
const RAYS = 32;
const MOST_LAMP_POINTS = 4;
/** So many triangles take half a second to search. */
const MOST_TRIANGLES = 200_000;
const DIRECTIONS = 12;
/** Metres above the floor; half of the height in smaller models, and under a low ceiling. */
const EYE_HEIGHT = 1.6;
/** Part of the way to the wall behind the viewer. */
const BACK = 0.85;
/** Of the scene's size: hits nearer than this are the surface that the ray starts from. */
const NEAR = 1e-6;

/** A view from inside; undefined: the overview `outside` is good enough. `hasSky`: light comes from outside. */
export function insideView(scene: LitScene, outside: PerspectiveCamera, hasSky = false): Place | undefined {
  if (hasSky || scene.triangles > MOST_TRIANGLES) return undefined;
  scene.root.updateMatrixWorld(true);
  const lamps = lampPoints(scene);
  if (lamps.length === 0) return undefined;
  outside.updateMatrixWorld();
  const room = new Room(scene);
  const fromOutside = room.litShare(lamps, outside);
  if (fromOutside >= LEAST_LIT) return undefined;
  const inside = outside.clone();
  let [most, best]: [number, Place | undefined] = [LEAST_GAIN * fromOutside, undefined];
  for (const lamp of lamps) {
    const place = lamp.isSun ? undefined : room.longestView(lamp);
    if (!place) continue;
    inside.position.copy(place.eye);
    inside.lookAt(place.target);
    inside.updateMatrixWorld();
    const lit = room.litShare(lamps, inside);
    if (lit > most) [most, best] = [lit, place];
  }
  return best;
}

/** Some points, evenly spread over the lamps and the triangles of emitting surfaces. */
function lampPoints(scene: LitScene): LampPoint[] {
  const all: LampPoint[] = [...scene.lamps.values()].map((lamp) => ({
    at: lamp.getWorldPosition(new Vector3()),
    facing: lamp.isSun ? lamp.getWorldDirection(new Vector3()).negate() : undefined,
    isSun: lamp.isSun,
  }));
  scene.root.traverseVisible((object) => {
    if (object instanceof Mesh && shines(object)) all.push(...someTriangles(object));
  });
  const step = Math.max(1, all.length / MOST_LAMP_POINTS);
  return Array.from({ length: Math.min(all.length, MOST_LAMP_POINTS) }, (_, i) => all[Math.floor((i + 0.5) * step)]!);
}

function shines(mesh: Mesh): boolean {
  const { material } = mesh;
  return material instanceof LitMaterial && material.emissiveIntensity * Math.max(...material.emissive.toArray()) > 0;
}

function someTriangles(mesh: Mesh): LampPoint[] {
  const { index, attributes } = mesh.geometry;
  const position = attributes['position']!;
  const count = trianglesOf(mesh.geometry);
  const triangle = new Triangle();
  return Array.from({ length: Math.min(count, MOST_LAMP_POINTS) }, (_, i, of = Math.min(count, MOST_LAMP_POINTS)) => {
    const first = 3 * Math.floor(((i + 0.5) * count) / of);
    [triangle.a, triangle.b, triangle.c].forEach((corner, k) =>
      corner.fromBufferAttribute(position, index?.getX(first + k) ?? first + k).applyMatrix4(mesh.matrixWorld),
    );
    const isTwoSided = (mesh.material as LitMaterial).side === DoubleSide;
    return {
      at: triangle.getMidpoint(new Vector3()),
      facing: isTwoSided ? undefined : triangle.getNormal(new Vector3()),
      isSun: false,
    };
  });
}

/** Finds what a view sees, and where surfaces stand in the way of light. */
class Room {
  private readonly tree: RayTree;
  private readonly size: number;

  constructor(scene: LitScene) {
    this.tree = new RayTree(scene);
    this.size = scene.bounds.getSize(new Vector3()).length();
  }

  /** The part of a view that a lamp shines on, or that is a lamp. */
  litShare(lamps: readonly LampPoint[], camera: PerspectiveCamera): number {
    let [seen, lit] = [0, 0];
    for (let i = 1; i <= RAYS; ++i) {
      const ahead = new Vector3(...spreadPoint(i), 0.5).unproject(camera).sub(camera.position).normalize();
      const hit = this.tree.cast(camera.position, ahead, 'drawn', NEAR * this.size);
      if (!hit) continue;
      ++seen;
      const point = camera.position.clone().addScaledVector(ahead, hit.distance);
      if (shines(hit.mesh) || lamps.some((lamp) => this.isLit(point, hit.normal, lamp))) ++lit;
    }
    return seen === 0 ? 0 : lit / seen;
  }

  /** The longest line of sight at eye height below a lamp. Undefined: there is no floor. */
  longestView({ at, facing }: LampPoint): Place | undefined {
    const start = at.clone().addScaledVector(facing ?? DOWN, 2 * NEAR * this.size);
    const height = this.reach(start, DOWN, this.size);
    if (height >= this.size) return undefined;
    const middle = start.addScaledVector(DOWN, height - Math.min(EYE_HEIGHT, height / 2));
    let best: Place | undefined;
    for (let i = 0; i < DIRECTIONS; ++i) {
      const angle = (2 * Math.PI * (i + 0.5)) / DIRECTIONS;
      const ahead = new Vector3(Math.sin(angle), 0, Math.cos(angle));
      const back = this.reach(middle, ahead.clone().negate(), this.size);
      if (back >= this.size) continue; // there is no wall behind
      const eye = middle.clone().addScaledVector(ahead, -BACK * back);
      const target = middle.clone().addScaledVector(ahead, this.reach(middle, ahead, this.size) / 2);
      if (!best || eye.distanceTo(target) > best.eye.distanceTo(best.target)) best = { eye, target };
    }
    return best;
  }

  private isLit(point: Vector3, normal: Vector3, { at, facing, isSun }: LampPoint): boolean {
    const way = isSun ? facing!.clone().multiplyScalar(-2 * this.size) : at.clone().sub(point);
    if (way.dot(normal) <= 0 || (facing && way.dot(facing) >= 0)) return false;
    const distance = way.length();
    return this.reach(point, way.divideScalar(distance), distance) > distance * 0.99;
  }

  /** Distance to the next surface in metres, at most `most`. Transparent surfaces do not count. */
  private reach(from: Vector3, direction: Vector3, most: number): number {
    return this.tree.cast(from, direction, 'solid', NEAR * this.size, most)?.distance ?? most;
  }
}

const DOWN = new Vector3(0, -1, 0);
