// Where to look from at first in a scene without a camera of its own. From outside one sees all of it, but of a closed room
// with its lamps inside nothing except unlit walls: there one stands in the room, where its longest line of sight ends.

import { DoubleSide, Mesh, Triangle, Vector3, type PerspectiveCamera } from 'three';
import { LitMaterial } from '../scene/lit_material';
import type { LitScene } from '../scene/lit_scene';
import { RayTree } from './ray_tree';

export interface Place {
  eye: Vector3;
  target: Vector3;
}

/** A point of a lamp, and where it shines; without a direction: everywhere. */
interface LampPoint {
  at: Vector3;
  facing: Vector3 | undefined;
  /** Its light comes from far away, wherever it hangs. */
  isSun: boolean;
}

/** From outside as much of what is seen has a lamp in sight, or no place inside shows much more: one stays there. */
const LEAST_LIT = 0.5;
const LEAST_GAIN = 1.5;
const RAYS = 32;
const MOST_LAMP_POINTS = 4;
/** To find out where so many are takes half a second. */
const MOST_TRIANGLES = 200_000;
const DIRECTIONS = 12;
/** Metres, of who stands; in a model of another size, and under a low ceiling, the middle of the height. */
const EYE_HEIGHT = 1.6;
/** Of the way to the wall at one's back. */
const BACK = 0.85;
/** Of the scene's size: what is as near as that to where a ray begins is where it begins. */
const NEAR = 1e-6;

/** `outside`: looks at the whole scene. Undefined: its picture is good enough. `hasSky`: light comes from outside. */
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

/** Some points, evenly among all lamps and among the triangles of surfaces that shine. */
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
  const count = Math.floor((index?.count ?? position.count) / 3);
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

/** What is seen, and what stands in the way of light, from both of its sides. */
class Room {
  private readonly tree: RayTree;
  private readonly size: number;

  constructor(scene: LitScene) {
    this.tree = new RayTree(scene);
    this.size = scene.bounds.getSize(new Vector3()).length();
  }

  /** Of what a camera sees: how much has a lamp in sight, or is one. */
  litShare(lamps: readonly LampPoint[], camera: PerspectiveCamera): number {
    let [seen, lit] = [0, 0];
    for (let i = 1; i <= RAYS; ++i) {
      // Evenly spread for every number of rays (the R2 sequence of Martin Roberts, 2018).
      const [x, y] = [2 * ((i * 0.7548776662466927) % 1) - 1, 2 * ((i * 0.5698402909980532) % 1) - 1];
      const ahead = new Vector3(x, y, 0.5).unproject(camera).sub(camera.position).normalize();
      const hit = this.tree.cast(camera.position, ahead, 'drawn', NEAR * this.size);
      if (!hit) continue;
      ++seen;
      const point = camera.position.clone().addScaledVector(ahead, hit.distance);
      if (shines(hit.mesh) || lamps.some((lamp) => this.isLit(point, hit.normal, lamp))) ++lit;
    }
    return seen === 0 ? 0 : lit / seen;
  }

  /** Below a lamp, where one stands: from one end of what is seen there to the other. Undefined: there is no floor. */
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
      if (back >= this.size) continue; // there is no wall to stand at
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

  /** How far one gets, metres, `most` at most. What can be seen through stops nothing. */
  private reach(from: Vector3, direction: Vector3, most: number): number {
    return this.tree.cast(from, direction, 'solid', NEAR * this.size, most)?.distance ?? most;
  }
}

const DOWN = new Vector3(0, -1, 0);
