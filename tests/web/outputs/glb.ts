// GLB files as JSON and bytes, and one with textures, which the generated scenes have none of.

import { readFileSync, writeFileSync } from 'node:fs';
import { deflateSync } from 'node:zlib';

interface Gltf {
  nodes: { camera?: number; translation: number[]; rotation: number[] }[];
  cameras: { perspective: { yfov: number } }[];
  meshes: { primitives: { attributes: Record<string, number>; material: number }[] }[];
  materials: { name: string; pbrMetallicRoughness?: Record<string, unknown>; extensions?: Record<string, unknown> }[];
  accessors: Record<string, unknown>[];
  bufferViews: Record<string, number>[];
  buffers: { byteLength: number }[];
  [member: string]: unknown;
}

interface Glb {
  gltf: Gltf;
  bin: Buffer;
}

export function readGlb(file: string): Glb {
  const bytes = readFileSync(file);
  const end = 20 + bytes.readUInt32LE(12);
  return { gltf: JSON.parse(bytes.subarray(20, end).toString()) as Gltf, bin: bytes.subarray(end + 8) };
}

function padded(bytes: Buffer, filler: number): Buffer {
  return Buffer.concat([bytes, Buffer.alloc((4 - (bytes.length % 4)) % 4, filler)]);
}

function writeGlb(file: string, { gltf, bin }: Glb): void {
  gltf.buffers[0]!.byteLength = bin.length;
  const chunk = (type: number, data: Buffer) => {
    const head = Buffer.alloc(8);
    head.writeUInt32LE(data.length);
    head.writeUInt32LE(type, 4);
    return Buffer.concat([head, data]);
  };
  const body = Buffer.concat([
    chunk(0x4e4f534a, padded(Buffer.from(JSON.stringify(gltf)), 0x20)),
    chunk(0x004e4942, padded(bin, 0)),
  ]);
  const head = Buffer.alloc(12);
  head.write('glTF');
  head.writeUInt32LE(2, 4);
  head.writeUInt32LE(12 + body.length, 8);
  writeFileSync(file, Buffer.concat([head, body]));
}

function crc32(bytes: Buffer): number {
  let crc = ~0;
  for (const byte of bytes) {
    crc ^= byte;
    for (let bit = 0; bit < 8; ++bit) crc = (crc >>> 1) ^ (crc & 1 ? 0xedb88320 : 0);
  }
  return ~crc >>> 0;
}

function png(side: number, colourAt: (x: number, y: number) => readonly number[]): Buffer {
  const chunk = (type: string, data: Buffer) => {
    const body = Buffer.concat([Buffer.from(type), data]);
    const length = Buffer.alloc(4);
    const sum = Buffer.alloc(4);
    length.writeUInt32BE(data.length);
    sum.writeUInt32BE(crc32(body));
    return Buffer.concat([length, body, sum]);
  };
  const header = Buffer.from([0, 0, 0, side, 0, 0, 0, side, 8, 2, 0, 0, 0]); // 8 bits, RGB
  const rows = Array.from({ length: side }, (_, y) => [
    0,
    ...Array.from({ length: side }, (_, x) => colourAt(x, y)).flat(),
  ]);
  return Buffer.concat([
    Buffer.from([0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a]),
    chunk('IHDR', header),
    chunk('IDAT', deflateSync(Buffer.from(rows.flat()))),
    chunk('IEND', Buffer.alloc(0)),
  ]);
}

/** The scene with squares of two colours, a quarter of a metre wide, on what has one of these materials. */
export function withTexture(scene: string, output: string, materials: readonly string[]): void {
  const { gltf, bin } = readGlb(scene);
  const parts = [padded(bin, 0)];
  const append = (bytes: Buffer) => {
    const byteOffset = parts.reduce((sum, part) => sum + part.length, 0);
    parts.push(padded(bytes, 0));
    return gltf.bufferViews.push({ buffer: 0, byteOffset, byteLength: bytes.length }) - 1;
  };
  const squares = png(64, (x, y) => (((x >> 3) ^ (y >> 3)) & 1 ? [220, 190, 140] : [60, 90, 150]));
  gltf['images'] = [{ bufferView: append(squares), mimeType: 'image/png' }];
  gltf['samplers'] = [{ magFilter: 9729, minFilter: 9987 }];
  gltf['textures'] = [{ source: 0, sampler: 0 }];
  const textured = gltf.materials.flatMap(({ name }, i) => (materials.includes(name) ? [i] : []));
  if (textured.length !== materials.length) throw new Error(`${scene} has not all of ${materials.join(', ')}`);
  for (const i of textured)
    Object.assign(gltf.materials[i]!.pbrMetallicRoughness!, {
      baseColorFactor: [1, 1, 1, 1],
      baseColorTexture: { index: 0 },
    });
  for (const { attributes, material } of gltf.meshes.flatMap(({ primitives }) => primitives)) {
    if (!textured.includes(material)) continue;
    const uvs = overTheSurface(gltf, parts[0]!, attributes['POSITION']!);
    const view = append(Buffer.from(uvs.buffer));
    const accessor = { bufferView: view, componentType: 5126, count: uvs.length / 2, type: 'VEC2' };
    attributes['TEXCOORD_0'] = gltf.accessors.push(accessor) - 1;
  }
  writeGlb(output, { gltf, bin: Buffer.concat(parts) });
}

