// Patches that add lamps. Lists grow only at their ends, so the indices of what is added are known.

import type { Json, Patch } from '../protocol/messages';
import { attach, freeName, markUsed } from './edits';
import type { Gltf, Vec3, Vec4 } from './gltf';

/** Metres; a spot's are radians. Area lights shine down, and so do spots and lamps with a photometric file. */
export type NewLamp =
  | { type: 'point'; candela: number }
  | { type: 'spot'; candela: number; innerConeAngle: number; outerConeAngle: number }
  | { type: 'rect' | 'disk'; nits: number; size: number }
  | { type: 'ies'; name: string; file: ProfileFile };

/** A photometric file that was uploaded. */
export interface ProfileFile {
  uri: string;
  bytes: number;
  mimeType: string;
}

/** Longer photometric files are refused by the server. */
export const MOST_PROFILE_BYTES = 16 * 2 ** 20;

export function profileType(fileName: string): string {
  return /\.ldt$/i.test(fileName) ? 'application/x-eulumdat' : 'application/x-ies-lm-63';
}

/** Letters of a file's name that its lamp gets. */
const MOST_NAME = 60;

/** The name of a lamp with that photometric file. JSON cannot carry half of a letter: neither cut nor from a file. */
export function profileName(fileName: string): string {
  const letters = [...fileName.replace(/\.[^.]*$/, '').replace(/\p{Surrogate}/gu, '\ufffd')];
  return letters.slice(0, MOST_NAME).join('');
}

const UPRIGHT: Vec4 = [0, 0, 0, 1];
/** Turns -Z to -Y. */
const DOWN: Vec4 = [-Math.SQRT1_2, 0, 0, Math.SQRT1_2];
const NAMES = { point: 'lamp', spot: 'spot', rect: 'panel', disk: 'disc' } as const;

/** `translation`: in metres, in the shown scene. */
export function addLamp(gltf: Gltf, translation: Vec3, lamp: NewLamp): { patch: Patch; node: number } {
  const node = gltf.nodes?.length ?? 0;
  const name = freeName(gltf, lamp.type === 'ies' ? lamp.name || 'IES lamp' : NAMES[lamp.type]);
  const { extension, light, before } = newLight(gltf, lamp, name);
  const list = (gltf.extensions?.[extension] as { lights?: unknown[] } | undefined)?.lights;
  const patch = [...markUsed(gltf, extension), ...before];
  if (!gltf.extensions) patch.push({ op: 'add', path: '/extensions', value: {} });
  if (list) patch.push({ op: 'add', path: `/extensions/${extension}/lights/-`, value: light });
  else patch.push({ op: 'add', path: `/extensions/${extension}`, value: { lights: [light] } });
  if (!gltf.nodes) patch.push({ op: 'add', path: '/nodes', value: [] });
  patch.push({
    op: 'add',
    path: '/nodes/-',
    value: {
      name,
      translation,
      rotation: lamp.type === 'point' ? UPRIGHT : DOWN,
      scale: [1, 1, 1],
      extensions: { [extension]: { light: list?.length ?? 0 } },
    },
  });
  patch.push(attach(gltf, `/scenes/${gltf.scene ?? 0}/nodes`, node));
  return { patch, node };
}

/** `before`: what the light refers to. */
function newLight(gltf: Gltf, lamp: NewLamp, name: string): { extension: string; light: Json; before: Patch } {
  const white = { name, color: [1, 1, 1] };
  if (lamp.type === 'ies') {
    const { bufferViews } = gltf as { bufferViews?: unknown[] };
    const light = { name, bufferView: bufferViews?.length ?? 0, mimeType: lamp.file.mimeType };
    return { extension: 'EXT_lights_ies', light, before: addFile(gltf, lamp.file) };
  }
  if ('nits' in lamp) {
    const { type, nits: intensity, size } = lamp;
    const light = { ...white, type, intensity, size, ...(type === 'rect' ? { rect: { aspect: 1 } } : {}) };
    return { extension: 'EXT_lights_area', light, before: [] };
  }
  const light = { ...white, type: lamp.type, intensity: lamp.candela };
  if (lamp.type === 'point') return { extension: 'KHR_lights_punctual', light, before: [] };
  const { innerConeAngle, outerConeAngle } = lamp;
  return {
    extension: 'KHR_lights_punctual',
    light: { ...light, spot: { innerConeAngle, outerConeAngle } },
    before: [],
  };
}

/** An uploaded file becomes a buffer, and all of that a buffer view. */
export function addFile(gltf: Gltf, { uri, bytes }: { uri: string; bytes: number }): Patch {
  const { buffers, bufferViews } = gltf as { buffers?: unknown[]; bufferViews?: unknown[] };
  const lists = [...(buffers ? [] : ['buffers']), ...(bufferViews ? [] : ['bufferViews'])];
  return [
    ...lists.map((list) => ({ op: 'add' as const, path: `/${list}`, value: [] })),
    { op: 'add', path: '/buffers/-', value: { uri, byteLength: bytes } },
    { op: 'add', path: '/bufferViews/-', value: { buffer: buffers?.length ?? 0, byteLength: bytes } },
  ];
}
