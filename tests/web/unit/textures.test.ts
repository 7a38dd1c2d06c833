// KTX2 pictures become PNGs with the same colours, and what is no sound KTX2 is refused with a reason.
import { inflateSync } from 'node:zlib';
import { fileURLToPath } from 'node:url';
import type { Decode } from '../../../client/web/src/textures/basis';
import { nodeDecoder } from '../../../client/web/src/textures/basis_node';
import { readKtx2Head } from '../../../client/web/src/textures/ktx2';
import { encodePng } from '../../../client/web/src/textures/png';
import { mayHaveKtx2, withoutKtx2 } from '../../../client/web/src/textures/scene_textures';
import { makeGlb, makeKtx2, type Colour } from '../ktx2_maker';

const basis = fileURLToPath(
  new URL('../../../client/web/node_modules/three/examples/jsm/libs/basis/', import.meta.url),
);
const RED: Colour = [200, 10, 20, 255];
const CLEAR: Colour = [1, 2, 3, 128];
const WHITE: Colour = [255, 255, 255, 255];

/** 16 x 16 pixels, [200, 16, 24] on the left and [16, 64, 200] on the right, by Binomial's encoder 2.50 at its best. */
const ETC1S = Buffer.from(
  [
    'q0tUWCAyMLsNChoKAAAAAAEAAAAQAAAAEAAAAAAAAAAAAAAAAQAAAAEAAAABAAAAaAAAACwAAACUAAAAJAAAALgAAAAAAAAAjQAA',
    'AAAAAABFAQAAAAAAAAYAAAAAAAAAAAAAAAAAAAAsAAAAAAAAAAIAKACjAQIAAwMAAAgAAAAAAAAAAAA/AAAAAAAAAAAA/////x8A',
    'AABLVFh3cml0ZXIAQmFzaXMgVW5pdmVyc2FsIDIuNTAAAAIAAgAtAAAACQAAAC8AAAAAAAAAAAAAAAAAAAAGAAAAAAAAAAAAAAAd',
    'wJQAAAAAAAByQ4ABzAAAAAAAAEE4TzkAEwEAAAAAAEiBAGACAAAAAAAAwSIEAAAA+P///wcUwIQAAQAAAACyQQSACQABAAAAAMQR',
    'YG7AAABAQACMIwqlET4AmAAAAAAAAEAAAVGFP9ihAQ==',
  ].join(''),
  'base64',
);

/** Pixels of a PNG, by a reader of its own: all rows are "up". */
function readPng(png: Uint8Array): { width: number; height: number; channels: number; pixels: number[] } {
  const view = new DataView(png.buffer, png.byteOffset);
  const [width, height] = [view.getUint32(16), view.getUint32(20)];
  const channels = png[25] === 6 ? 4 : 3;
  const rows = inflateSync(png.subarray(33 + 8, 33 + 8 + view.getUint32(33)));
  const pixels: number[] = [];
  const stride = width * channels;
  for (let y = 0; y < height; ++y) {
    expect(rows[y * (stride + 1)]).toBe(2);
    for (let i = 0; i < stride; ++i)
      pixels.push((rows[y * (stride + 1) + 1 + i]! + (y > 0 ? pixels[(y - 1) * stride + i]! : 0)) % 256);
  }
  return { width, height, channels, pixels };
}

interface Gltf {
  textures: unknown[];
  images: { mimeType: string; bufferView: number }[];
  bufferViews: { byteOffset: number; byteLength: number }[];
  buffers: { byteLength: number }[];
}

function readGlb(glb: Uint8Array): { gltf: Gltf; binary: Uint8Array } {
  const view = new DataView(glb.buffer, glb.byteOffset);
  const bytes = view.getUint32(12, true);
  expect(view.getUint32(8, true)).toBe(glb.length);
  const gltf = JSON.parse(new TextDecoder().decode(glb.subarray(20, 20 + bytes))) as Gltf;
  return { gltf, binary: glb.subarray(28 + bytes) };
}

