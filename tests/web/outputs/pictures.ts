// Pictures of lit scenes as engines draw them, beside those of a path tracer.

import { readFileSync } from 'node:fs';
import { viewOf } from './glb';
import { trace } from './solve';

export const WIDTH = 480;
export const HEIGHT = 360;
/** Side of the squares of pixels that are compared: wider than texels are in the picture, so that their blur is not. */
const BLOCK = 24;
const PATHS = 16; // a pixel; 9,216 a block, whose mean they know to some 0.7 %

/** R, G, B of each pixel, rows from the top, of what WebGL reads: 32-bit R, G, B, A, rows from the bottom. */
export function fromBase64(text: string): Float32Array {
  const bytes = Buffer.from(text, 'base64');
  const rgba = new Float32Array(bytes.buffer, bytes.byteOffset, bytes.length / 4);
  const rgb = new Float32Array(3 * WIDTH * HEIGHT);
  for (let y = 0; y < HEIGHT; ++y)
    for (let x = 0; x < WIDTH; ++x)
      for (let c = 0; c < 3; ++c) rgb[3 * (y * WIDTH + x) + c] = rgba[4 * ((HEIGHT - 1 - y) * WIDTH + x) + c]!;
  return rgb;
}

/** What a camera sees by path tracing: R, G, B of each pixel, rows from the top, nits. `file` is made for it. */
export async function traced(scene: string, file: string): Promise<Float32Array> {
  const { eye, at, yfov } = viewOf(scene);
  const size = ['--width', WIDTH, '--height', HEIGHT, '--paths', PATHS];
  await trace(scene, file, '--eye', ...eye, '--at', ...at, '--yfov', yfov, ...size);
  const bytes = readFileSync(file);
  return new Float32Array(bytes.buffer, bytes.byteOffset, bytes.length / 4);
}

/** Mean of each channel over each block. */
function blocks(picture: Float32Array): number[] {
  const across = WIDTH / BLOCK;
  const sums = new Array<number>(3 * across * (HEIGHT / BLOCK)).fill(0);
  picture.forEach((value, i) => {
    const pixel = Math.floor(i / 3);
    const block = Math.floor(Math.floor(pixel / WIDTH) / BLOCK) * across + Math.floor((pixel % WIDTH) / BLOCK);
    sums[3 * block + (i % 3)]! += value / BLOCK ** 2;
  });
  return sums;
}

export interface Difference {
  /** Of all radiance in the picture. */
  ratio: number;
  /** Of the blocks' differences, relative to what is there and a hundredth of the mean. */
  rms: number;
  worst: number;
}

export function compare(ours: Float32Array, truth: Float32Array): Difference {
  const a = blocks(ours);
  const b = blocks(truth);
  const sum = (values: readonly number[]) => values.reduce((total, value) => total + value, 0);
  const floor = (0.01 * sum(b)) / b.length;
  const relative = a.map((value, i) => (value - b[i]!) / (b[i]! + floor));
  return {
    ratio: sum(a) / sum(b),
    rms: Math.sqrt(sum(relative.map((value) => value * value)) / relative.length),
    worst: Math.max(...relative.map(Math.abs)),
  };
}

/**
 * The light in all is known to 0.1 % and solved to 1 %. Blocks differ by 1.3 to 2.2 %: by the paths' noise, by shadows and
 * contacts narrower than texels, and by the mip levels of textures. A lightmap that is upside down is off by 30 % and
 * more, pi in the wrong place by a factor of three.
 */
export function expectTheSame({ ratio, rms }: Difference): void {
  expect(Math.abs(ratio - 1)).toBeLessThan(0.01);
  expect(rms).toBeLessThan(0.03);
}
