// One page of light: its texels, its texture, and the finest mip that has come for each tile. The texels are also kept
// in memory: the light meter reads them, and a lost WebGL context is filled from them. A texel takes 4 bytes here and
// on the card, and the mips a third more; while a page moves to another exponent, its texture is on the card twice.

import { DataTexture, ExternalTexture, NearestFilter, RedFormat, UnsignedByteType, type WebGLRenderer } from 'three';
import { luminance } from '../../page/colours';
import { rescaled, TILE_SIDE, type Tile } from '../../protocol/tile_frame';
import { decodeRgb9e5 } from '../../protocol/rgb9e5';
import type { PageSize } from '../../protocol/messages';
import { PageRescale, type Mip, type Slab } from './page_rescale';

export const NO_MIP = 255;
/** Mips of a page. Coarser ones than 1/32 of the page show nothing of use. */
export const MOST_MIPS = 6;
/**
 * The exponent of a page grows in large steps, as rescaling a page of 4096 x 4096 takes many frames and must not happen
 * for every tile that is a little brighter. Values 2^22 times darker than the brightest still keep their nine bits.
 */
const EXPONENT_STEP = 8;

/** A page on its way to another exponent: its new texture, and the new exponent. */
interface Growth {
  rescale: PageRescale;
  texture: WebGLTexture;
  exponent: number;
}

/** The exponent of a page for tiles of a given exponent. */
export function pageExponent(tileExponent: number): number {
  return EXPONENT_STEP * Math.ceil(tileExponent / EXPONENT_STEP);
}

export class LightmapPage {
  /** Size of the finest mip that is kept. */
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
  /** Tiles that nothing has come for, and tiles that the finest mip has not come for. */
  private missing: number;
  private coarse: number;
  private gotTile = false;
  private growth: Growth | undefined;

  /** `baseMip`: the finest mip to keep; above 0 where the whole page would not fit into memory. */
  constructor(
    private readonly renderer: WebGLRenderer,
    size: PageSize,
    private readonly baseMip: number,
    private readonly nearest = false,
  ) {
    this.width = Math.ceil(size.width / 2 ** baseMip);
    this.height = Math.ceil(size.height / 2 ** baseMip);
    const levels = Math.max(1, Math.min(MOST_MIPS, size.mips - baseMip));
    // The server rounds halves up, OpenGL down: with a size that divides without rest both have the same mips.
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

  /** The finest light is known everywhere. */
  get whole(): boolean {
    return this.coarse === 0;
  }

  get scale(): number {
    return 2 ** this.exponent;
  }

  /**
   * Makes room for values as bright as the tile's. Where the page has to be rescaled, each call rescales some rows,
   * until `endMs` (of performance.now()); meanwhile the old texture is drawn. False: call again before put().
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
        return this.makeRoom(tile, endMs); // an even brighter tile may have come first
      }
      this.uploadRows(texture, slab);
    } while (performance.now() < endMs);
    return false;
  }

  /** Takes up a tile for which there is room. False: the tile does not fit this page. */
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

  /** Bilinear irradiance in lux at texture coordinates, from the finest mip that has come; undefined: none has. */
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

  /** At most `count` of the texels' values (lux, luminance). */
  someValues(count: number): number[] {
    const fits = this.mips.findIndex((m) => m.width * m.height <= count);
    const level = fits < 0 ? this.mips.length - 1 : fits;
    const mip = this.mips[level]!;
    // An odd step walks through all columns of a page whose width is a power of two.
    const step = Math.ceil(mip.texels.length / count) | 1;
    const out: number[] = [];
    for (let i = 0; i < mip.texels.length; i += step) {
      const value = luminance(decodeRgb9e5(mip.texels[i]!)) * this.scaleAt(level, i);
      if (value > 0) out.push(value);
    }
    return out;
  }

  /** Makes the texture from the texels: at first, and when a lost WebGL context is back. */
  restore(): void {
    this.finishGrowth();
    this.texture.sourceTexture = this.makeTexture();
    if (this.gotTile)
      this.mips.forEach(({ height, texels }, level) =>
        this.uploadRows(this.drawn, { level, row: 0, rows: height, texels }),
      );
    this.resident.needsUpdate = true;
  }

  /** The context is lost: makes three.js forget the page's textures. */
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

  private grow(exponent: number): Growth {
    const rescale = new PageRescale(this.mips, this.exponent - exponent);
    return { rescale, texture: this.makeTexture(), exponent };
  }

  /** The texture is gone with the context, so the rest of the texels can be rescaled at once. */
  private finishGrowth(): void {
    if (!this.growth) return;
    while (this.growth.rescale.next());
    this.exponent = this.growth.exponent;
    this.growth = undefined;
  }

  /** The scale of one texel in memory, which may or may not be rescaled already. */
  private scaleAt(level: number, index: number): number {
    const { growth } = this;
    const isNew = growth?.rescale.has(level, Math.floor(index / this.mips[level]!.width));
    return 2 ** (isNew ? growth!.exponent : this.exponent);
  }

  /** An empty texture of the page's size. Values that no tile has set are undefined, and are not drawn. */
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
