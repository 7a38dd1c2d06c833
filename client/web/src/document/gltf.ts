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
    KHR_node_visibility?: { visible?: boolean };
    [name: string]: unknown;
  };
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
  extensions?: { KHR_lights_punctual?: { lights: GltfLight[] }; [name: string]: unknown };
  extras?: Json;
}

/**
 * Whether two documents are of one scene, so that a node's number means the same object in both. At least half of the
 * nodes then have the same names, whatever was edited in between; in two scenes that would be chance.
 */
export function isSameScene(a: Gltf, b: Gltf): boolean {
  const [left, right] = [a.nodes ?? [], b.nodes ?? []];
  const alike = left.filter(({ name }, i) => i < right.length && (name ?? '') === (right[i]!.name ?? '')).length;
  return 2 * alike >= Math.max(left.length, right.length);
}

export function nodeName(gltf: Gltf, index: number): string {
  const node = gltf.nodes?.[index];
  const mesh = node?.mesh !== undefined ? gltf.meshes?.[node.mesh]?.name : undefined;
  return node?.name || mesh || `node ${index}`;
}

export function materialName(gltf: Gltf, index: number): string {
  return gltf.materials?.[index]?.name || `material ${index}`;
}

/** The light of a node, if it has one. */
export function lightOf(gltf: Gltf, node: number): { index: number; light: GltfLight } | undefined {
  const index = gltf.nodes?.[node]?.extensions?.KHR_lights_punctual?.light;
  const light = index === undefined ? undefined : gltf.extensions?.KHR_lights_punctual?.lights[index];
  return index === undefined || !light ? undefined : { index, light };
}

export type Handle = 'translate' | 'rotate' | 'scale';

const ALL_HANDLES: readonly Handle[] = ['translate', 'rotate', 'scale'];
const LIGHT_HANDLES: Record<GltfLight['type'], readonly Handle[]> = {
  point: ['translate'],
  spot: ['translate', 'rotate'],
  directional: ['rotate'],
};

/** The handles that change something about a node: a point light, for example, has no size and no direction. */
export function handlesOf(gltf: Gltf, node: number): readonly Handle[] {
  const { mesh, children } = gltf.nodes?.[node] ?? {};
  const type = lightOf(gltf, node)?.light.type;
  return !type || mesh !== undefined || children?.length ? ALL_HANDLES : (LIGHT_HANDLES[type] ?? ALL_HANDLES);
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
