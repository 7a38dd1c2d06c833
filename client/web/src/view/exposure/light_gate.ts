// Holds a scene's first light back until its exposure is known: with a wrong exposure the picture would be dark, or
// dazzle. Pure: the caller passes the time.

/** Longest time that light is held back, if the card never returns a measurement. */
const MOST_CLOSED_MS = 3000;
/** Longest wait for finer light than the first, whose coarse texels mix several surfaces. */
const MOST_SHARPENING_MS = 60;
/** Light that comes bit by bit is measured after so long, on those surfaces that have some by then. */
const MOST_COVERING_MS = 250;
/** For so long nothing else is drawn, so that the card can measure; a moving picture waits no longer. */
const STILL_MS = 400;

export class LightGate {
  private sinceMs: number | undefined;
  private replaces = false;

  /**
   * Once a turn of the page. `waits`: there is light with an unknown exposure. `replaces`: the light takes the place of
   * another scene's light, whose picture stays until then; surfaces without light in between would flash.
   */
  turn(nowMs: number, waits: boolean, replaces = false): void {
    this.sinceMs = waits ? (this.sinceMs ?? nowMs) : undefined;
    this.replaces = replaces;
  }

  /** Light must not be shown yet. */
  isClosed(nowMs: number): boolean {
    return this.waitedMs(nowMs) < MOST_CLOSED_MS;
  }

  /**
   * Whether to measure the light now. `isCovered`: all surfaces have some; `isWhole`: no more will come soon. Light
   * that the gate does not hold back is measured as soon as all surfaces have some.
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
