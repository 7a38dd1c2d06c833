// One page of light: the texels as they came, the texture that is drawn from, and which tiles of which mip are there.
// The texels are kept in memory too: the light meter reads them, and a lost WebGL context is filled from them.
// 4 bytes a texel here and on the card, each with a third more for the mips; while a page is stored anew under another
// exponent, once more on the card.

import { DataTexture, ExternalTexture, NearestFilter, RedFormat, UnsignedByteType, type WebGLRenderer } from 'three';
import { rescaled, TILE_SIDE, type Tile } from '../../protocol/tile_frame';
import { decodeRgb9e5 } from '../../protocol/rgb9e5';
import type { PageSize } from '../../protocol/messages';
import { PageRescale, type Mip, type Slab } from './page_rescale';

export const NO_MIP = 255;
/** Coarser mips than this say nothing: they are 1/32 of the page. */
export const MOST_MIPS = 6;
/**
 * A page's exponent grows in such steps: storing a page of 4096 x 4096 anew takes many frames, and shall not happen for
 * every tile that is a little brighter. What is 2^22 times darker than the brightest keeps its nine bits.
 */
const EXPONENT_STEP = 8;

/** A page that is being stored anew: the texture to be, and its exponent. */
interface Growth {
  rescale: PageRescale;
  texture: WebGLTexture;
  exponent: number;
}

/** The exponent under which a page stores tiles of this one. */
export function pageExponent(tileExponent: number): number {
  return EXPONENT_STEP * Math.ceil(tileExponent / EXPONENT_STEP);
}

export class LightmapPage {
  /** Of the finest mip that is kept. */
  readonly width: number;
  readonly height: number;
  /** The part of the texture that the page fills. */
  readonly used: readonly [number, number];
  readonly texture = new ExternalTexture();
  readonly resident: DataTexture;
  /** value = texel x 2^exponent */
  exponent = 0;
  /** Uniforms that materials share with the page. */
  readonly uniforms;
  private readonly mips: Mip[] = [];
  private readonly columns: number;
  private readonly rows: number;
  /** Tiles of which nothing has come yet, and of which the finest mip has not. */
  private missing: number;
  private coarse: number;
  private gotTile = false;
  private growth: Growth | undefined;

  /** `baseMip`: the finest mip to keep, where the whole would not fit into memory. */
  constructor(
    private readonly renderer: WebGLRenderer,
    size: PageSize,
    private readonly baseMip: number,
    private readonly nearest = false,
  ) {
    this.width = Math.ceil(size.width / 2 ** baseMip);
    this.height = Math.ceil(size.height / 2 ** baseMip);
    const levels = Math.max(1, Math.min(MOST_MIPS, size.mips - baseMip));
    // The server halves upwards, OpenGL downwards: of a size that divides without rest both make the same mips.
    const unit = 2 ** (levels - 1);
    const [width, height] = [this.width, this.height].map((side) => Math.ceil(side / unit) * unit) as [number, number];
    this.used = [this.width / width, this.height / height];
    for (let m = 0; m < levels; ++m) {
      const [w, h] = [width >> m, height >> m];
      this.mips.push({ width: w, height: h, texels: new Uint32Array(w * h) });
    }
    this.columns = Math.ceil(this.width / TILE_SIDE);
    this.rows = Math.ceil(this.height / TILE_SIDE);
    this.missing = this.coarse = this.columns * this.rows;
    const tiles = new Uint8Array(this.missing).fill(NO_MIP);
    this.resident = new DataTexture(tiles, this.columns, this.rows, RedFormat, UnsignedByteType);
    this.resident.minFilter = this.resident.magFilter = NearestFilter;
    this.resident.unpackAlignment = 1;
    this.resident.needsUpdate = true;
    this.texture.channel = 1;
    this.texture.repeat.set(...this.used);
    this.uniforms = {
      pageResident: { value: this.resident },
      pageSize: { value: [width, height] },
      pageTiles: { value: TILE_SIDE },
      pageUsed: { value: this.used },
      pageLightShown: { value: true },
    };
    this.restore();
  }

  /** Bytes of memory, and as many again on the card. */
  get bytes(): number {
    return this.mips.reduce((sum, mip) => sum + mip.texels.byteLength, 0);
  }

