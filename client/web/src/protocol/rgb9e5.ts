// Shared-exponent colours (GL UNSIGNED_INT_5_9_9_9_REV) and half floats. Pure functions.

const BITS = 9;
const BIAS = 15;
const MAX_MANTISSA = (1 << BITS) - 1;
const MAX_EXPONENT = 31;
/** The largest value a texel can hold. */
export const MAX_RGB9E5 = MAX_MANTISSA * 2 ** (MAX_EXPONENT - BIAS - BITS);

/** EXT_texture_shared_exponent, section 3.8.x. Negative values and NaN become 0; too large ones become the largest. */
export function encodeRgb9e5(r: number, g: number, b: number): number {
  const clamp = (v: number) => (v > 0 ? Math.min(v, MAX_RGB9E5) : 0);
  const [cr, cg, cb] = [clamp(r), clamp(g), clamp(b)];
  const largest = Math.max(cr, cg, cb);
  if (largest === 0) return 0;
  let exponent = Math.max(-BIAS - 1, floorLog2(largest)) + 1 + BIAS;
  let scale = 2 ** (exponent - BIAS - BITS);
  if (Math.floor(largest / scale + 0.5) > MAX_MANTISSA) {
    exponent += 1;
    scale *= 2;
  }
  const mantissa = (v: number) => Math.floor(v / scale + 0.5);
  return (mantissa(cr) | (mantissa(cg) << 9) | (mantissa(cb) << 18) | (exponent << 27)) >>> 0;
}

export function decodeRgb9e5(texel: number): [number, number, number] {
  const scale = 2 ** ((texel >>> 27) - BIAS - BITS);
  return [(texel & 511) * scale, ((texel >>> 9) & 511) * scale, ((texel >>> 18) & 511) * scale];
}

/**
 * The same colour times 2^exponent. It is exact unless the result leaves the range of the five exponent bits: a darker
 * colour loses low bits of its mantissas, a brighter one becomes the largest value.
 */
export function scaleRgb9e5(texel: number, exponent: number): number {
  if ((texel & 0x7ffffff) === 0) return 0;
  const shifted = (texel >>> 27) + exponent;
  if (shifted >= 0 && shifted <= MAX_EXPONENT) return ((texel & 0x7ffffff) | (shifted << 27)) >>> 0;
  const [r, g, b] = decodeRgb9e5(texel);
  const factor = 2 ** exponent;
  return encodeRgb9e5(r * factor, g * factor, b * factor);
}

export function decodeHalf(bits: number): number {
  const sign = bits & 0x8000 ? -1 : 1;
  const exponent = (bits >> 10) & 31;
  const mantissa = bits & 1023;
  if (exponent === 0) return sign * mantissa * 2 ** -24;
  if (exponent === 31) return mantissa ? NaN : sign * Infinity;
  return sign * (1024 + mantissa) * 2 ** (exponent - 25);
}

const floatBits = new DataView(new ArrayBuffer(4));

/** floor(log2 v) of a positive single-precision value, exactly. */
function floorLog2(v: number): number {
  floatBits.setFloat32(0, v);
  return ((floatBits.getUint32(0) >>> 23) & 255) - 127;
}
