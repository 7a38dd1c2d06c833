// All pages of one layout and one quantity, and the tiles that wait for them. Each frame takes up tiles for a few
// milliseconds, so that the picture moves smoothly however many tiles come.

import type { WebGLRenderer } from 'three';
import type { LightmapsNote } from '../../protocol/messages';
import type { Tile } from '../../protocol/tile_frame';
import { LightmapPage } from './lightmap_page';

/** For the texels of all pages in memory, and once more on the card. */
export const MEMORY_BUDGET_BYTES = 512 * 2 ** 20;

/**
 * A frame takes up at least so many tiles, even if its time is over: on a busy processor the time may end before it
 * begins, and a page of a hundred tiles would take a hundred slow frames.
 */
const LEAST_TILES = 8;

/** Texels that the range of false colours is computed from, of all pages together. */
const RANGE_SAMPLES = 16_384;
/** Least ratio of the bright end of the range to its dark end. */
const LEAST_SPAN = 2;

/** The finest mip with which all pages fit into the budget. */
export function baseMipFor(pages: LightmapsNote['pages'], budget = MEMORY_BUDGET_BYTES): number {
  const bytes = pages.reduce((sum, page) => sum + (page.width * page.height * 16) / 3, 0);
  let mip = 0;
  while (bytes / 4 ** mip > budget && mip < 8) ++mip;
  return mip;
}

export class LightmapSet {
  readonly pages: LightmapPage[];
  readonly baseMip: number;
  /** Smallest error in the headers of tiles so far, as a fraction; Infinity: no tile has come. */
  error = Infinity;
  /** The server has once sent all the light that it had. */
  complete = false;
  tilesTaken = 0;
  /** Scene revision of the newest tile that was taken up; 0: no tile was. */
  revision = 0;
  /**
   * Some light has come, or the solve is over. Until then black tiles mean nothing: the server's first version of a
   * scene is black, as no light was shot yet.
   */
  lit = false;
  /** Uniform of all pages. False: surfaces look as if no light had come. */
  private readonly lightShown = { value: false };
  /** The server may be about to send more tiles of this version. */
  private open = false;
  private queue: { tile: Tile; bytes: number }[] = [];

  constructor(
    renderer: WebGLRenderer,
    readonly note: LightmapsNote,
    readonly quantity: string,
    private readonly used: (bytes: number) => void,
  ) {
    this.baseMip = baseMipFor(note.pages);
    const nearest = quantity === 'patchId' || quantity === 'mipLevel';
    this.pages = note.pages.map((page) => new LightmapPage(renderer, page, this.baseMip, nearest));
    for (const page of this.pages) page.uniforms.pageLightShown = this.lightShown;
    if (quantity === 'irradiance') return;
    this.lit = this.lightShown.value = true;
  }

  get bytes(): number {
    return this.pages.reduce((sum, page) => sum + page.bytes, 0);
  }

  /** More tiles will be taken up soon. */
  get expectsMore(): boolean {
    return this.open || this.queue.length > 0;
  }

  /** The server has sent all the light that it has now. */
  close(): void {
    this.complete = true;
    this.open = false;
  }

  get waiting(): number {
    return this.queue.length;
  }

  /** Light is known on all surfaces. */
  get covered(): boolean {
    return this.lit && (this.complete || this.pages.every((page) => page.covered));
  }

  /** All surfaces show their finest light. */
  get whole(): boolean {
    return this.showsLight && this.pages.every((page) => page.whole);
  }

  get showsLight(): boolean {
    return this.lightShown.value;
  }

  /** From the next frame on, surfaces show the light that has come. */
  showLight(): void {
    this.lightShown.value ||= this.lit;
  }

  /** The solve is over: this is the light, even if it is black. */
  settle(): void {
    this.lit = true;
  }

  /** `bytes`: credit that returns to the server when the tile is taken up. */
  enqueue(tile: Tile, bytes: number): void {
    this.open = true;
    this.queue.push({ tile, bytes });
  }

  /** Takes up waiting tiles for `budgetMs`, but a few in any case. Returns their number. */
  takeUp(budgetMs: number): number {
    const end = performance.now() + budgetMs;
    let taken = 0;
    while (taken < this.queue.length && (taken < LEAST_TILES || performance.now() < end)) {
      const { tile, bytes } = this.queue[taken]!;
      const page = this.pages[tile.header.page];
      if (page && !page.makeRoom(tile, end)) break; // the next frame continues
      page?.put(tile);
      ++taken;
      this.lit ||= tile.texels.some((texel) => (texel & 0x7ffffff) !== 0);
      this.revision = Math.max(this.revision, tile.header.revision);
      if (Number.isFinite(tile.header.error)) this.error = Math.min(this.error, tile.header.error);
      this.used(bytes);
    }
    this.queue.splice(0, taken);
    this.tilesTaken += taken;
    return taken;
  }

  /** Some of the values above 0 (lux, luminance). */
  someValues(): number[] {
    const each = Math.max(64, Math.floor(RANGE_SAMPLES / this.pages.length));
    return this.pages.flatMap((page) => page.someValues(each));
  }

  /** The dark and the bright end of the values, lux; undefined: no value is above 0. */
  range(): [number, number] | undefined {
    const values = Float64Array.from(this.someValues()).sort();
    if (values.length === 0) return undefined;
    const at = (q: number) => values[Math.min(values.length - 1, Math.floor(q * values.length))]!;
    // In even light, small differences must not look large.
    const high = at(0.995);
    const low = Math.min(at(0.005), high / LEAST_SPAN);
    // Errors and unshot light are 0 in many places, and need less range elsewhere.
    return [Math.max(low, high / (this.quantity === 'irradiance' ? 1e4 : 1e3)), high];
  }

  /** The context is lost. */
  release(): void {
    for (const page of this.pages) page.release();
  }

  /** A lost context is back. */
  restore(): void {
    for (const page of this.pages) page.restore();
  }

  dispose(): void {
    for (const { bytes } of this.queue) this.used(bytes);
    this.queue = [];
    for (const page of this.pages) page.dispose();
  }
}
