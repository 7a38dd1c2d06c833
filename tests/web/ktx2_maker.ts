// KTX 2.0 files for tests, made from the specification: solid blocks of UASTC (its mode 8), plain or as raw blocks of
// zstd.

export type Colour = readonly [number, number, number, number];

interface Options {
  zstd?: boolean;
  change?: (file: DataView) => void; // to spoil it
}

/** `blocks`: rows of blocks of 4 x 4 pixels, each of one colour. */
export function makeKtx2(blocks: readonly (readonly Colour[])[], { zstd = false, change }: Options = {}): Uint8Array {
  const data = Uint8Array.from(blocks.flat().flatMap((colour) => [...solidBlock(colour)]));
  const stored = zstd ? zstdFrame(data) : data;
  const description = describe();
  const head = 80 + 24;
  const offset = Math.ceil((head + description.length) / 16) * 16;
  const file = new Uint8Array(offset + stored.length);
  const view = new DataView(file.buffer);
  file.set([0xab, 0x4b, 0x54, 0x58, 0x20, 0x32, 0x30, 0xbb, 0x0d, 0x0a, 0x1a, 0x0a]);
  const words = [0, 1, 4 * blocks[0]!.length, 4 * blocks.length, 0, 0, 1, 1, zstd ? 2 : 0, head, description.length];
  words.forEach((word, i) => view.setUint32(12 + 4 * i, word, true));
  [offset, stored.length, data.length].forEach((number, i) => view.setBigUint64(80 + 8 * i, BigInt(number), true));
  file.set(description, head);
  file.set(stored, offset);
  change?.(view);
  return file;
}

/** 128 bits, the lowest first: the mode's code, the colour, and hints for ETC1 that nobody needs. */
function solidBlock(colour: Colour): Uint8Array {
  let bits = 0b10111n;
  colour.forEach((channel, i) => (bits |= BigInt(channel) << BigInt(5 + 8 * i)));
  return Uint8Array.from({ length: 16 }, (_, i) => Number((bits >> BigInt(8 * i)) & 255n));
}

/** Data format descriptor (Khronos): UASTC with alpha, sRGB. */
function describe(): Uint8Array {
  const view = new DataView(new ArrayBuffer(44));
  view.setUint32(0, 44, true);
  view.setUint32(8, 2 | (40 << 16), true); // version, size of the block
  [166, 1, 2, 0, 3, 3, 0, 0, 16].forEach((byte, i) => view.setUint8(12 + i, byte)); // UASTC, BT.709, sRGB; 4 x 4; 16 bytes
  view.setUint16(28, 0, true);
  view.setUint8(30, 127); // bits less one
  view.setUint8(31, 3); // RGBA
  view.setUint32(40, 0xffffffff, true);
  return new Uint8Array(view.buffer);
}

/** RFC 8878: one segment, raw blocks. */
function zstdFrame(data: Uint8Array): Uint8Array {
  const most = 2 ** 17 - 1;
  const parts: number[] = [0x28, 0xb5, 0x2f, 0xfd, 0xa0];
  const little = (value: number, bytes: number) => {
    for (let i = 0; i < bytes; ++i) parts.push(Math.floor(value / 2 ** (8 * i)) % 256);
  };
  little(data.length, 4);
  for (let at = 0; at < data.length; at += most) {
    const part = data.subarray(at, at + most);
    little(8 * part.length + (at + most >= data.length ? 1 : 0), 3);
    parts.push(...part);
  }
  return Uint8Array.from(parts);
}

interface GlbPicture {
  name: string;
  bytes: Uint8Array;
  mimeType: string;
}

/** A lit room's worth of glTF: a quad with a texture that has these pictures; `fallback`: for who knows no KTX2. */
export function makeGlb(
  ktx2: GlbPicture,
  fallback?: GlbPicture,
  use: 'baseColorTexture' | 'normalTexture' = 'baseColorTexture',
): Uint8Array {
  const corners = new Uint8Array(new Float32Array([0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0, 0, 1, 1, 1, 1, 0, 0, 0]).buffer);
  const indices = new Uint8Array(new Uint16Array([0, 1, 2, 0, 2, 3]).buffer);
  const pictures = fallback ? [ktx2, fallback] : [ktx2];
  const parts = [corners, indices, ...pictures.map((picture) => picture.bytes)];
  const views: { buffer: number; byteOffset: number; byteLength: number }[] = [];
  let length = 0;
  for (const part of parts) {
    views.push({ buffer: 0, byteOffset: length, byteLength: part.length });
    length += Math.ceil(part.length / 4) * 4;
  }
  const binary = new Uint8Array(length);
  parts.forEach((part, i) => binary.set(part, views[i]!.byteOffset));
  const extensions = { KHR_texture_basisu: { source: 0 } };
  const gltf = {
    asset: { version: '2.0' },
    extensionsUsed: ['KHR_texture_basisu'],
    ...(fallback ? {} : { extensionsRequired: ['KHR_texture_basisu'] }),
    scene: 0,
    scenes: [{ nodes: [0] }],
    nodes: [{ mesh: 0 }],
    meshes: [{ primitives: [{ attributes: { POSITION: 0, TEXCOORD_0: 1 }, indices: 2, material: 0 }] }],
    materials: [
      use === 'normalTexture'
        ? { normalTexture: { index: 0 }, pbrMetallicRoughness: { metallicFactor: 0 } }
        : { pbrMetallicRoughness: { baseColorTexture: { index: 0 }, metallicFactor: 0 } },
    ],
    textures: [fallback ? { source: 1, extensions } : { extensions }],
    images: pictures.map(({ name, mimeType }, i) => ({ name, mimeType, bufferView: 2 + i })),
    accessors: [
      { bufferView: 0, componentType: 5126, count: 4, type: 'VEC3', min: [0, 0, 0], max: [1, 1, 0] },
      { bufferView: 0, byteOffset: 48, componentType: 5126, count: 4, type: 'VEC2' },
      { bufferView: 1, componentType: 5123, count: 6, type: 'SCALAR' },
    ],
    bufferViews: views,
    buffers: [{ byteLength: length }],
  };
  const json = new TextEncoder().encode(JSON.stringify(gltf));
  const text = new Uint8Array(Math.ceil(json.length / 4) * 4).fill(0x20);
  text.set(json);
  const glb = new Uint8Array(12 + 8 + text.length + 8 + length);
  const view = new DataView(glb.buffer);
  [0x46546c67, 2, glb.length, text.length, 0x4e4f534a].forEach((word, i) => view.setUint32(4 * i, word, true));
  glb.set(text, 20);
  view.setUint32(20 + text.length, length, true);
  view.setUint32(24 + text.length, 0x004e4942, true);
  glb.set(binary, 28 + text.length);
  return glb;
}
