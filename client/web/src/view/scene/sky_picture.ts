// A picture of the sky: Radiance HDR as the server sends it, as a texture.

import { DataTexture, DataUtils, HalfFloatType, LinearFilter, RGBAFormat, RepeatWrapping, type Vector3 } from 'three';
import type { Vec3 } from '../../document/gltf';

/** What half floats hold. */
const MOST = 65_504;
const SIZE = /-Y (\d+) \+X (\d+)$/;

export class SkyPicture {
  readonly texture: DataTexture;

  /** `pixels`: R, G, B and exponent of each, row by row from the zenith. */
  private constructor(
    readonly width: number,
    readonly height: number,
    private readonly pixels: Uint8Array,
  ) {
    const half = new Uint16Array(4 * width * height);
    for (let i = 0; i < width * height; i++) {
      this.read(i).forEach((nits, c) => (half[4 * i + c] = DataUtils.toHalfFloat(Math.min(nits, MOST))));
      half[4 * i + 3] = DataUtils.toHalfFloat(1);
    }
    this.texture = new DataTexture(half, width, height, RGBAFormat, HalfFloatType);
    this.texture.magFilter = this.texture.minFilter = LinearFilter;
    this.texture.wrapS = RepeatWrapping;
    this.texture.needsUpdate = true;
  }

  /** Undefined: it is not as the server sends it. */
  static from(bytes: Uint8Array): SkyPicture | undefined {
    const text = new TextDecoder('latin1').decode(bytes.subarray(0, 256));
    const head = text.indexOf('\n\n');
    const end = text.indexOf('\n', head + 2);
    const size = SIZE.exec(text.slice(head + 2, end));
    if (!text.startsWith('#?') || head < 0 || end < 0 || !size) return undefined;
    const [height, width] = [Number(size[1]), Number(size[2])];
    const pixels = bytes.subarray(end + 1);
    return width * height > 0 && pixels.length >= 4 * width * height
      ? new SkyPicture(width, height, pixels)
      : undefined;
  }

  private read(i: number): Vec3 {
    const [r = 0, g = 0, b = 0, exponent = 0] = this.pixels.subarray(4 * i, 4 * i + 4);
    const scale = exponent > 0 ? 2 ** (exponent - 136) : 0;
    return [r * scale, g * scale, b * scale];
  }

  /** Nits; `direction` of any length but 0. */
  at(direction: Vector3): Vec3 {
    const { x, y, z } = direction;
    const column = Math.floor((Math.atan2(z, x) / (2 * Math.PI) + 0.5) * this.width);
    const row = Math.floor((Math.acos(y / direction.length()) / Math.PI) * this.height);
    return this.read(Math.min(row, this.height - 1) * this.width + Math.min(column, this.width - 1));
  }

  dispose(): void {
    this.texture.dispose();
  }
}