  /** Some light is known everywhere. */
  get covered(): boolean {
    return this.missing === 0;
  }

  /** All light is there, as finely as it is kept. */
  get whole(): boolean {
    return this.coarse === 0;
  }

  get scale(): number {
    return 2 ** this.exponent;
  }

  /**
   * Sees to it that the page can hold values as bright as the tile's. A page that cannot is stored anew, some rows a
   * call until `endMs` (of performance.now()), while it is drawn as it was. False: not done; call again before put().
   */
  makeRoom(tile: Tile, endMs: number): boolean {
    if (!this.gotTile) this.exponent = pageExponent(tile.exponent);
    if (tile.exponent <= this.exponent) return true;
    this.growth ??= this.grow(pageExponent(tile.exponent));
    const { rescale, texture, exponent } = this.growth;
    do {
      const slab = rescale.next();
      if (!slab) {
        this.growth = undefined;
        this.gl.deleteTexture(this.drawn);
        this.texture.sourceTexture = texture;
        this.exponent = exponent;
        return this.makeRoom(tile, endMs); // an even brighter one may have come first
      }
      this.uploadRows(texture, slab);
    } while (performance.now() < endMs);
    return false;
  }

  /** Takes a tile up, for which there is room. False: it is not of this page. */
  put(tile: Tile): boolean {
    const { header } = tile;
    const level = header.mip - this.baseMip;
    const mip = this.mips[level];
    if (!mip || header.x + header.width > mip.width || header.y + header.height > mip.height) return false;
    this.gotTile = true;
    const texels = rescaled(tile, this.exponent);
    for (let row = 0; row < header.height; ++row) {
      mip.texels.set(
        texels.subarray(row * header.width, (row + 1) * header.width),
        (header.y + row) * mip.width + header.x,
      );
    }
    this.upload(this.drawn, level, header.x, header.y, header.width, header.height, texels);
    this.markResident(level, header);
    return true;
  }

  /** Irradiance in lux at texture coordinates, bilinear, from the finest mip that is there; undefined: none yet. */
  sample(u: number, v: number): [number, number, number] | undefined {
    const column = Math.min(this.columns - 1, Math.max(0, Math.floor((u * this.width) / TILE_SIDE)));
    const row = Math.min(this.rows - 1, Math.max(0, Math.floor((v * this.height) / TILE_SIDE)));
    const level = this.tiles[row * this.columns + column]!;
    const mip = this.mips[level];
    if (!mip) return undefined;
    const x = Math.min(mip.width - 1, Math.max(0, u * this.used[0] * mip.width - 0.5));
    const y = Math.min(mip.height - 1, Math.max(0, v * this.used[1] * mip.height - 0.5));
    const [x0, y0] = [Math.floor(x), Math.floor(y)];
    const sum: [number, number, number] = [0, 0, 0];
    for (const [dx, dy] of [
      [0, 0],
      [1, 0],
      [0, 1],
      [1, 1],
    ] as const) {
      const weight = (dx ? x - x0 : 1 - x + x0) * (dy ? y - y0 : 1 - y + y0);
      const at = Math.min(mip.height - 1, y0 + dy) * mip.width + Math.min(mip.width - 1, x0 + dx);
      const scale = this.scaleAt(level, at);
      decodeRgb9e5(mip.texels[at]!).forEach((c, i) => (sum[i]! += weight * c * scale));
    }
    return sum;
  }

  /** At most `count` of the texels' values, lux, luminance; for the range of the legend. */
  someValues(count: number): number[] {
    const fits = this.mips.findIndex((m) => m.width * m.height <= count);
    const level = fits < 0 ? this.mips.length - 1 : fits;
    const mip = this.mips[level]!;
    // An odd step walks through all columns of a page whose width is a power of two.
    const step = Math.ceil(mip.texels.length / count) | 1;
    const out: number[] = [];
    for (let i = 0; i < mip.texels.length; i += step) {
      const [r, g, b] = decodeRgb9e5(mip.texels[i]!);
      const value = (0.2126 * r + 0.7152 * g + 0.0722 * b) * this.scaleAt(level, i);
      if (value > 0) out.push(value);
    }
    return out;
  }

