import { FramePace, MOVING_FRAME_MS, SCALES } from '../../../client/web/src/view/frames/frame_pace';

/** A card for which a frame with all pixels takes so long, one after the other; asked every 16 ms, as browsers do. */
class Card {
  readonly scales: number[] = [];
  /** From the moment a frame was handed over to its end. */
  readonly latencies: number[] = [];
  private nowMs = 0;
  private queue: { begun: number; end: number }[] = [];

  constructor(
    private readonly pace: FramePace,
    private readonly wholeMs: number,
  ) {}

  /** `moving`: something moves before every frame. `tiles`: something has come that is to be drawn. */
  run(forMs: number, { moving = false, tiles = false }): void {
    for (const until = this.nowMs + forMs; this.nowMs < until; this.nowMs += 16) {
      const open = this.queue.findIndex(({ end }) => end > this.nowMs);
      const done = this.queue.splice(0, open < 0 ? this.queue.length : open);
      this.latencies.push(...done.map(({ begun }) => this.nowMs - begun));
      this.pace.ended(this.nowMs, done.length);
      this.pace.turn(this.nowMs);
      if (moving) this.pace.hurry(this.nowMs);
      if (tiles) this.pace.lightCame(this.nowMs);
      if (!moving && !tiles && !this.pace.isSharpDue(this.nowMs)) continue;
      const scale = this.pace.ask(this.nowMs);
      if (scale === undefined) continue;
      this.scales.push(scale);
      this.pace.began(this.nowMs, scale);
      const end = Math.max(this.nowMs, this.queue.at(-1)?.end ?? 0) + this.wholeMs * scale ** 2;
      this.queue.push({ begun: this.nowMs, end });
    }
  }
}

