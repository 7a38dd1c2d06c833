// Emission as two fields: a colour of 8 bits a channel, and a strength in nits of a few digits. A field that nobody
// changed keeps the exact value of the document. Pure functions.

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
 * The fields of a material. The strength contains the factor's brightest channel, so that the user can change colour
 * and strength independently; the luminance is therefore below the strength.
 */
export function emissionFields(material: GltfMaterial): EmissionFields {
  const { factor, strength, brightest } = emissionOf(material);
  return {
    colour: toHex(brightest > 0 ? factor.map((c) => c / brightest) : [1, 1, 1]),
    nits: String(Number((brightest * strength).toPrecision(5))),
  };
}

/** The emission that the user has written into the fields of `material`; undefined: the strength is no valid number. */
export function emissionWritten(material: GltfMaterial, fields: EmissionFields): Emission | undefined {
  const before = emissionOf(material);
  const shown = emissionFields(material);
  const nits = fields.nits === shown.nits ? before.brightest * before.strength : parseNumber(fields.nits);
  if (!(nits >= 0)) return undefined;
  if (fields.colour === shown.colour && before.brightest > 0)
    return { factor: before.factor, strength: fields.nits === shown.nits ? before.strength : nits / before.brightest };
  // A black factor has no colour: with its first strength it takes the colour of the field.
  return nits > 0 || before.brightest > 0 ? { factor: fromHex(fields.colour), strength: nits } : before;
}
