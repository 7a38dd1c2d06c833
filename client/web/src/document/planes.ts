// Measuring planes of a document: /nodes/N/extras/radiosityPlane. Pure functions.

import type { Json, Patch } from '../protocol/messages';
import { attach, freeName } from './edits';
import { hangingNodes, type Gltf, type Vec3 } from './gltf';
import { isObject } from './json_patch';

export interface PlaneTarget {
  lux?: number;
  uniformity?: number;
}

/** Metres. */
export interface PlaneSpec {
  width: number;
  depth: number;
  margin?: number;
  columns?: number;
  rows?: number;
  target?: PlaneTarget;
}

export function planeOf(gltf: Gltf, node: number): PlaneSpec | undefined {
  const extras = gltf.nodes?.[node]?.extras;
  const plane = isObject(extras) ? extras['radiosityPlane'] : undefined;
  if (!isObject(plane) || typeof plane['width'] !== 'number' || typeof plane['depth'] !== 'number') return undefined;
  return plane as unknown as PlaneSpec;
}

/** Nodes of the shown scene that have planes, in the order of the tree. */
export function planeNodes(gltf: Gltf): number[] {
  return hangingNodes(gltf)
    .map(({ node }) => node)
    .filter((node) => planeOf(gltf, node));
}

/** A plane and where it lies, as text: also by the nodes above its own. */
export function planeKey(gltf: Gltf, node: number): string {
  const places: unknown[] = [];
  const met = new Set<number>(); // a document may be wrong
  for (let at = node; at >= 0 && !met.has(at); at = parentOf(gltf, at)) {
    const { translation, rotation, scale, matrix } = (gltf.nodes?.[at] ?? {}) as Placed;
    places.push([translation, rotation, scale, matrix]);
    met.add(at);
  }
  return JSON.stringify([planeOf(gltf, node), places]);
}

interface Placed {
  translation?: unknown;
  rotation?: unknown;
  scale?: unknown;
  matrix?: unknown;
}

/** -1: none. */
function parentOf(gltf: Gltf, node: number): number {
  return gltf.nodes?.findIndex(({ children }) => children?.includes(node)) ?? -1;
}

/** Lists grow only at their ends, so the node's index is known. */
export function addPlane(gltf: Gltf, translation: Vec3, plane: PlaneSpec): { patch: Patch; node: number } {
  const node = gltf.nodes?.length ?? 0;
  const patch: Patch = gltf.nodes ? [] : [{ op: 'add', path: '/nodes', value: [] }];
  const extras = { radiosityPlane: plane as unknown as Json };
  patch.push({
    op: 'add',
    path: '/nodes/-',
    value: {
      name: freeName(gltf, 'measuring plane'),
      translation,
      rotation: [0, 0, 0, 1],
      scale: [1, 1, 1],
      extras,
    },
  });
  patch.push(attach(gltf, `/scenes/${gltf.scene ?? 0}/nodes`, node));
  return { patch, node };
}

export function setPlane(node: number, plane: PlaneSpec): Patch {
  return [{ op: 'replace', path: `/nodes/${node}/extras/radiosityPlane`, value: plane as unknown as Json }];
}

/** Undefined takes the wish away. */
export function withTarget(plane: PlaneSpec, member: keyof PlaneTarget, value: number | undefined): PlaneSpec {
  const { target: before, ...rest } = plane;
  const target = { ...before, [member]: value };
  if (value === undefined) delete target[member];
  return Object.keys(target).length > 0 ? { ...rest, target } : rest;
}
