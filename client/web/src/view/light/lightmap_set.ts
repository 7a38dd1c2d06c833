// All pages of one layout, and the tiles that wait to be drawn. Tiles are taken up a few milliseconds a frame, so that
// moving about stays smooth however many come.

import type { WebGLRenderer } from 'three';
import type { LightmapsNote } from '../../protocol/messages';
import type { Tile } from '../../protocol/tile_frame';
import { LightmapPage } from './lightmap_page';

/** Texels of all pages in memory, and as many again on the card. */
export const MEMORY_BUDGET_BYTES = 512 * 2 ** 20;

/**
 * A frame takes up so many, whatever the clock says: where the page gets little of its processor, a frame of one tile
 * would be spent before it began, and a page of a hundred tiles would take a hundred slow frames.
 */
const LEAST_TILES = 8;

/** Texels that the legend's range is made of, of all pages together. */
const RANGE_SAMPLES = 16_384;
/** From the dark to the bright end of the range. */
const LEAST_SPAN = 2;

/** The finest mip of all pages that fits into the budget. */
export function baseMipFor(pages: LightmapsNote['pages'], budget = MEMORY_BUDGET_BYTES): number {
  const bytes = pages.reduce((sum, page) => sum + (page.width * page.height * 16) / 3, 0);
  let mip = 0;
  while (bytes / 4 ** mip > budget && mip < 8) ++mip;
  return mip;
}

export class LightmapSet {
  readonly pages: LightmapPage[];
  readonly baseMip: number;
  /** Smallest error that a tile's header told of, as a fraction; Infinity: no tile yet. */
  error = Infinity;
  /** The server has said once that everything it had was sent. */
  complete = false;
  tilesTaken = 0;
  /** Scene revision of the newest tile that was taken up; 0: none. */
  revision = 0;
  /**
   * Some light has come, or the solve is over without any. The server's first version of a scene is black, as nothing
   * has shone yet.
   */
  lit = false;
  /** Uniform of all pages: until light is shown, surfaces show as those that nothing has come for. */
  private readonly lightShown = { value: false };
  /** The server has not said yet that the newest tiles are all it has by now. */
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

  /** More tiles are to be taken up soon. */
  get expectsMore(): boolean {
    return this.open || this.queue.length > 0;
  }

  /** The server has sent everything that it has by now. */
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

  /** All surfaces show light, as finely as it is kept. */
  get whole(): boolean {
    return this.showsLight && this.pages.every((page) => page.whole);
  }

  get showsLight(): boolean {
    return this.lightShown.value;
  }

  /** From the next frame on surfaces show the light that has come, where some has. */
  showLight(): void {
    this.lightShown.value ||= this.lit;
  }

  /** The solve does not go on: what there is is the light. */
  settle(): void {
    this.lit = true;
  }

  /** `bytes` of the frame are given back to the server when the tile was taken up. */
  enqueue(tile: Tile, bytes: number): void {
    this.open = true;
    this.queue.push({ tile, bytes });
  }

  /** Takes up what waits for `budgetMs`, but some at least. Returns how many tiles that were. */
  takeUp(budgetMs: number): number {
    const end = performance.now() + budgetMs;
    let taken = 0;
    while (taken < this.queue.length && (taken < LEAST_TILES || performance.now() < end)) {
      const { tile, bytes } = this.queue[taken]!;
      const page = this.pages[tile.header.page];
      if (page && !page.makeRoom(tile, end)) break; // goes on in the next frame
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

  /** Some of the values that are there and more than nothing, lux, luminance. */
  someValues(): number[] {
    const each = Math.max(64, Math.floor(RANGE_SAMPLES / this.pages.length));
    return this.pages.flatMap((page) => page.someValues(each));
  }

  /** Values at the dark and bright end of what is there, lux; undefined: nothing is more than nothing. */
  range(): [number, number] | undefined {
    const values = Float64Array.from(this.someValues()).sort();
    if (values.length === 0) return undefined;
    const at = (q: number) => values[Math.min(values.length - 1, Math.floor(q * values.length))]!;
    // Where all is lit alike, what little it differs by is not to look like much.
    const high = at(0.995);
    const low = Math.min(at(0.005), high / LEAST_SPAN);
    // Errors and remainders are nothing in many places, and differ little where they are something.
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
