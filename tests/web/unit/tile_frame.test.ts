import { readFileSync } from 'node:fs';
import { deflateSync } from 'node:zlib';
import { crc32c } from '../../../client/web/src/protocol/crc32c';
import {
  decodeHalf,
  decodeRgb9e5,
  encodeRgb9e5,
  MAX_RGB9E5,
  scaleRgb9e5,
} from '../../../client/web/src/protocol/rgb9e5';
import {
  BadTile,
  decodeTile,
  HEADER_BYTES,
  KINDS,
  readTileHeader,
  rescaled,
} from '../../../client/web/src/protocol/tile_frame';

/** The annotated example of the specification. */
function exampleFrame(): ArrayBuffer {
  const text = readFileSync(new URL('../../../protocol/examples/tile-frame.hex', import.meta.url), 'utf8');
  const bytes = text
    .split('\n')
    .flatMap((line) => line.split('#')[0]!.trim().split(/\s+/))
    .filter((word) => word !== '')
    .map((word) => parseInt(word, 16));
  return new Uint8Array(bytes).buffer;
}

function changed(change: (view: DataView) => void): ArrayBuffer {
  const frame = exampleFrame();
  change(new DataView(frame));
  return frame;
}

/** A tile of one row of rgb9e5 words. */
function sharedExponentFrame(words: number[], deflated: boolean): ArrayBuffer {
  const raw = new Uint8Array(new Uint32Array(words).buffer);
  const payload = deflated ? deflateSync(raw) : raw;
  const frame = new Uint8Array(HEADER_BYTES + payload.length);
  frame.set(new Uint8Array(exampleFrame()).subarray(0, HEADER_BYTES));
  frame.set(payload, HEADER_BYTES);
  const view = new DataView(frame.buffer);
  view.setUint8(6, 1);
  view.setUint8(7, deflated ? 1 : 0);
  view.setUint16(24, words.length, true);
  view.setUint32(56, payload.length, true);
  view.setUint32(60, crc32c(raw), true);
  return frame.buffer;
}

describe('tile frame', () => {
  it('reads every field of the example', () => {
    expect(readTileHeader(exampleFrame())).toEqual({
      kind: 'irradiance',
      format: 'rgba16f',
      deflated: false,
      page: 1,
      mip: 2,
      final: false,
      reset: true,
      x: 64,
      y: 128,
      width: 2,
      height: 1,
      scaleExponent: 1,
      revision: 3,
      tileVersion: 41,
      shots: 18250,
      error: 0.03125,
      payloadBytes: 16,
      crc: 0x5fe225f7,
    });
  });

  it('gives the two texels of the example in lux', async () => {
    const tile = await decodeTile(exampleFrame());
    const lux = Array.from(tile.texels, (texel) => decodeRgb9e5(texel).map((c) => c * 2 ** tile.exponent));
    expect(lux[0]).toEqual([1, 0.5, 0.25]);
    // RGB9E5 holds 1/511 of the texel's largest channel.
    expect(Math.abs(lux[1]![0]! - 100)).toBeLessThanOrEqual(65504 / 511);
    expect(lux[1]![1]).toBe(0);
    expect(Math.abs(lux[1]![2]! - 65504)).toBeLessThanOrEqual(65504 / 511);
  });

  it.each([false, true])('takes rgb9e5 as it is (deflated: %s)', async (deflated) => {
    const words = Array.from({ length: 64 }, (_, i) => encodeRgb9e5(i, 2, 3));
    const tile = await decodeTile(sharedExponentFrame(words, deflated));
    expect(Array.from(tile.texels)).toEqual(words);
    expect(tile.exponent).toBe(1);
  });

  it('shows what is owed by its size, and of other quantities nothing below zero', async () => {
    const below = (kind: number) =>
      changed((view) => {
        view.setUint8(5, kind);
        for (const at of [0, 2, 4])
          view.setUint16(HEADER_BYTES + at, view.getUint16(HEADER_BYTES + at, true) | 0x8000, true);
        view.setUint32(60, crc32c(new Uint8Array(view.buffer, HEADER_BYTES)), true);
      });
    const first = async (kind: (typeof KINDS)[number]) => {
      const { header, texels, exponent } = await decodeTile(below(KINDS.indexOf(kind)));
      expect(header.kind).toBe(kind);
      return decodeRgb9e5(texels[0]!).map((c) => c * 2 ** exponent);
    };
    expect(await first('unshot')).toEqual([1, 0.5, 0.25]);
    expect(await first('irradiance')).toEqual([0, 0, 0]);
  });

  it.each<[string, (view: DataView) => void]>([
    ['magic', (v) => v.setUint8(0, 0)],
    ['version', (v) => v.setUint8(4, 2)],
    ['pixel format', (v) => v.setUint8(6, 9)],
    ['codec', (v) => v.setUint8(7, 7)],
    ['mip', (v) => v.setUint16(12, 17, true)],
    ['x that is no multiple of 64', (v) => v.setUint32(16, 1, true)],
    ['width 0', (v) => v.setUint16(24, 0, true)],
    ['width 65', (v) => v.setUint16(24, 65, true)],
    ['height 0', (v) => v.setUint16(26, 0, true)],
    ['payload size', (v) => v.setUint32(56, 8, true)],
    ['checksum', (v) => v.setUint32(60, 1, true)],
    ['pixels', (v) => v.setUint8(64, 1)],
    ['fewer texels than bytes', (v) => v.setUint16(24, 1, true)],
  ])('refuses a wrong %s', async (_, change) => {
    await expect(decodeTile(changed(change))).rejects.toBeInstanceOf(BadTile);
  });

  it('refuses frames cut anywhere', async () => {
    const frame = exampleFrame();
    for (let end = 0; end < frame.byteLength; ++end)
      await expect(decodeTile(frame.slice(0, end))).rejects.toBeInstanceOf(BadTile);
  });

  it('refuses a stream that inflates to more than its pixels', async () => {
    const frame = new Uint8Array(sharedExponentFrame(new Array<number>(64).fill(0), true));
    const bomb = deflateSync(new Uint8Array(64 * 4 + 1));
    const whole = new Uint8Array(HEADER_BYTES + bomb.length);
    whole.set(frame.subarray(0, HEADER_BYTES));
    whole.set(bomb, HEADER_BYTES);
    new DataView(whole.buffer).setUint32(56, bomb.length, true);
    await expect(decodeTile(whole.buffer)).rejects.toThrow('inflates to more');
  });

  it('refuses what is no stream at all', async () => {
    const frame = new Uint8Array(sharedExponentFrame([1, 2, 3, 4, 5, 6, 7, 8], false));
    frame[7] = 1;
    await expect(decodeTile(frame.buffer)).rejects.toThrow('zlib');
  });
});