  /** Makes the texture anew from the texels, after construction or when a lost WebGL context is back. */
  restore(): void {
    this.finishGrowth();
    this.texture.sourceTexture = this.makeTexture();
    if (this.gotTile)
      this.mips.forEach(({ height, texels }, level) =>
        this.uploadRows(this.drawn, { level, row: 0, rows: height, texels }),
      );
    this.resident.needsUpdate = true;
  }

  /** The context is lost: three.js is to forget the textures that it knew. */
  release(): void {
    this.texture.dispose();
    this.resident.dispose();
  }

  dispose(): void {
    this.gl.deleteTexture(this.drawn);
    if (this.growth) this.gl.deleteTexture(this.growth.texture);
    this.release();
  }

  private get gl(): WebGL2RenderingContext {
    return this.renderer.getContext() as WebGL2RenderingContext;
  }

  private get drawn(): WebGLTexture {
    return this.texture.sourceTexture as WebGLTexture;
  }

  private get tiles(): Uint8Array {
    return this.resident.image.data as Uint8Array;
  }

  private markResident(level: number, { x, y, width, height }: Tile['header']): void {
    const scale = 2 ** level / TILE_SIDE;
    const tiles = this.tiles;
    let changed = false;
    for (let row = Math.floor(y * scale); row < Math.min(this.rows, Math.ceil((y + height) * scale)); ++row) {
      for (let c = Math.floor(x * scale); c < Math.min(this.columns, Math.ceil((x + width) * scale)); ++c) {
        const before = tiles[row * this.columns + c]!;
        if (before <= level) continue;
        if (before === NO_MIP) --this.missing;
        if (level === 0) --this.coarse;
        tiles[row * this.columns + c] = level;
        changed = true;
      }
    }
    if (changed) this.resident.needsUpdate = true;
  }

  /** A brighter tile than the page can hold has come: everything there is to be stored under a larger scale. */
  private grow(exponent: number): Growth {
    const rescale = new PageRescale(this.mips, this.exponent - exponent);
    return { rescale, texture: this.makeTexture(), exponent };
  }

  /** With the context its texture is gone: the rest of the texels follow at once. */
  private finishGrowth(): void {
    if (!this.growth) return;
    while (this.growth.rescale.next());
    this.exponent = this.growth.exponent;
    this.growth = undefined;
  }

  /** Of one texel in memory, which may be stored anew already or not yet. */
  private scaleAt(level: number, index: number): number {
    const { growth } = this;
    const isNew = growth?.rescale.has(level, Math.floor(index / this.mips[level]!.width));
    return 2 ** (isNew ? growth!.exponent : this.exponent);
  }

  /** An empty texture of the page's size; values are undefined where no tile has come, and are not drawn. */
  private makeTexture(): WebGLTexture {
    const gl = this.gl;
    const texture = gl.createTexture()!;
    this.bind(texture);
    gl.texStorage2D(gl.TEXTURE_2D, this.mips.length, gl.RGB9_E5, this.mips[0]!.width, this.mips[0]!.height);
    const magnify = this.nearest ? gl.NEAREST : gl.LINEAR;
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, magnify);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, this.nearest ? gl.NEAREST : gl.LINEAR_MIPMAP_LINEAR);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE);
    return texture;
  }

  private uploadRows(texture: WebGLTexture, { level, row, rows, texels }: Slab): void {
    this.upload(texture, level, 0, row, this.mips[level]!.width, rows, texels);
  }

  private upload(
    texture: WebGLTexture,
    level: number,
    x: number,
    y: number,
    width: number,
    height: number,
    texels: Uint32Array,
  ): void {
    const gl = this.gl;
    const { state } = this.renderer;
    this.bind(texture);
    state.pixelStorei(gl.UNPACK_FLIP_Y_WEBGL, 0);
    state.pixelStorei(gl.UNPACK_PREMULTIPLY_ALPHA_WEBGL, 0);
    state.pixelStorei(gl.UNPACK_ALIGNMENT, 4);
    gl.texSubImage2D(
      gl.TEXTURE_2D, level, x, y, width, height, gl.RGB, gl.UNSIGNED_INT_5_9_9_9_REV, texels); // prettier-ignore
  }

  private bind(texture: WebGLTexture): void {
    const { state } = this.renderer;
    state.activeTexture(this.gl.TEXTURE0);
    state.bindTexture(this.gl.TEXTURE_2D, texture);
  }
}
