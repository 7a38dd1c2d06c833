// Moves the texels of a lightmap page to another exponent, some rows at a time: all 22 million texels of a page of 4096
// x 4096 would take several frames. Pure; the lightmap page uploads the result.

import { scaleRgb9e5 } from '../../protocol/rgb9e5';

/** One level of a page: RGB9E5 texels, row by row. */
export interface Mip {
  width: number;
  height: number;
  texels: Uint32Array;
}

/** About a millisecond's work. */
const SLAB_TEXELS = 2 ** 18;

export interface Slab {
  level: number;
  row: number;
  rows: number;
  /** A view into the level's texels. */
  texels: Uint32Array;
}

export class PageRescale {
  private level = 0;
  private row = 0;

  /** Multiplies texels by 2^shift. `shift`: old exponent less new exponent. */
  constructor(
    private readonly mips: readonly Mip[],
    private readonly shift: number,
    private readonly slabTexels = SLAB_TEXELS,
  ) {}

  /** Rescales the next rows in place; undefined: all are done. */
  next(): Slab | undefined {
    const mip = this.mips[this.level];
    if (!mip) return undefined;
    const { level, row } = this;
    const rows = Math.min(mip.height - row, Math.max(1, Math.floor(this.slabTexels / mip.width)));
    const texels = mip.texels.subarray(row * mip.width, (row + rows) * mip.width);
    for (let i = 0; i < texels.length; ++i) texels[i] = scaleRgb9e5(texels[i]!, this.shift); // five times as fast as forEach
    this.row += rows;
    if (this.row === mip.height) {
      ++this.level;
      this.row = 0;
    }
    return { level, row, rows, texels };
  }

  /** Whether the row is rescaled already. */
  has(level: number, row: number): boolean {
    return level < this.level || (level === this.level && row < this.row);
  }
}