/** Of what withTexture() has made: one of its materials in specular-glossiness with a texture of both, one unlit. */
export function withOddMaterials(scene: string, output: string, glossy: string, unlit: string): void {
  const { gltf, bin } = readGlb(scene);
  const dark = png(4, () => [10, 10, 10]); // a reflectance of 0.3 %
  const parts = [padded(bin, 0), dark];
  const bufferView = gltf.bufferViews.push({ buffer: 0, byteOffset: parts[0]!.length, byteLength: dark.length }) - 1;
  (gltf['images'] as unknown[]).push({ bufferView, mimeType: 'image/png' });
  (gltf['textures'] as unknown[]).push({ source: 1, sampler: 0 });
  const named = (wanted: string) => gltf.materials.find(({ name }) => name === wanted)!;
  delete named(glossy).pbrMetallicRoughness;
  named(glossy).extensions = {
    KHR_materials_pbrSpecularGlossiness: { diffuseTexture: { index: 0 }, specularGlossinessTexture: { index: 1 } },
  };
  named(unlit).extensions = { KHR_materials_unlit: {} };
  const used = ['KHR_materials_pbrSpecularGlossiness', 'KHR_materials_unlit'];
  gltf['extensionsUsed'] = [...((gltf['extensionsUsed'] as string[] | undefined) ?? []), ...used];
  writeGlb(output, { gltf, bin: Buffer.concat(parts) });
}

/** The scene with one of its meshes of glass. */
export function withGlass(scene: string, output: string, mesh: number): void {
  const { gltf, bin } = readGlb(scene);
  const glass = {
    name: 'glass',
    pbrMetallicRoughness: { metallicFactor: 0, roughnessFactor: 0 },
    extensions: { KHR_materials_transmission: { transmissionFactor: 1 } },
  };
  gltf.meshes[mesh]!.primitives[0]!.material = gltf.materials.push(glass) - 1;
  gltf['extensionsUsed'] = [...((gltf['extensionsUsed'] as string[] | undefined) ?? []), 'KHR_materials_transmission'];
  writeGlb(output, { gltf, bin });
}

/** For a flat piece along two of the axes: these, in steps of two metres. */
function overTheSurface(gltf: Gltf, bin: Buffer, accessor: number): Float32Array {
  const { bufferView, byteOffset = 0, count } = gltf.accessors[accessor]! as Record<string, number>;
  const view = gltf.bufferViews[bufferView!]!;
  const at = (i: number) => bin.readFloatLE((view['byteOffset'] ?? 0) + byteOffset + 4 * i);
  const points = Array.from({ length: count! }, (_, i) => [at(3 * i), at(3 * i + 1), at(3 * i + 2)]);
  const extent = (axis: number) => {
    const along = points.map((point) => point[axis]!);
    return Math.max(...along) - Math.min(...along);
  };
  const axes = [0, 1, 2].sort((a, b) => extent(b) - extent(a)).slice(0, 2);
  return new Float32Array(points.flatMap((point) => axes.map((axis) => point[axis]! / 2)));
}

export interface View {
  eye: number[];
  at: number[];
  yfov: number;
}

/** The first camera of a file of ours: it looks along its -Z. */
export function viewOf(file: string): View {
  const { gltf } = readGlb(file);
  const { translation, rotation } = gltf.nodes.find(({ camera }) => camera === 0)!;
  const [x, y, z, w] = rotation as [number, number, number, number];
  const back = [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)];
  return {
    eye: translation,
    at: translation.map((v, axis) => v - back[axis]!),
    yfov: gltf.cameras[0]!.perspective.yfov,
  };
}
