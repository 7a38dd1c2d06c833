// Decides when to draw and with how many pixels, so that movement stays smooth on a weak card or in software. While
// something moves, fewer pixels are drawn; at rest, all of them. Pure: the caller passes the time.

/** Scales of each side of the picture; each has half the pixels of the one before. */
export const SCALES = [1, Math.SQRT1_2, 0.5, 0.5 * Math.SQRT1_2, 0.25] as const;

/** Longest frame while something moves, if the coarsest scale allows it. */
export const MOVING_FRAME_MS = 40;
/** The picture is at rest when nothing has moved for so long and for so many turns of the page, which may be slow. */
const REST_MS = 200;
const REST_TURNS = 3;
/** While light comes in quick succession, coarse pictures precede the sharp one, but for no longer than this. */
const MOST_COARSE_MS = 1000;
/** Frames at rest leave a slow card free for a part of their time, so that the next movement need not wait. */
const PAUSE_SHARE = 0.3;
const MOST_PAUSE_MS = 500;
/** Longest wait for the light of an edit: on a slow card the light would have to wait for a picture without it. */
const MOST_AWAIT_MS = 100;
/** Longest wait for more tiles, which would have to wait for a picture of the first one alone. */
const MOST_GATHER_MS = 40;
/** One frame is drawn while the next is prepared. More would only delay what the user asks for next. */
const MOST_UNDER_WAY = 2;
/** A frame with all pixels in software: about that of 2560 x 1600 on two cores. */
const SOFTWARE_FRAME_MS = 300;
/** Longer frames do not count: a hidden page is not told when its frames are done. */
const LONGEST_FRAME_MS = 5000;

interface Frame {
  scale: number;
  begunMs: number;
  turn: number;
}

export class FramePace {
  /** The likely scale of the first frame. */
  readonly firstScale: number;
  private readonly underWay: Frame[] = [];
  /** Time of a frame with all pixels, estimated from each of the last two frames. */
  private wholeFrameMs: [number, number];
  private lastEndMs = -Infinity;
  private lastTookMs = 0;
  private hurryUntilMs = -Infinity;
  private lastTurnMs = -Infinity;
  private turnsSinceHurry = Infinity;
  private turns = 0;
  /** Turns that each of the last two frames took. */
  private turnsTaken: [number, number] = [Infinity, Infinity];
  private lastScale = 1;
  /** Until when the next frame waits for light, and for more light; undefined: it has not waited. */
  private awaitUntilMs: number | undefined;
  private gatherUntilMs: number | undefined;
  /** Since when light has come while the picture was coarse. */
  private coarseSinceMs: number | undefined;

  /** `software`: the browser draws in software, as far as it tells. */
  constructor(software: boolean) {
    const guess = software ? SOFTWARE_FRAME_MS : 0;
    this.wholeFrameMs = [guess, guess];
    this.firstScale = this.movingScale;
  }

  /** Once a turn of the page, before anything else. */
  turn(nowMs: number): void {
    if (nowMs > this.lastTurnMs) {
      ++this.turnsSinceHurry;
      ++this.turns;
    }
    this.lastTurnMs = nowMs;
  }

  /** An edit was made, and its light will follow soon. A quick card shows one after the other without waiting. */
  awaitLight(nowMs: number): void {
    if (this.movingScale < 1) this.awaitUntilMs ??= nowMs + MOST_AWAIT_MS;
  }

  /** The user moves something, which must not wait for light. */
  moved(nowMs: number): void {
    this.awaitUntilMs = this.gatherUntilMs = -Infinity;
    this.hurry(nowMs);
  }

  /** Something moves: for so long a soon picture is worth more than a sharp one. */
  hurry(nowMs: number, forMs = REST_MS): void {
    this.turnsSinceHurry = 0;
    this.hurryUntilMs = Math.max(this.hurryUntilMs, nowMs + forMs);
  }

  /**
   * Tiles were taken up. While the picture is coarse, the next ones are, too, as a sharp picture of the first tiles
   * would delay the others on a slow card. A sharp picture stays sharp, as it would flicker otherwise.
   */
  lightCame(nowMs: number): void {
    this.awaitUntilMs = -Infinity;
    if (this.movingScale < 1) this.gatherUntilMs ??= nowMs + MOST_GATHER_MS;
    if (this.lastScale === 1) return;
    this.coarseSinceMs ??= nowMs;
    const leftMs = this.coarseSinceMs + MOST_COARSE_MS - nowMs;
    if (leftMs > 0) this.hurry(nowMs, Math.min(REST_MS, leftMs));
  }

  /** No more tiles are on their way. */
  allCame(): void {
    if (this.gatherUntilMs !== undefined) this.gatherUntilMs = -Infinity;
  }

  /** Turns count as well as time, as one long turn, such as that which builds a scene, says nothing about the next. */
  private isHurried(nowMs: number): boolean {
    return nowMs < this.hurryUntilMs || this.turnsSinceHurry < REST_TURNS;
  }

  /** The last frame was coarse, and the hurry is over: a sharp frame is due. */
  isSharpDue(nowMs: number): boolean {
    return this.lastScale < 1 && !this.isHurried(nowMs);
  }

  /** The scale of a frame that may be drawn now; undefined: not yet. */
  ask(nowMs: number): number | undefined {
    if (nowMs < Math.max(this.awaitUntilMs ?? -Infinity, this.gatherUntilMs ?? -Infinity)) return undefined;
    if (this.isHurried(nowMs)) return this.underWay.length < MOST_UNDER_WAY ? this.movingScale : undefined;
    const pause = this.lastTookMs > MOVING_FRAME_MS ? Math.min(MOST_PAUSE_MS, PAUSE_SHARE * this.lastTookMs) : 0;
    return this.underWay.length > 0 || nowMs - this.lastEndMs < pause ? undefined : 1;
  }

  /** The card has drawn all frames. */
  get isIdle(): boolean {
    return this.underWay.length === 0;
  }

  /**
   * The card answers in less than a turn: it is idle, or has one frame to draw, and has drawn each of the last two
   * within a turn.
   */
  get isQuiet(): boolean {
    return this.isIdle || (this.underWay.length === 1 && this.turnsTaken.every((turns) => turns <= 1));
  }

  /** The picture is sharp, nothing is being drawn, and nothing moves. */
  isAtRest(nowMs: number): boolean {
    return this.isIdle && this.lastScale === 1 && !this.isHurried(nowMs);
  }

  /** The card was given a frame. */
  began(nowMs: number, scale: number): void {
    this.underWay.push({ scale, begunMs: nowMs, turn: this.turns });
    this.lastScale = scale;
    this.awaitUntilMs = this.gatherUntilMs = undefined;
    if (scale === 1) this.coarseSinceMs = undefined;
  }

  /**
   * The card has drawn the oldest frames. Where it has drawn several in one turn, only their total time is known, which
   * is divided by their pixels.
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

  /** The context is lost, and its frames with it. */
  forget(): void {
    this.underWay.length = 0;
    this.turnsTaken = [Infinity, Infinity];
  }

  /** The finest scale that is quick enough. One slow frame may be a hiccup (a program being compiled); two are not. */
  private get movingScale(): number {
    const wholeMs = Math.min(...this.wholeFrameMs);
    return SCALES.find((scale) => wholeMs * scale ** 2 <= MOVING_FRAME_MS) ?? SCALES.at(-1)!;
  }
}
