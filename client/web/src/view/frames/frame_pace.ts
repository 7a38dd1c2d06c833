// How finely to draw, and when, so that moving about stays smooth where frames take long (a weak card, or none). While
// something moves, fewer pixels are drawn; as soon as all is at rest, all of them. Pure: is told what frames cost.

/** Of each side of the picture: every step has half the pixels of the one before. */
export const SCALES = [1, Math.SQRT1_2, 0.5, 0.5 * Math.SQRT1_2, 0.25] as const;

/** What moves is drawn so finely that a frame takes no longer, where the coarsest scale can do that. */
export const MOVING_FRAME_MS = 40;
/** Nothing has moved for so long, and for so many turns of a page that may be slow: all is at rest. */
const REST_MS = 200;
const REST_TURNS = 3;
/** Of light that comes in quick succession coarse pictures go before the sharp one, but for no longer. */
const MOST_COARSE_MS = 1000;
/** Frames at rest leave a slow card some of the time they take, so that what moves next need not wait; but no more. */
const PAUSE_SHARE = 0.3;
const MOST_PAUSE_MS = 500;
/** What an edit changes waits so long for its light, where a picture without it would be what the light has to wait for. */
const MOST_AWAIT_MS = 100;
/** And the first of some tiles so long for the others, which would have to wait for a picture of it alone. */
const MOST_GATHER_MS = 40;
/** One is drawn while the next is made: more would only show what is asked for later. */
const MOST_UNDER_WAY = 2;
/** Of a whole frame, where the browser says that it draws without a card: 2560 x 1600 on two cores, about. */
const SOFTWARE_FRAME_MS = 300;
/** A page that nobody looked at has not been told when its frames were done. */
const LONGEST_FRAME_MS = 5000;

interface Frame {
  scale: number;
  begunMs: number;
  turn: number;
}

export class FramePace {
  /** What the first frame is likely to be drawn with. */
  readonly firstScale: number;
  private readonly underWay: Frame[] = [];
  /** What frames with all pixels would take, by the newest two that were measured. */
  private wholeFrameMs: [number, number];
  private lastEndMs = -Infinity;
  private lastTookMs = 0;
  private hurryUntilMs = -Infinity;
  private lastTurnMs = -Infinity;
  private turnsSinceHurry = Infinity;
  private turns = 0;
  /** After how many turns the newest two frames were done. */
  private turnsTaken: [number, number] = [Infinity, Infinity];
  private lastScale = 1;
  /** Until when, at most, the next frame waits for light, and for more of it; undefined: it has not waited for any. */
  private awaitUntilMs: number | undefined;
  private gatherUntilMs: number | undefined;
  /** Since when light has come to a picture that is coarse. */
  private coarseSinceMs: number | undefined;

  /** `software`: no card draws, as far as is known. */
  constructor(software: boolean) {
    const guess = software ? SOFTWARE_FRAME_MS : 0;
    this.wholeFrameMs = [guess, guess];
    this.firstScale = this.movingScale;
  }

  /** Once for every turn of the page, before anything else. */
  turn(nowMs: number): void {
    if (nowMs > this.lastTurnMs) {
      ++this.turnsSinceHurry;
      ++this.turns;
    }
    this.lastTurnMs = nowMs;
  }

  /** Something was edited, and its light is a moment behind. A card that is quick shows the one and then the other. */
  awaitLight(nowMs: number): void {
    if (this.movingScale < 1) this.awaitUntilMs ??= nowMs + MOST_AWAIT_MS;
  }

  /** Something is moved by hand: that does not wait. */
  moved(nowMs: number): void {
    this.awaitUntilMs = this.gatherUntilMs = -Infinity;
    this.hurry(nowMs);
  }

  /** Something moves, and for so long a soon picture is worth more than a sharp one. */
  hurry(nowMs: number, forMs = REST_MS): void {
    this.turnsSinceHurry = 0;
    this.hurryUntilMs = Math.max(this.hurryUntilMs, nowMs + forMs);
  }

