// How much the server may send ahead of what the page has shown: about half a second's worth, so that a slow network
// still answers quickly, and a fast one is never idle. Pure: the caller passes the time.

const MIN_WINDOW = 64 * 1024;
const MAX_WINDOW = 8 * 1024 * 1024;
const AHEAD_S = 0.5;
const MEASURE_MS = 400;
/** Bytes of a tile of 64 x 64 texels in the preferred format, with its header. */
const FRAME = 64 * 64 * 4 + 64;
/** Frames closer together than this had arrived before and waited in a buffer. */
const AT_ONCE_MS = 1;

export const FIRST_WINDOW = 512 * 1024;

export class CreditWindow {
  private window = FIRST_WINDOW;
  private outstanding = FIRST_WINDOW; // bytes that the server may still send, and bytes that wait to be used
  private ahead = FIRST_WINDOW; // bytes that the server may still send
  private starved = false; // the server may have waited for credit
  private measuredSince = -1;
  private measuredBytes = 0;
  private lastMs = 0;
  /** Between two frames, since measuring began: the page may have been busy with something else. */
  private longestPause = { ms: 0, bytes: 0, isOver: true };

  /** Bytes a second while tiles arrive without a pause; 0: not measured yet. */
  rate = 0;

  /** A frame has arrived. */
  received(bytes: number, nowMs: number): void {
    this.ahead -= bytes;
    this.starved ||= this.ahead < FRAME;
    if (this.measuredSince < 0) return this.measureFrom(nowMs); // nobody knows how long the first frame was on its way
    this.measuredBytes += bytes;
    const pause = nowMs - this.lastMs;
    if (pause > this.longestPause.ms) this.longestPause = { ms: pause, bytes, isOver: false };
    else if (pause > AT_ONCE_MS) this.longestPause.isOver = true;
    else if (!this.longestPause.isOver) this.longestPause.bytes += bytes;
    this.lastMs = nowMs;
    // The longest pause does not count, nor do the frames right after it: the page may have been busy, and the frames
    // may have waited in buffers. When frames arrive evenly, this changes nothing.
    const took = nowMs - this.measuredSince - this.longestPause.ms;
    if (took < MEASURE_MS) return;
    const rate = (1000 * (this.measuredBytes - this.longestPause.bytes)) / took;
    if (this.starved) this.adaptToAtLeast(rate);
    else this.adapt(rate);
    this.measureFrom(nowMs);
  }

  /** All light has arrived: the pause that follows says nothing about the network. */
  idle(): void {
    this.measuredSince = -1;
  }

  private measureFrom(nowMs: number): void {
    this.measuredSince = this.lastMs = nowMs;
    this.measuredBytes = 0;
    this.longestPause = { ms: 0, bytes: 0, isOver: true };
    this.starved = this.ahead < FRAME;
  }

  /** A frame was used. Returns the credit to give back now; 0: none yet. */
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

  /** The server waited for the page, so `rate` is only a lower bound of what the network carries. */
  private adaptToAtLeast(rate: number): void {
    if (this.rate > 0) this.rate = Math.max(this.rate, rate);
    this.window = Math.max(this.window, windowFor(rate));
  }
}

function windowFor(rate: number): number {
  return Math.round(Math.min(MAX_WINDOW, Math.max(MIN_WINDOW, rate * AHEAD_S)));
}
