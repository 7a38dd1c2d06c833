// How much the server may send ahead of what was shown: about half a second of what the network carries, so that a slow
// line keeps its answers quick, and a quick one is never idle. Pure but for the clock that it is given.

const MIN_WINDOW = 64 * 1024;
const MAX_WINDOW = 8 * 1024 * 1024;
const AHEAD_S = 0.5;
const MEASURE_MS = 400;
/** A tile of 64 x 64 texels in the format that is asked for first, with its header. */
const FRAME = 64 * 64 * 4 + 64;
/** What comes no later than this after what came before it was there already. */
const AT_ONCE_MS = 1;

export const FIRST_WINDOW = 512 * 1024;

export class CreditWindow {
  private window = FIRST_WINDOW;
  private outstanding = FIRST_WINDOW; // what the server may still send, and what was sent and not yet used
  private ahead = FIRST_WINDOW; // what the server may still send
  private starved = false; // it may have waited for credit
  private measuredSince = -1;
  private measuredBytes = 0;
  private lastMs = 0;
  /** Before some frame, since measuring began: the page may have been busy with something else. */
  private longestPause = { ms: 0, bytes: 0, isOver: true };

  /** Bytes a second while tiles came without a pause; 0 until measured. */
  rate = 0;

  /** A frame has come. */
  received(bytes: number, nowMs: number): void {
    this.ahead -= bytes;
    this.starved ||= this.ahead < FRAME;
    if (this.measuredSince < 0) return this.measureFrom(nowMs); // how long the first was on its way is not known
    this.measuredBytes += bytes;
    const pause = nowMs - this.lastMs;
    if (pause > this.longestPause.ms) this.longestPause = { ms: pause, bytes, isOver: false };
    else if (pause > AT_ONCE_MS) this.longestPause.isOver = true;
    else if (!this.longestPause.isOver) this.longestPause.bytes += bytes;
    this.lastMs = nowMs;
    // The longest pause is left out, and what came at once after it, which may have lain in buffers while the page was
    // busy with something else: of what comes evenly that changes nothing.
    const took = nowMs - this.measuredSince - this.longestPause.ms;
    if (took < MEASURE_MS) return;
    const rate = (1000 * (this.measuredBytes - this.longestPause.bytes)) / took;
    if (this.starved) this.adaptToAtLeast(rate);
    else this.adapt(rate);
    this.measureFrom(nowMs);
  }

  /** Everything asked for has come: the pause that follows says nothing about the network. */
  idle(): void {
    this.measuredSince = -1;
  }

  private measureFrom(nowMs: number): void {
    this.measuredSince = this.lastMs = nowMs;
    this.measuredBytes = 0;
    this.longestPause = { ms: 0, bytes: 0, isOver: true };
    this.starved = this.ahead < FRAME;
  }

  /** A frame was shown. Returns the credit to give back now; 0: later. */
  used(bytes: number): number {
    this.outstanding -= bytes;
    const missing = this.window - this.outstanding;
    if (missing < this.window / 4) return 0;
    this.outstanding = this.window;
    this.ahead += missing;
    return missing;
  }

  private adapt(rate: number): void {
    this.rate = this.rate === 0 ? rate : 0.5 * (this.rate + rate);
    this.window = windowFor(this.rate);
  }

  /** The server waited for the page: what came says only what the network carries at least. */
  private adaptToAtLeast(rate: number): void {
    if (this.rate > 0) this.rate = Math.max(this.rate, rate);
    this.window = Math.max(this.window, windowFor(rate));
  }
}

function windowFor(rate: number): number {
  return Math.round(Math.min(MAX_WINDOW, Math.max(MIN_WINDOW, rate * AHEAD_S)));
}