describe('rescaled', () => {
  it('changes exponents only', async () => {
    const tile = await decodeTile(sharedExponentFrame([encodeRgb9e5(300, 20, 1)], false));
    const scaled = rescaled(tile, 5);
    expect(decodeRgb9e5(scaled[0]!).map((c) => c * 32)).toEqual(decodeRgb9e5(tile.texels[0]!).map((c) => c * 2));
  });
});

describe('shared exponents', () => {
  it('hold what GL says they hold', () => {
    expect(decodeRgb9e5(encodeRgb9e5(1, 0.5, 0.25))).toEqual([1, 0.5, 0.25]);
    expect(decodeRgb9e5(encodeRgb9e5(1e9, -1, NaN))).toEqual([MAX_RGB9E5, 0, 0]);
    expect(encodeRgb9e5(0, 0, 0)).toBe(0);
    // The largest mantissa rounds up into the next exponent.
    expect(decodeRgb9e5(encodeRgb9e5(0.9999, 0, 0))[0]).toBe(1);
  });

  it('are within half a step of the largest channel, for all sizes', () => {
    let state = 12345;
    const random = () => (state = (state * 1103515245 + 12345) & 0x7fffffff) / 0x7fffffff;
    for (let i = 0; i < 5000; ++i) {
      const size = 2 ** (random() * 28 - 13);
      const colour = [random() * size, random() * size, random() * size] as const;
      const largest = Math.max(...colour);
      decodeRgb9e5(encodeRgb9e5(...colour)).forEach((c, k) => {
        expect(Math.abs(c - colour[k]!)).toBeLessThanOrEqual(Math.max(largest / 511, 2 ** -25) * 1.0001);
      });
    }
  });

  it('stop at both ends when scaled', () => {
    expect(decodeRgb9e5(scaleRgb9e5(encodeRgb9e5(60000, 0, 0), 3))[0]).toBe(MAX_RGB9E5);
    expect(decodeRgb9e5(scaleRgb9e5(encodeRgb9e5(2 ** -14, 0, 0), -8))[0]).toBe(2 ** -22);
  });
});

it('halves are IEEE binary16', () => {
  expect([0x3c00, 0xc000, 0x7bff, 0x0001, 0x0400, 0x8000].map(decodeHalf)).toEqual([
    1,
    -2,
    65504,
    2 ** -24,
    2 ** -14,
    -0,
  ]);
  expect(decodeHalf(0x7c00)).toBe(Infinity);
  expect(decodeHalf(0x7e00)).toBeNaN();
});

it('CRC-32C has its check value', () => {
  expect(crc32c(new TextEncoder().encode('123456789'))).toBe(0xe3069283);
});
