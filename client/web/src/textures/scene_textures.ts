// KTX 2.0 pictures of a scene file (KHR_texture_basisu) as PNGs, which the server reads. Pure; for browsers and Node.js.
import type { Decode } from './basis';
import { readKtx2Head } from './ktx2';
import { encodePng, joined } from './png';

const BASISU = 'KHR_texture_basisu';
/** Of all pictures, which are unpacked one by one: a minute or two of work. */
const MOST_PIXELS = 2 ** 30;

interface Texture {
  source?: number;
  extensions?: Record<string, { source?: number } | undefined>;
}

interface Image {
  name?: string;
  uri?: string;
  mimeType?: string;
  bufferView?: number;
}

interface BufferView {
  buffer: number;
  byteOffset?: number;
  byteLength: number;
}

interface Scene {
  textures?: Texture[];
  images?: Image[];
  bufferViews?: BufferView[];
  buffers?: { uri?: string; byteLength: number }[];
  extensionsUsed?: string[];
  extensionsRequired?: string[];
}

/** Whether it is worth while to make a decoder. */
export function mayHaveKtx2(file: Uint8Array): boolean {
  const { json } = split(file);
  return json.includes(BASISU);
}

/**
 * The file with its KTX 2.0 pictures as PNGs; the same bytes where it has none that are needed: a texture with a `source`
 * beside the extension's keeps to that. Pictures in other files are left to who reads them. Throws an Error that names
 * the picture and says what is wrong.
 */
export async function withoutKtx2(file: Uint8Array, decode: Decode): Promise<Uint8Array> {
  const parts = split(file);
  if (!parts.json.includes(BASISU)) return file;
  const scene = readScene(parts.json);
  const needed = scene && neededImages(scene);
  if (!scene || !needed?.size) return file;
  const made: Uint8Array[] = [];
  const buffers = new Buffers(scene, parts.binary);
  let pixels = 0;
  for (const index of needed) {
    const image = scene.images?.[index];
    const bytes = image && buffers.bytesOf(image);
    if (!image || !bytes) continue;
    const where = `/images/${index}${image.name ? ` (${image.name})` : ''}`;
    try {
      const { width, height } = readKtx2Head(bytes);
      pixels += width * height;
      if (pixels > MOST_PIXELS) throw new Error(`makes more than ${MOST_PIXELS} pixels of all pictures`);
      const picture = decode(bytes);
      const png = await encodePng(picture.rgba, picture.width, picture.height);
      replace(scene, image, png, parts.binary, made);
    } catch (error) {
      throw new Error(`${where}: ${error instanceof Error ? error.message : 'cannot be unpacked'}`);
    }
    for (const texture of scene.textures ?? []) {
      if (texture.extensions?.[BASISU]?.source !== index) continue;
      texture.source = index;
      delete texture.extensions[BASISU];
    }
  }
  dropIdle(scene);
  return write(scene, parts.binary && joined([parts.binary, ...made]));
}

/** Undefined where it is no sound glTF, as far as is read here: the server says what is wrong. */
function readScene(json: string): Scene | undefined {
  const isObject = (value: unknown) => typeof value === 'object' && value !== null && !Array.isArray(value);
  const isText = (value: unknown) => value === undefined || typeof value === 'string';
  const isList = (value: unknown, good: (entry: never) => boolean) =>
    value === undefined || (Array.isArray(value) && (value as never[]).every(good));
  try {
    const scene = JSON.parse(json) as Scene;
    const sound =
      isObject(scene) &&
      isList(scene.textures, (texture: Texture) => isObject(texture) && isObject(texture.extensions ?? {})) &&
      isList(scene.images, (image: Image) => isObject(image) && isText(image.uri) && isText(image.mimeType)) &&
      isList(scene.bufferViews, isObject) &&
      isList(scene.buffers, (buffer: { uri?: unknown }) => isObject(buffer) && isText(buffer.uri)) &&
      isList(scene.extensionsUsed, isText) &&
      isList(scene.extensionsRequired, isText);
    return sound ? scene : undefined;
  } catch {
    return undefined;
  }
}

/** Of textures that have no other picture. */
function neededImages(scene: Scene): Set<number> {
  const needed = new Set<number>();
  for (const texture of scene.textures ?? []) {
    const source = texture.extensions?.[BASISU]?.source;
    const other = scene.images?.[texture.source ?? -1];
    if (source !== undefined && (!other || other.mimeType === 'image/ktx2')) needed.add(source);
  }
  return needed;
}

