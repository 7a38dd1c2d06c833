// Emission as two fields show it: a colour of 8 bits a channel, and nits in a few digits. What nobody wrote anew there
// stays as exact as it is in the document. Pure functions.

import type { GltfMaterial, Vec3 } from '../document/gltf';
import { fromHex, toHex } from '../page/colours';
import { parseNumber } from '../page/numbers';

export interface EmissionFields {
  colour: string;
  nits: string;
}

interface Emission {
  factor: Vec3;
  strength: number;
}

function emissionOf(material: GltfMaterial): Emission & { brightest: number } {
  const factor = material.emissiveFactor ?? [0, 0, 0];
  const strength = material.extensions?.KHR_materials_emissive_strength?.emissiveStrength ?? 1;
  return { factor, strength, brightest: Math.max(...factor) };
}

/**
 * The factor's brightest channel belongs to the strength, so that both can be changed by themselves. The luminance of a
 * colour is less than that.
 */
export function emissionFields(material: GltfMaterial): EmissionFields {
  const { factor, strength, brightest } = emissionOf(material);
  return {
    colour: toHex(brightest > 0 ? factor.map((c) => c / brightest) : [1, 1, 1]),
    nits: String(Number((brightest * strength).toPrecision(5))),
  };
}

/** What the fields of `material` mean after somebody wrote into them; undefined: no strength. */
export function emissionWritten(material: GltfMaterial, fields: EmissionFields): Emission | undefined {
  const before = emissionOf(material);
  const shown = emissionFields(material);
  const nits = fields.nits === shown.nits ? before.brightest * before.strength : parseNumber(fields.nits);
  if (!(nits >= 0)) return undefined;
  if (fields.colour === shown.colour && before.brightest > 0)
    return { factor: before.factor, strength: fields.nits === shown.nits ? before.strength : nits / before.brightest };
  // A black factor has no colour of its own: the first strength gives it the one that is shown.
  return nits > 0 || before.brightest > 0 ? { factor: fromHex(fields.colour), strength: nits } : before;
}
