// The patches that the viewer makes. Pure functions of the document.

import type { Json, Patch } from '../protocol/messages';
import { holderOf, nodeName, type Gltf, type Vec3, type Vec4 } from './gltf';
import { isObject, valueAt } from './json_patch';

export function setColour(material: number, gltf: Gltf, rgb: Vec3): Patch {
  const alpha = gltf.materials?.[material]?.pbrMetallicRoughness?.baseColorFactor?.[3] ?? 1;
  const value: Vec4 = [...rgb, alpha];
  return [{ op: 'replace', path: `/materials/${material}/pbrMetallicRoughness/baseColorFactor`, value }];
}

export function setEmission(material: number, rgb: Vec3, strength: number): Patch {
  return [
    { op: 'replace', path: `/materials/${material}/emissiveFactor`, value: rgb },
    {
      op: 'replace',
      path: `/materials/${material}/extensions/KHR_materials_emissive_strength/emissiveStrength`,
      value: strength,
    },
  ];
}

export interface Placement {
  translation?: Vec3;
  rotation?: Vec4;
  scale?: Vec3;
}

export function setPlacement(node: number, placement: Placement): Patch {
  return replaceMembers(`/nodes/${node}`, placement);
}

/** `path`: of a NodeLight. Objects on the way that are missing (`extras`, `rect`) come with it. */
export function setLight(gltf: Gltf, path: string, value: Json): Patch {
  const document = gltf as unknown as Json;
  if (valueAt(document, path) !== undefined) return [{ op: 'replace', path, value }];
  const end = path.lastIndexOf('/');
  if (valueAt(document, path.slice(0, end)) !== undefined) return [{ op: 'add', path, value }];
  return setLight(gltf, path.slice(0, end), { [path.slice(end + 1)]: value });
}

function replaceMembers(path: string, members: object): Patch {
  return Object.entries(members).map(([member, value]) => ({
    op: 'replace',
    path: `${path}/${member}`,
    value: value as Json,
  }));
}

/** Uses `add`, which also replaces, as the members may be missing. */
export function setVisible(gltf: Gltf, node: number, visible: boolean): Patch {
  const patch = markUsed(gltf, 'KHR_node_visibility');
  const path = `/nodes/${node}/extensions`;
  if (!gltf.nodes?.[node]?.extensions) patch.push({ op: 'add', path, value: {} });
  return [...patch, { op: 'add', path: `${path}/KHR_node_visibility`, value: { visible } }];
}

export function isVisible(gltf: Gltf, node: number): boolean {
  return gltf.nodes?.[node]?.extensions?.KHR_node_visibility?.visible ?? true;
}

export function markUsed(gltf: Gltf, extension: string): Patch {
  if (!gltf.extensionsUsed) return [{ op: 'add', path: '/extensionsUsed', value: [extension] }];
  if (gltf.extensionsUsed.includes(extension)) return [];
  return [{ op: 'add', path: '/extensionsUsed/-', value: extension }];
}

export function attach(gltf: Gltf, list: string, node: number): Patch[number] {
  const there = valueAt(gltf as unknown as Json, list) !== undefined;
  return there ? { op: 'add', path: `${list}/-`, value: node } : { op: 'add', path: list, value: [node] };
}

/**
 * Takes a node out of the scene. The node stays in the document, as lists do not shrink. Undefined: it hangs nowhere.
 */
export function detachNode(gltf: Gltf, node: number): Patch | undefined {
  const holder = holderOf(gltf, node);
  if (!holder) return undefined;
  const path = `${holder.list}/${holder.place}`;
  return [
    { op: 'test', path, value: node },
    { op: 'remove', path },
  ];
}

export function freeName(gltf: Gltf, wanted: string): string {
  const taken = new Set((gltf.nodes ?? []).map((node) => node.name));
  for (let i = 1; ; ++i) {
    const name = i === 1 ? wanted : `${wanted} ${i}`;
    if (!taken.has(name)) return name;
  }
}

const GROWING = /^\/(nodes|meshes|materials|cameras|extensions\/(KHR_lights_punctual|EXT_lights_\w+)\/lights)\/-$/;
const LIGHTS = /^\/extensions\/(KHR_lights_punctual|EXT_lights_\w+)\/lights\//;
const HANGING = /^\/(scenes\/\d+\/nodes|nodes\/\d+\/children)(\/|$)/;