function replace(
  scene: Scene,
  image: Image,
  png: Uint8Array,
  binary: Uint8Array | undefined,
  made: Uint8Array[],
): void {
  image.mimeType = 'image/png';
  const buffer = scene.buffers?.[0];
  if (!binary || !buffer || buffer.uri !== undefined) {
    delete image.bufferView;
    image.uri = `data:image/png;base64,${base64(png)}`;
    return;
  }
  const offset = binary.length + made.reduce((sum, part) => sum + part.length, 0);
  scene.bufferViews ??= [];
  image.bufferView = scene.bufferViews.push({ buffer: 0, byteOffset: offset, byteLength: png.length }) - 1;
  delete image.uri;
  made.push(png, new Uint8Array((4 - (png.length % 4)) % 4));
  buffer.byteLength = offset + png.length;
}

function dropIdle(scene: Scene): void {
  if (scene.textures?.some((texture) => texture.extensions?.[BASISU])) return;
  for (const list of ['extensionsUsed', 'extensionsRequired'] as const) {
    const left = scene[list]?.filter((name) => name !== BASISU);
    if (left?.length) scene[list] = left;
    else delete scene[list];
  }
  for (const texture of scene.textures ?? [])
    if (texture.extensions && Object.keys(texture.extensions).length === 0) delete texture.extensions;
}

/** What images lie in; each buffer is unpacked once. */
class Buffers {
  private readonly unpacked = new Map<number, Uint8Array | undefined>();

  constructor(
    private readonly scene: Scene,
    private readonly binary: Uint8Array | undefined,
  ) {}

  /** Undefined where the image lies in another file, or nowhere. */
  bytesOf(image: Image): Uint8Array | undefined {
    if (image.uri?.startsWith('data:')) return fromDataUri(image.uri);
    const view = this.scene.bufferViews?.[image.bufferView ?? -1];
    const whole = view && this.buffer(view.buffer);
    if (!whole) return undefined;
    const first = view.byteOffset ?? 0;
    const isInside = first >= 0 && view.byteLength >= 0 && first + view.byteLength <= whole.length;
    return isInside ? whole.subarray(first, first + view.byteLength) : undefined;
  }

  private buffer(index: number): Uint8Array | undefined {
    const uri = this.scene.buffers?.[index]?.uri;
    if (!uri) return index === 0 && this.scene.buffers?.[0] ? this.binary : undefined;
    if (!this.unpacked.has(index)) this.unpacked.set(index, uri.startsWith('data:') ? fromDataUri(uri) : undefined);
    return this.unpacked.get(index);
  }
}

interface Parts {
  json: string;
  binary?: Uint8Array; // of a GLB, padded to words
}

const GLB = 0x46546c67;
const JSON_CHUNK = 0x4e4f534a;
const BIN_CHUNK = 0x004e4942;

/** What is no sound GLB is nothing to look through: whoever reads it says what is wrong. */
function split(file: Uint8Array): Parts {
  const view = new DataView(file.buffer, file.byteOffset, file.byteLength);
  if (file.length < 12 || view.getUint32(0, true) !== GLB) return { json: new TextDecoder().decode(file) };
  const parts: Parts = { json: '', binary: new Uint8Array() };
  for (let at = 12; at + 8 <= file.length; ) {
    const bytes = view.getUint32(at, true);
    const type = view.getUint32(at + 4, true);
    if (at + 8 + bytes > file.length) return { json: '' };
    const data = file.subarray(at + 8, at + 8 + bytes);
    if (type === JSON_CHUNK) parts.json = new TextDecoder().decode(data);
    if (type === BIN_CHUNK) parts.binary = data;
    at += 8 + bytes;
  }
  return parts;
}

function write(scene: Scene, binary: Uint8Array | undefined): Uint8Array {
  const json = new TextEncoder().encode(JSON.stringify(scene));
  if (!binary) return json;
  const text = joined([json, new Uint8Array((4 - (json.length % 4)) % 4).fill(0x20)]);
  const words = (values: number[]) => new Uint8Array(Uint32Array.from(values).buffer);
  const chunks = [words([text.length, JSON_CHUNK]), text, words([binary.length, BIN_CHUNK]), binary];
  const length = 12 + chunks.reduce((sum, part) => sum + part.length, 0);
  return joined([words([GLB, 2, length]), ...chunks]);
}

function fromDataUri(uri: string): Uint8Array | undefined {
  const comma = uri.indexOf(',');
  if (comma < 0 || !uri.slice(0, comma).endsWith(';base64')) return undefined;
  try {
    const text = atob(uri.slice(comma + 1));
    const bytes = new Uint8Array(text.length);
    for (let i = 0; i < bytes.length; ++i) bytes[i] = text.charCodeAt(i); // from() takes 20 times as long
    return bytes;
  } catch {
    return undefined;
  }
}

function base64(bytes: Uint8Array): string {
  const parts: string[] = [];
  for (let at = 0; at < bytes.length; at += 0x6000)
    parts.push(btoa(String.fromCharCode(...bytes.subarray(at, at + 0x6000))));
  return parts.join('');
}
