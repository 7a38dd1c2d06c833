// The parts of glTF 2.0 that the viewer reads and edits. The server writes all defaults out.

import type { Json } from '../protocol/messages';

export type Vec3 = [number, number, number];
export type Vec4 = [number, number, number, number];

export interface GltfNode {
  name?: string;
  mesh?: number;
  camera?: number;
  children?: number[];
  translation?: Vec3;
  rotation?: Vec4;
  scale?: Vec3;
  matrix?: number[];
  extensions?: {
    KHR_lights_punctual?: { light: number };
    EXT_lights_area?: { light: number };
    EXT_lights_ies?: { light: number; multiplier?: number; color?: Vec3 };
    KHR_node_visibility?: { visible?: boolean };
    [name: string]: unknown;
  };
  extras?: Json;
}

export interface GltfTextureInfo {
  index: number;
  texCoord?: number;
  extensions?: Record<string, unknown>;
}

/** KHR_materials_pbrSpecularGlossiness. */
export interface SpecularGlossiness {
  diffuseFactor?: Vec4;
  diffuseTexture?: GltfTextureInfo;
  specularFactor?: Vec3;
  specularGlossinessTexture?: GltfTextureInfo;
}

export interface GltfMaterial {
  name?: string;
  emissiveFactor?: Vec3;
  pbrMetallicRoughness?: { baseColorFactor?: Vec4; metallicFactor?: number; [member: string]: unknown };
  doubleSided?: boolean;
  extensions?: {
    KHR_materials_emissive_strength?: { emissiveStrength?: number };
    KHR_materials_pbrSpecularGlossiness?: SpecularGlossiness;
    [name: string]: unknown;
  };
}

export interface GltfLight {
  name?: string;
  type: 'point' | 'spot' | 'directional';
  color?: Vec3;
  intensity?: number;
  range?: number;
  spot?: { innerConeAngle?: number; outerConeAngle?: number };
  /** Metres: of the ball that a point light is, or of a spot's disc. */
  extras?: { radiosityRadius?: number };
}

/** EXT_lights_area: shines one way, along its node's negative Z axis. */
export interface GltfAreaLight {
  name?: string;
  type: 'rect' | 'disk';
  color?: Vec3;
  /** Nits. */
  intensity?: number;
  /** Metres: the diameter of a disc, the height of a rectangle. */
  size?: number;
  rect?: { aspect?: number };
}

export interface Gltf {
  asset: { version: string; generator?: string };
  scene?: number;
  scenes?: { name?: string; nodes?: number[] }[];
  nodes?: GltfNode[];
  meshes?: { name?: string; primitives: { material?: number; [member: string]: unknown }[] }[];
  materials?: GltfMaterial[];
  cameras?: { name?: string; type: string }[];
  extensionsUsed?: string[];
  extensions?: {
    KHR_lights_punctual?: { lights: GltfLight[] };
    EXT_lights_area?: { lights: GltfAreaLight[] };
    EXT_lights_ies?: { lights: { name?: string; bufferView?: number; uri?: string }[] };
    [name: string]: unknown;
  };
  extras?: Json;
}

/** By node: the one above. */
export type Parents = ReadonlyMap<number, number>;

/** Of the document as it is now: patches change it in place. A pass over all nodes. */
export function parentsOf(gltf: Gltf): Parents {
  return new Map((gltf.nodes ?? []).flatMap(({ children }, i) => (children ?? []).map((child) => [child, i])));
}

/**
 * The largest scale of a node in the scene, in any direction along its axes, by which area lights grow. Copes with
 * cycles. Who asks for many nodes hands `parents` in: else each call is a pass over all nodes.
 */
export function largestScale(gltf: Gltf, node: number, parents = parentsOf(gltf)): number {
  let axes: Vec3[] = [
    [1, 0, 0],
    [0, 1, 0],
    [0, 0, 1],
  ];
  const seen = new Set<number>();
  for (let at: number | undefined = node; at !== undefined && !seen.has(at); at = parents.get(at)) {
    seen.add(at);
    const own = gltf.nodes?.[at];
    if (own) axes = axes.map((axis) => placed(own, axis));
  }
  return Math.max(...axes.map((axis) => Math.hypot(...axis)));
}