  /**
   * Tiles have been taken up. A sharp picture of the first of them would keep a slow card from showing the next ones; one
   * that is sharp already stays so, as it would flicker otherwise.
   */
  lightCame(nowMs: number): void {
    this.awaitUntilMs = -Infinity;
    if (this.movingScale < 1) this.gatherUntilMs ??= nowMs + MOST_GATHER_MS;
    if (this.lastScale === 1) return;
    this.coarseSinceMs ??= nowMs;
    const leftMs = this.coarseSinceMs + MOST_COARSE_MS - nowMs;
    if (leftMs > 0) this.hurry(nowMs, Math.min(REST_MS, leftMs));
  }

  /** No more is on its way. */
  allCame(): void {
    if (this.gatherUntilMs !== undefined) this.gatherUntilMs = -Infinity;
  }

  /** Turns are counted as they come: one long turn, as when a scene is taken up, says nothing of the next ones. */
  private isHurried(nowMs: number): boolean {
    return nowMs < this.hurryUntilMs || this.turnsSinceHurry < REST_TURNS;
  }

  /** What is on the screen was drawn in a hurry that is over: it is to be drawn anew. */
  isSharpDue(nowMs: number): boolean {
    return this.lastScale < 1 && !this.isHurried(nowMs);
  }

  /** The scale of a frame that is drawn now; undefined: later, as the card has enough to do. */
  ask(nowMs: number): number | undefined {
    if (nowMs < Math.max(this.awaitUntilMs ?? -Infinity, this.gatherUntilMs ?? -Infinity)) return undefined;
    if (this.isHurried(nowMs)) return this.underWay.length < MOST_UNDER_WAY ? this.movingScale : undefined;
    const pause = this.lastTookMs > MOVING_FRAME_MS ? Math.min(MOST_PAUSE_MS, PAUSE_SHARE * this.lastTookMs) : 0;
    return this.underWay.length > 0 || nowMs - this.lastEndMs < pause ? undefined : 1;
  }

  /** The card has drawn all that it was given. */
  get isIdle(): boolean {
    return this.underWay.length === 0;
  }

  /**
   * Who asks it for something waits for less than a turn: it is idle, or has one frame, and was done with the last two by the
   * turn after theirs.
   */
  get isQuiet(): boolean {
    return this.isIdle || (this.underWay.length === 1 && this.turnsTaken.every((turns) => turns <= 1));
  }

  /** The picture is sharp, and nothing is being drawn or moves. */
  isAtRest(nowMs: number): boolean {
    return this.isIdle && this.lastScale === 1 && !this.isHurried(nowMs);
  }

  /** A frame was handed to the card. */
  began(nowMs: number, scale: number): void {
    this.underWay.push({ scale, begunMs: nowMs, turn: this.turns });
    this.lastScale = scale;
    this.awaitUntilMs = this.gatherUntilMs = undefined;
    if (scale === 1) this.coarseSinceMs = undefined;
  }

  /**
   * The card is done with the oldest frames. Of more than one in the same turn it is known only what all of them took
   * together: none of them was drawn in no time.
   */
  ended(nowMs: number, count: number): void {
    const frames = this.underWay.splice(0, count);
    const [oldest] = frames;
    if (!oldest) return;
    this.turnsTaken = [this.turnsTaken[1], this.turns - oldest.turn];
    const tookMs = nowMs - Math.max(oldest.begunMs, this.lastEndMs);
    this.lastEndMs = nowMs;
    if (tookMs > LONGEST_FRAME_MS) return;
    const pixels = frames.reduce((sum, { scale }) => sum + scale ** 2, 0);
    this.lastTookMs = (tookMs * frames.at(-1)!.scale ** 2) / pixels;
    this.wholeFrameMs = [this.wholeFrameMs[1], tookMs / pixels];
  }

  /** The card was taken away, and all it had to draw. */
  forget(): void {
    this.underWay.length = 0;
    this.turnsTaken = [Infinity, Infinity];
  }

  /** The finest that is quick enough. One slow frame may be a hiccup (a program being compiled): two are not. */
  private get movingScale(): number {
    const wholeMs = Math.min(...this.wholeFrameMs);
    return SCALES.find((scale) => wholeMs * scale ** 2 <= MOVING_FRAME_MS) ?? SCALES.at(-1)!;
  }
}