function grows(patch: Patch): boolean {
  return patch.some((operation) => GROWING.test(operation.path));
}

/**
 * The patch that undoes `patch` on the server. `inverse` would undo it in the viewer's copy; but the server's lists do
 * not shrink, so an object that was appended stays in its list and is only taken out of the scene.
 */
export function undoOnServer(patch: Patch, inverse: Patch): Patch {
  if (!grows(patch)) return inverse;
  const hung = patch.find((operation) => HANGING.test(operation.path) && operation.path.endsWith('/-'));
  return inverse
    .filter((operation) => HANGING.test(operation.path))
    .flatMap((operation) =>
      operation.op === 'remove' && hung?.value !== undefined && /\d$/.test(operation.path)
        ? [{ op: 'test' as const, path: operation.path, value: hung.value }, operation]
        : [operation],
    );
}

/** An object that undoing took out of the scene is still in the document, and only has to return to the scene. */
export function redoOnServer(patch: Patch): Patch {
  return grows(patch) ? patch.filter((operation) => HANGING.test(operation.path)) : patch;
}

/** Tells people what a patch has done: "added lamp 2", "changed wall: colour". `gltf`: the document after the patch. */
export function describePatch(gltf: Gltf, patch: Patch): string {
  const told = { added: new Set<string>(), removed: new Set<string>(), changed: new Set<string>() };
  const isNew = patch.some(({ path }) => path === '/nodes/-');
  for (const operation of patch) {
    const { op, path } = operation;
    if (path === '/nodes/-') told.added.add(nameIn(operation.value) ?? 'an object');
    else if (op === 'test' && HANGING.test(path)) told.removed.add(nodeNamed(gltf, operation.value));
    else if (op === 'add' && HANGING.test(path) && !isNew) told.added.add(nodeNamed(gltf, operation.value));
    else if (op === 'remove' && /^\/nodes\/\d+$/.test(path)) told.removed.add('an object');
    else if (op !== 'test' && !(isNew && (HANGING.test(path) || GROWING.test(path)))) {
      const part = changedPart(gltf, path);
      if (part) told.changed.add(part);
    }
  }
  // The lists of objects change with the objects that come or go, which are named already.
  if (told.added.size + told.removed.size > 0) told.changed.delete(OBJECTS);
  const phrases = Object.entries(told).flatMap(([verb, parts]) =>
    parts.size > 0 ? [`${verb} ${[...parts].slice(0, 3).join(', ')}${parts.size > 3 ? ' and more' : ''}`] : [],
  );
  return phrases.join(', ') || 'changed the scene';
}

const OBJECTS = 'objects of the scene';

function changedPart(gltf: Gltf, path: string): string | undefined {
  const [, list, key, ...rest] = path.split('/');
  const index = Number(key?.startsWith('@') ? NaN : key);
  const named = key?.startsWith('@') ? key.slice(1) : undefined;
  const member = (rest.at(-1) ?? '').replace('KHR_node_visibility', 'visibility');
  if (HANGING.test(path)) return OBJECTS;
  if (list === 'materials' && rest.length > 0)
    return `${named ?? gltf.materials?.[index]?.name ?? `material ${key}`}: ${readable(member)}`;
  if (list === 'nodes' && rest.length > 0)
    return `${named ?? (gltf.nodes?.[index] ? nodeName(gltf, index) : `node ${key}`)}: ${readable(member)}`;
  if (LIGHTS.test(path)) return `light: ${readable(member)}`;
  return path.startsWith('/extras/radiositySky') ? 'sky' : undefined;
}

function nameIn(value: Json | undefined): string | undefined {
  const name = isObject(value) ? value['name'] : undefined;
  return typeof name === 'string' && name !== '' ? name : undefined;
}

function nodeNamed(gltf: Gltf, value: Json | undefined): string {
  return typeof value === 'number' && gltf.nodes?.[value] ? nodeName(gltf, value) : 'an object';
}

function readable(member: string): string {
  const words: Record<string, string> = {
    baseColorFactor: 'colour',
    emissiveFactor: 'emission',
    emissiveStrength: 'emission',
    translation: 'position',
    radiosityRadius: 'radius',
    innerConeAngle: 'cone',
    outerConeAngle: 'cone',
    '-': 'new light',
  };
  return words[member] ?? member;
}