/** A direction in a node's space, in the space of its parent. */
function placed({ matrix, rotation = [0, 0, 0, 1], scale = [1, 1, 1] }: GltfNode, axis: Vec3): Vec3 {
  const of = (row: number) => axis.reduce((sum, v, column) => sum + v * matrix![4 * column + row]!, 0);
  if (matrix) return [of(0), of(1), of(2)];
  const v = axis.map((component, i) => component * scale[i]!) as Vec3;
  const [x, y, z, w] = rotation;
  const cross = (a: Vec3, b: Vec3): Vec3 => [
    a[1] * b[2] - a[2] * b[1],
    a[2] * b[0] - a[0] * b[2],
    a[0] * b[1] - a[1] * b[0],
  ];
  const twice = cross([x, y, z], v).map((component) => 2 * component) as Vec3;
  const more = cross([x, y, z], twice);
  return v.map((component, i) => component + w * twice[i]! + more[i]!) as Vec3;
}

/**
 * Whether two documents are of one scene, so that a node's number means the same object in both. At least half of the
 * nodes then have the same names, whatever was edited in between, or one of them begins with all that the other has and
 * goes on with what the viewer adds, which has no mesh. Other scenes may begin alike, as programs number their objects.
 */
export function isSameScene(a: Gltf, b: Gltf): boolean {
  const [left, right] = [a.nodes ?? [], b.nodes ?? []];
  const alike = left.filter(({ name }, i) => i < right.length && (name ?? '') === (right[i]!.name ?? '')).length;
  const [fewer, more] = left.length < right.length ? [left, right] : [right, left];
  const isAdded = more.slice(fewer.length).every(({ mesh }) => mesh === undefined);
  const hasGrown = isAdded && alike === fewer.length && fewer.some(({ name }) => name);
  return hasGrown || 2 * alike >= Math.max(left.length, right.length);
}

export function nodeName(gltf: Gltf, index: number): string {
  const node = gltf.nodes?.[index];
  const mesh = node?.mesh !== undefined ? gltf.meshes?.[node.mesh]?.name : undefined;
  return node?.name || mesh || `node ${index}`;
}

export function materialName(gltf: Gltf, index: number): string {
  return gltf.materials?.[index]?.name || `material ${index}`;
}

/** Where a node hangs: the pointer of the list that names the node, and the place in that list. */
export function holderOf(gltf: Gltf, node: number): { list: string; place: number } | undefined {
  for (const [s, scene] of (gltf.scenes ?? []).entries()) {
    const place = scene.nodes?.indexOf(node) ?? -1;
    if (place >= 0) return { list: `/scenes/${s}/nodes`, place };
  }
  for (const [n, parent] of (gltf.nodes ?? []).entries()) {
    const place = parent.children?.indexOf(node) ?? -1;
    if (place >= 0) return { list: `/nodes/${n}/children`, place };
  }
  return undefined;
}

/** Nodes of the shown scene and their depths, depth first. Copes with cycles, and with chains of any length. */
export function hangingNodes(gltf: Gltf): { node: number; depth: number }[] {
  const out: { node: number; depth: number }[] = [];
  const seen = new Set<number>();
  const waiting = [...(gltf.scenes?.[gltf.scene ?? 0]?.nodes ?? [])].reverse().map((node) => ({ node, depth: 0 }));
  for (let next = waiting.pop(); next; next = waiting.pop()) {
    const { node, depth } = next;
    if (seen.has(node)) continue;
    seen.add(node);
    out.push(next);
    for (const child of [...(gltf.nodes?.[node]?.children ?? [])].reverse())
      waiting.push({ node: child, depth: depth + 1 });
  }
  return out;
}
