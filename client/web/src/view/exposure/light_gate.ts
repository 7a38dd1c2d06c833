// Holds a scene's first light back until it is known how brightly to show it: at an exposure of nothing it would come in
// the dark, or dazzle. Pure: is told the time.

/** A card that never says how bright the light is holds it up for no longer. */
const MOST_CLOSED_MS = 3000;
/** So long it is waited for finer light than the first, whose coarse texels are of several surfaces each. */
const MOST_SHARPENING_MS = 60;
/** Light that comes bit by bit is measured after so long, on the surfaces that have some by then. */
const MOST_COVERING_MS = 250;
/** Meanwhile nothing is drawn, so that the card has nothing else to do; what moves need not wait for longer. */
const STILL_MS = 400;

export class LightGate {
  private sinceMs: number | undefined;
  private replaces = false;

  /**
   * Once for every turn of the page. `waits`: there is light whose exposure is not known. `replaces`: it takes the place
   * of other light, whose picture stays until it can be shown: surfaces without light in between would flash.
   */
  turn(nowMs: number, waits: boolean, replaces = false): void {
    this.sinceMs = waits ? (this.sinceMs ?? nowMs) : undefined;
    this.replaces = replaces;
  }

  /** Light is not to be shown yet. */
  isClosed(nowMs: number): boolean {
    return this.waitedMs(nowMs) < MOST_CLOSED_MS;
  }

  /**
   * Light is to be measured now. `isCovered`: there is some on all surfaces; `isWhole`: more is not to come soon. Light
   * that waits at no gate is measured as soon as there is some on all surfaces.
   */
  mayMeasure(nowMs: number, isCovered: boolean, isWhole: boolean): boolean {
    const waited = this.sinceMs === undefined ? 0 : nowMs - this.sinceMs;
    if (!isCovered) return waited >= MOST_COVERING_MS;
    return this.sinceMs === undefined || isWhole || waited >= MOST_SHARPENING_MS;
  }

  standsStill(nowMs: number): boolean {
    return this.waitedMs(nowMs) < (this.replaces ? MOST_CLOSED_MS : STILL_MS);
  }

  private waitedMs(nowMs: number): number {
    return this.sinceMs === undefined ? Infinity : nowMs - this.sinceMs;
  }
}