describe('the pace of frames', () => {
  it('draws all pixels of every frame on a card that can', () => {
    const card = new Card(new FramePace(false), 10);
    card.run(1000, { moving: true });
    expect(card.scales.length).toBeGreaterThan(60);
    expect(new Set(card.scales)).toEqual(new Set([1]));
  });

  it('draws fewer while something moves on one that cannot, so that frames are quick, and all once it rests', () => {
    const card = new Card(new FramePace(false), 300);
    card.run(3000, { moving: true });
    const settled = card.scales.slice(5);
    expect(settled.length).toBeGreaterThan(40);
    for (const scale of settled) expect(300 * scale ** 2).toBeLessThanOrEqual(MOVING_FRAME_MS);
    // Two are under way at most, and the clock ticks every 16 ms.
    for (const latency of card.latencies.slice(5)) expect(latency).toBeLessThan(2 * (MOVING_FRAME_MS + 16));
    const before = card.scales.length;
    card.run(2000, {});
    expect(card.scales.slice(before)).toEqual([1]);
  });

  it('is soon at rest after one long turn, as when a scene is taken up', () => {
    const pace = new FramePace(true);
    for (const now of [0, 900]) pace.turn(now);
    pace.hurry(900);
    for (const now of [916, 932, 948, 1110]) pace.turn(now);
    expect(pace.ask(1110)).toBe(1);
  });

  it('is quiet where nothing is drawn, or one frame by a card that was done with the last two by the next turn', () => {
    const pace = new FramePace(false);
    let nowMs = 0;
    const turn = (ended = 0) => (pace.turn((nowMs += 16)), pace.ended(nowMs, ended));
    const begin = () => (pace.began(nowMs, 1), pace.isQuiet);
    turn();
    expect(pace.isQuiet).toBe(true);
    expect(begin()).toBe(false); // nobody knows this card
    turn(1);
    expect(begin()).toBe(false);
    turn(1);
    expect(begin()).toBe(true);
    expect(begin()).toBe(false); // two at a time
    turn(2);
    expect(begin()).toBe(true);
    turn();
    turn(1); // that took two turns
    expect([pace.isQuiet, begin()]).toEqual([true, false]);
    pace.forget();
    expect([pace.isQuiet, begin()]).toEqual([true, false]);
  });

  it('begins coarsely where no card draws', () => {
    const pace = new FramePace(true);
    pace.hurry(0);
    expect(pace.ask(0)).toBeLessThan(0.5);
  });

  it('shows light that comes in quick succession coarsely first, for a second at most, and sharply ever after', () => {
    const card = new Card(new FramePace(true), 300);
    card.run(100, { moving: true });
    card.latencies.length = card.scales.length = 0;
    card.run(900, { tiles: true });
    expect(card.scales).not.toContain(1);
    for (const latency of card.latencies) expect(latency).toBeLessThan(2 * (MOVING_FRAME_MS + 16));
    card.run(3000, { tiles: true });
    const first = card.scales.indexOf(1);
    expect(new Set(card.scales.slice(first))).toEqual(new Set([1]));
    // Where it rests before, so does the picture.
    const resting = new Card(new FramePace(true), 300);
    resting.run(100, { tiles: true, moving: true });
    resting.run(500, {});
    expect(resting.scales.at(-1)).toBe(1);
  });

  it('takes one slow frame for a hiccup', () => {
    const pace = new FramePace(false);
    const card = new Card(pace, 10);
    card.run(200, { moving: true });
    pace.hurry(10_000);
    pace.began(10_000, 1);
    pace.ended(10_900, 1);
    pace.hurry(11_000);
    expect(pace.ask(11_000)).toBe(1);
  });

  it('does not take two frames that are told of in the same turn for a quick card', () => {
    const pace = new FramePace(true);
    for (let now = 0; now < 1000; now += 130) {
      pace.turn(now); // of a page that has other things to do
      pace.ended(now, 2);
      pace.hurry(now);
      for (const begun of [now, now + 10]) {
        const scale = pace.ask(begun);
        expect(300 * scale! ** 2).toBeLessThanOrEqual(MOVING_FRAME_MS);
        pace.began(begun, scale!);
      }
    }
  });

  it('is as sharp as before when the card is quick again', () => {
    const pace = new FramePace(false);
    new Card(pace, 4000).run(20_000, { moving: true });
    pace.forget();
    pace.hurry(30_000);
    expect(pace.ask(30_000)).toBe(SCALES.at(-1));
    let now = 30_000;
    for (let i = 0; i < 20; ++i, now += 20) {
      pace.hurry(now);
      pace.began(now, pace.ask(now)!);
      pace.ended(now + 16, 1); // however few pixels: it is told at the next tick of the clock
    }
    pace.hurry(now);
    expect(pace.ask(now)).toBe(1);
  });

  it('does not take a page that turns slowly for one that rests', () => {
    const pace = new FramePace(true);
    for (let now = 0; now < 5000; now += 600) {
      pace.turn(now);
      expect(pace.isSharpDue(now)).toBe(false);
      pace.hurry(now); // by an event between two turns
      const scale = pace.ask(now);
      expect(scale).toBeLessThan(1);
      pace.began(now, scale!);
      pace.ended(now + 100, 1);
    }
  });

  it('leaves a slow card a quarter of its time when only light changes', () => {
    const card = new Card(new FramePace(false), 320);
    card.run(10_000, { tiles: true });
    expect(new Set(card.scales)).toEqual(new Set([1]));
    expect(card.scales.length).toBeLessThan(27); // of 31
    expect(card.scales.length).toBeGreaterThan(20);
  });

  it('waits for the light of an edit where a picture without it would be in its way, and not for long', () => {
    for (const software of [true, false]) {
      const pace = new FramePace(software);
      pace.hurry(0);
      pace.awaitLight(0);
      expect(pace.ask(99) === undefined).toBe(software);
      expect(pace.ask(100)).toBeDefined();
      pace.allCame(); // of the light before
      expect(pace.ask(50) === undefined).toBe(software);
      pace.lightCame(50);
      pace.allCame();
      expect(pace.ask(50)).toBeDefined();
    }
  });

  it('shows edits in quick succession though none of them brings light, and what is moved by hand at once', () => {
    const pace = new FramePace(true);
    const drawn: number[] = [];
    for (let now = 0; now < 1000; now += 16) {
      pace.turn(now);
      pace.hurry(now);
      pace.awaitLight(now);
      const scale = pace.ask(now);
      if (scale === undefined) continue;
      drawn.push(now);
      pace.began(now, scale);
      pace.ended(now + 8, 1);
    }
    expect(drawn.length).toBeGreaterThan(7);
    pace.awaitLight(1000);
    pace.moved(1008);
    expect(pace.ask(1008)).toBeDefined();
    pace.awaitLight(1016); // that movement's own edit
    expect(pace.ask(1016)).toBeDefined();
  });

  it('puts tiles that come together into one picture, where each takes long', () => {
    const pace = new FramePace(true);
    pace.lightCame(1000);
    expect(pace.ask(1039)).toBeUndefined();
    pace.lightCame(1039); // these wait no longer than the first
    expect(pace.ask(1040)).toBe(1);
    pace.began(1040, 1);
    pace.ended(1300, 1);
    pace.lightCame(2000);
    pace.allCame();
    expect(pace.ask(2000)).toBe(1);
    const quick = new FramePace(false);
    quick.lightCame(1000);
    expect(quick.ask(1000)).toBe(1);
  });
});
