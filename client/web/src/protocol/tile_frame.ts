// Binary frames of the protocol ("Tiles" in protocol/README.md): header, checks, pixels. Used in the decoding worker
// and in tests. An unsound frame is refused with a reason, and nothing of it is used.

import { crc32c } from './crc32c';
import { decodeHalf, encodeRgb9e5, MAX_RGB9E5, scaleRgb9e5 } from './rgb9e5';

export const HEADER_BYTES = 64;
export const TILE_SIDE = 64;
const MAGIC = 0x54444152; // "RADT", little-endian
const MAX_MIP = 16;

export const KINDS = ['irradiance', 'radiosity', 'error', 'patchId', 'mipLevel', 'unshot', 'normal'] as const;
export const FORMATS = ['rgba16f', 'rgb9e5', 'rgba32f', 'r32ui'] as const;
export type PixelFormat = (typeof FORMATS)[number];
const BYTES_PER_TEXEL: Record<PixelFormat, number> = { rgba16f: 8, rgb9e5: 4, rgba32f: 16, r32ui: 4 };

export interface TileHeader {
  /** A name of KINDS, or "kind N" for a kind that this viewer does not know. */
  kind: string;
  format: PixelFormat;
  deflated: boolean;
  page: number;
  mip: number;
  final: boolean;
  reset: boolean;
  x: number;
  y: number;
  width: number;
  height: number;
  scaleExponent: number;
  revision: number;
  tileVersion: number;
  shots: number;
  error: number;
  payloadBytes: number;
  crc: number;
}

/** A tile as textures take it: one RGB9E5 word a texel, value = word x 2^exponent, rows in the page's order. */
export interface Tile {
  header: TileHeader;
  texels: Uint32Array;
  exponent: number;
}

export class BadTile extends Error {}

/** Throws BadTile. */
export function readTileHeader(frame: ArrayBuffer): TileHeader {
  if (frame.byteLength < HEADER_BYTES) throw new BadTile(`a frame of ${frame.byteLength} bytes has no whole header`);
  const view = new DataView(frame);
  const u8 = (at: number) => view.getUint8(at);
  const u16 = (at: number) => view.getUint16(at, true);
  const u32 = (at: number) => view.getUint32(at, true);
  if (u32(0) !== MAGIC) throw new BadTile('does not begin with RADT');
  if (u8(4) !== 1) throw new BadTile(`header version ${u8(4)} is not known`);
  const format = FORMATS[u8(6)];
  if (!format) throw new BadTile(`pixel format ${u8(6)} is not known`);
  if (u8(7) > 1) throw new BadTile(`codec ${u8(7)} is not known`);
  const flags = u16(14);
  const header: TileHeader = {
    kind: KINDS[u8(5)] ?? `kind ${u8(5)}`,
    format,
    deflated: u8(7) === 1,
    page: u32(8),
    mip: u16(12),
    final: (flags & 1) !== 0,
    reset: (flags & 2) !== 0,
    x: u32(16),
    y: u32(20),
    width: u16(24),
    height: u16(26),
    scaleExponent: view.getInt32(28, true),
    revision: Number(view.getBigUint64(32, true)),
    tileVersion: Number(view.getBigUint64(40, true)),
    shots: u32(48),
    error: view.getFloat32(52, true),
    payloadBytes: u32(56),
    crc: u32(60),
  };
  checkHeader(header, frame.byteLength);
  return header;
}

export function rawBytes(header: TileHeader): number {
  return header.width * header.height * BYTES_PER_TEXEL[header.format];
}

function checkHeader(h: TileHeader, frameBytes: number): void {
  if (h.mip > MAX_MIP) throw new BadTile(`mip ${h.mip} is above ${MAX_MIP}`);
  if (h.width < 1 || h.width > TILE_SIDE || h.height < 1 || h.height > TILE_SIDE)
    throw new BadTile(`${h.width} x ${h.height} texels; 1 to ${TILE_SIDE} are allowed`);
  if (h.x % TILE_SIDE !== 0 || h.y % TILE_SIDE !== 0) throw new BadTile(`(${h.x}, ${h.y}) is no corner of a tile`);
  if (h.payloadBytes !== frameBytes - HEADER_BYTES) throw new BadTile('payload bytes do not match the frame');
  if (h.payloadBytes > rawBytes(h)) throw new BadTile('the payload is larger than its pixels');
  if (!h.deflated && h.payloadBytes !== rawBytes(h)) throw new BadTile('the payload is not its pixels');
  if (Math.abs(h.scaleExponent) > 1024) throw new BadTile(`scale exponent ${h.scaleExponent}`);
}