describe('KTX2 pictures', () => {
  let decode: Decode;
  beforeAll(async () => {
    decode = await nodeDecoder(`${basis}basis_transcoder.js`, `${basis}basis_transcoder.wasm`);
  });

  it.each([false, true])('keep the colours of their blocks (zstd: %s)', (zstd) => {
    const { width, height, rgba } = decode(makeKtx2([[RED, CLEAR, WHITE]], { zstd }));
    expect([width, height]).toEqual([12, 4]);
    const at = (x: number, y: number) => [...rgba.subarray(4 * (12 * y + x), 4 * (12 * y + x) + 4)];
    for (const y of [0, 3]) expect([at(0, y), at(3, y), at(4, y), at(11, y)]).toEqual([RED, RED, CLEAR, WHITE]);
  });

  it('of ETC1S have the colours that were encoded', () => {
    const { width, height, rgba } = decode(new Uint8Array(ETC1S));
    expect([width, height]).toEqual([16, 16]);
    for (const [x, colour] of [
      [3, [200, 16, 24, 255]],
      [12, [16, 64, 200, 255]],
    ] as const)
      for (const y of [0, 7, 15])
        for (let c = 0; c < 4; ++c)
          // ETC1S has five bits a channel and one step of brightness.
          expect(Math.abs(rgba[4 * (16 * y + x) + c]! - colour[c]!)).toBeLessThanOrEqual(8);
  });

  it('of ETC1S that are cut short are refused', () => {
    for (const bytes of [0, 79, 120, 200, 300, 330])
      expect(() => decode(new Uint8Array(ETC1S.subarray(0, bytes)))).toThrow(/KTX 2.0|lies outside|damaged/);
  });

  it('leave a file as it is where none is needed, or its JSON is none that has them', async () => {
    const png = { name: 'png', bytes: new Uint8Array([1]), mimeType: 'image/png' };
    const spare = makeGlb({ name: 'paint', bytes: makeKtx2([[RED]]), mimeType: 'image/ktx2' }, png);
    expect(await withoutKtx2(spare, decode)).toBe(spare);
    const extensions = { KHR_texture_basisu: { source: 0 } };
    for (const odd of [
      { textures: {}, extensionsUsed: ['KHR_texture_basisu'] },
      { textures: [null], extensionsUsed: ['KHR_texture_basisu'] },
      { textures: [{ extensions }], images: [{ uri: 5 }] },
      { textures: [{ extensions }], images: [{ bufferView: 0 }], bufferViews: 'none' },
      { textures: [{ extensions }], images: [{ bufferView: 0 }], extensionsUsed: 'KHR_texture_basisu' },
    ]) {
      const file = new TextEncoder().encode(JSON.stringify(odd));
      expect(await withoutKtx2(file, decode), JSON.stringify(odd)).toBe(file);
    }
  });

  it('become PNGs within their GLB, which nobody has to know the extension for', async () => {
    const glb = makeGlb({ name: 'paint', bytes: makeKtx2([[RED], [WHITE]]), mimeType: 'image/ktx2' });
    const { gltf, binary } = readGlb(await withoutKtx2(glb, decode));
    expect(gltf).not.toHaveProperty('extensionsUsed');
    expect(gltf).not.toHaveProperty('extensionsRequired');
    expect(gltf.textures).toEqual([{ source: 0 }]);
    const image = gltf.images[0]!;
    expect(image.mimeType).toBe('image/png');
    const view = gltf.bufferViews[image.bufferView]!;
    expect(gltf.buffers[0]!.byteLength).toBe(view.byteOffset + view.byteLength);
    const png = readPng(binary.slice(view.byteOffset, view.byteOffset + view.byteLength));
    expect(png.channels).toBe(3);
    expect([png.width, png.height]).toEqual([4, 8]);
    expect(png.pixels.slice(0, 3)).toEqual(RED.slice(0, 3));
    expect(png.pixels.slice(-3)).toEqual(WHITE.slice(0, 3));
  });

  it('become data in a .gltf', async () => {
    const bytes = Buffer.from(makeKtx2([[CLEAR]])).toString('base64');
    const gltf = {
      asset: { version: '2.0' },
      extensionsUsed: ['KHR_texture_basisu', 'KHR_texture_transform'],
      textures: [{ extensions: { KHR_texture_basisu: { source: 0 } } }],
      images: [{ uri: `data:image/ktx2;base64,${bytes}` }],
    };
    const sent = await withoutKtx2(new TextEncoder().encode(JSON.stringify(gltf)), decode);
    const made = JSON.parse(new TextDecoder().decode(sent)) as typeof gltf;
    expect(made.extensionsUsed).toEqual(['KHR_texture_transform']);
    const png = readPng(new Uint8Array(Buffer.from(made.images[0]!.uri.split(',')[1]!, 'base64')));
    expect(png.pixels.slice(0, 4)).toEqual(CLEAR);
  });

  it('are left alone where the texture names another picture', async () => {
    const png = await encodePng(new Uint8Array(4 * 16).fill(255), 4, 4);
    const spoilt = { name: 'ktx', bytes: new Uint8Array(16), mimeType: 'image/ktx2' };
    const glb = makeGlb(spoilt, { name: 'png', bytes: png, mimeType: 'image/png' });
    expect(mayHaveKtx2(glb)).toBe(true);
    const { gltf } = readGlb(await withoutKtx2(glb, decode));
    expect(gltf.textures).toEqual([{ source: 1, extensions: { KHR_texture_basisu: { source: 0 } } }]);
  });

  it.each<[string, (file: DataView) => void, RegExp]>([
    ['another kind', (file) => file.setUint8(0, 0), /is no KTX 2.0 file/],
    ['a size without end', (file) => file.setUint32(20, 2 ** 30, true), /claims 1073741824 x 4 pixels/],
    ['no size', (file) => file.setUint32(24, 0, true), /no two-dimensional picture/],
    ['six faces', (file) => file.setUint32(36, 6, true), /no two-dimensional picture/],
    ['plain pixels', (file) => file.setUint32(12, 37, true), /neither ETC1S nor UASTC/],
    ['a larger size than its blocks', (file) => file.setUint32(24, 4096, true), /claims 16 bytes of blocks/],
    ['a level beyond its end', (file) => file.setBigUint64(80, 2n ** 60n, true), /level 0 lies outside/],
    ['levels without end', (file) => file.setUint32(40, 4000, true), /4000 mip levels/],
    ['another supercompression', (file) => file.setUint32(44, 1, true), /supercompression 1/],
    ['a description beyond its end', (file) => file.setUint32(48, 2 ** 31, true), /description lies outside/],
  ])('of %s are refused by name', async (_, change, reason) => {
    const bytes = makeKtx2([[RED]], { change });
    expect(() => readKtx2Head(bytes)).toThrow(reason);
    const glb = makeGlb({ name: 'paint', bytes, mimeType: 'image/ktx2' });
    await expect(withoutKtx2(glb, decode)).rejects.toThrow(/^\/images\/0 \(paint\): /);
  });

  it('that are damaged within are refused, and the next one is read', () => {
    const bytes = makeKtx2([[RED]], { zstd: true });
    bytes[bytes.length - 20]! ^= 0xff; // the head of the zstd block
    expect(() => decode(bytes)).toThrow(/damaged|sound/);
    for (let cut = 81; cut < bytes.length; cut += 7) expect(() => decode(bytes.subarray(0, cut))).toThrow();
    expect([...decode(makeKtx2([[RED]])).rgba.subarray(0, 4)]).toEqual(RED);
  });
});
