// The sky of a document where it is more than two colours: which picture there is to fetch, and edits of it.

import type { Patch } from '../protocol/messages';
import type { Gltf } from './gltf';
import { isObject } from './json_patch';
import { addFile } from './new_lamps';

const EXTENSIONS = ['EXT_lights_image_based', 'KHR_environment_map'] as const;

/** What edits change of a picture or daylight. */
export interface SkyTurn {
  rotation: number;
  strength: number;
}

function ownSky({ extras }: Gltf): unknown {
  return isObject(extras) ? extras['radiositySky'] : undefined;
}

/** What the picture of the sky depends on, as text; undefined: it is no picture, no daylight, and has no sun. */
export function pictureKey(gltf: Gltf): string | undefined {
  const sky = ownSky(gltf);
  if (sky !== undefined) return isObject(sky) && hasPicture(sky) ? JSON.stringify(sky) : undefined;
  const shown = gltf.scenes?.[gltf.scene ?? 0] as { extensions?: unknown } | undefined;
  const used = isObject(shown?.extensions) ? shown.extensions : {};
  const found = EXTENSIONS.find((name) => used[name] !== undefined);
  const root = (gltf as { extensions?: unknown }).extensions;
  return found && JSON.stringify([used[found], isObject(root) ? root[found] : undefined]);
}

function hasPicture(sky: Record<string, unknown>): boolean {
  return ['bufferView', 'uri', 'daylight'].some((member) => sky[member] !== undefined);
}

/** Undefined: the sky has nothing to turn. */
export function skyTurn(gltf: Gltf): SkyTurn | undefined {
  const sky = ownSky(gltf);
  if (!isObject(sky) || !hasPicture(sky)) return undefined;
  const { rotation = 0, strength = 1 } = sky;
  return typeof rotation === 'number' && typeof strength === 'number' ? { rotation, strength } : undefined;
}

export function setSkyTurn(member: keyof SkyTurn, value: number): Patch {
  return [{ op: 'add', path: `/extras/radiositySky/${member}`, value }];
}

/** Another picture, which was uploaded; it is turned, and as strong, as the one before it. */
export function setSkyPicture(gltf: Gltf, uri: string, bytes: number): Patch {
  const { bufferViews } = gltf as { bufferViews?: unknown[] };
  const sky = { ...skyTurn(gltf), bufferView: bufferViews?.length ?? 0 };
  return [
    ...addFile(gltf, { uri, bytes }),
    ...(isObject(gltf.extras) ? [] : [{ op: 'add' as const, path: '/extras', value: {} }]),
    { op: 'add', path: '/extras/radiositySky', value: sky },
  ];
}
