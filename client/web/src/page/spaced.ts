// Limits how often something is shown that changes many times a second: the browser draws each change of a text with
// the card that the picture needs.

/** Least time between two showings. */
const APART_MS = 250;
/** Changes in quick succession, as in a solve of some hundredths of a second, show once. */
const SETTLE_MS = 100;

export class Spaced {
  private lastMs = -Infinity;
  private timer: ReturnType<typeof setTimeout> | undefined;

  /** `act` shows the newest state. */
  constructor(private readonly act: () => void) {}

  /** There is something to show. */
  soon(): void {
    const now = performance.now();
    this.timer ??= setTimeout(() => this.now(), Math.max(SETTLE_MS, this.lastMs + APART_MS - now));
  }

  now(): void {
    clearTimeout(this.timer);
    this.timer = undefined;
    this.lastMs = performance.now();
    this.act();
  }
}