/** Inflates a zlib stream (RFC 1950) to exactly `limit` bytes, and reads no further. */
async function inflate(data: Uint8Array<ArrayBuffer>, limit: number): Promise<Uint8Array> {
  const out = new Uint8Array(limit);
  let filled = 0;
  const reader = new Blob([data]).stream().pipeThrough(new DecompressionStream('deflate')).getReader();
  try {
    for (;;) {
      const { done, value } = await reader.read();
      if (done) break;
      if (filled + value.length > limit) throw new BadTile('inflates to more than its pixels');
      out.set(value, filled);
      filled += value.length;
    }
  } catch (error) {
    reader.cancel().catch(() => undefined);
    throw error instanceof BadTile ? error : new BadTile('is not a zlib stream');
  }
  if (filled !== limit) throw new BadTile('inflates to less than its pixels');
  return out;
}

/** Checks and decodes a whole frame. Rejects with BadTile. */
export async function decodeTile(frame: ArrayBuffer): Promise<Tile> {
  const header = readTileHeader(frame);
  const payload = new Uint8Array(frame, HEADER_BYTES);
  const raw = header.deflated ? await inflate(payload, rawBytes(header)) : payload;
  if (crc32c(raw) !== header.crc) throw new BadTile('the checksum of its pixels is wrong');
  return { header, ...toSharedExponent(header, new DataView(raw.buffer, raw.byteOffset, raw.byteLength)) };
}

/** All formats become RGB9E5, the smallest that WebGL 2 filters. It resolves 1/511 of the brightest channel. */
function toSharedExponent(header: TileHeader, raw: DataView): { texels: Uint32Array; exponent: number } {
  const count = header.width * header.height;
  const texels = new Uint32Array(count);
  if (header.format === 'rgb9e5') {
    for (let i = 0; i < count; ++i) texels[i] = raw.getUint32(4 * i, true);
    return { texels, exponent: header.scaleExponent };
  }
  if (header.format === 'r32ui') {
    const colour = header.kind === 'patchId' ? hashColour : (n: number) => encodeRgb9e5(n, n, n);
    for (let i = 0; i < count; ++i) texels[i] = colour(raw.getUint32(4 * i, true));
    return { texels, exponent: 0 };
  }
  const half = header.format === 'rgba16f';
  const number = half ? (at: number) => decodeHalf(raw.getUint16(at, true)) : (at: number) => raw.getFloat32(at, true);
  // RGB9E5 has no sign. Unshot light is negative where more was shot than has arrived; the view shows its amount.
  const read = header.kind === 'unshot' ? (at: number) => Math.abs(number(at)) : number;
  const [channel, stride] = half ? [2, 8] : [4, 16];
  let largest = 0;
  for (let i = 0; i < count; ++i)
    for (let c = 0; c < 3; ++c) largest = Math.max(largest, finite(read(stride * i + channel * c)));
  const exponent = largest > MAX_RGB9E5 || (largest > 0 && largest < 1) ? Math.ceil(Math.log2(largest)) - 14 : 0;
  const scale = 2 ** -exponent;
  for (let i = 0; i < count; ++i) {
    const at = stride * i;
    texels[i] = encodeRgb9e5(read(at) * scale, read(at + channel) * scale, read(at + 2 * channel) * scale);
  }
  return { texels, exponent: exponent + header.scaleExponent };
}

/** The number of a patch is a name, not an amount, so each patch gets a colour of its own. */
function hashColour(id: number): number {
  const hash = Math.imul(id ^ (id >>> 15), 0x2c1b3c6d) ^ Math.imul(id + 1, 0x9e3779b1);
  const part = (shift: number) => 0.15 + (0.7 * ((hash >>> shift) & 255)) / 255;
  return encodeRgb9e5(part(0), part(9), part(18));
}

function finite(v: number): number {
  return Number.isFinite(v) ? v : 0;
}

/** The tile's texels for a texture with value = texel x 2^exponent. */
export function rescaled(tile: Tile, exponent: number): Uint32Array {
  const shift = tile.exponent - exponent;
  return shift === 0 ? tile.texels : tile.texels.map((texel) => scaleRgb9e5(texel, shift));
}
