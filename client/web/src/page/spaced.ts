// For what is told many times a second, and need not be shown as often: every change of a text is drawn by the card that
// the picture waits for.

/** So often at most. */
const APART_MS = 250;
/** What is told of in quick succession, as of a solve of a few hundredths, shows once. */
const SETTLE_MS = 100;

export class Spaced {
  private lastMs = -Infinity;
  private timer: ReturnType<typeof setTimeout> | undefined;

  /** `act`: shows what is newest by then. */
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
