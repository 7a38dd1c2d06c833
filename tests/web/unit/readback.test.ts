// A picture comes back from the card without anyone waiting for it; the card is one of our own.
import { Readback } from '../../../client/web/src/view/exposure/readback';

/** Signals fences when told to, and counts what it was asked for. */
class Card {
  drawn = false;
  fetched = 0;
  buffers = 0;
  readonly UNSIGNALED = 0;
  createBuffer = () => (++this.buffers, {});
  deleteBuffer = () => void --this.buffers;
  fenceSync = () => ({});
  getSyncParameter = () => (this.drawn ? 1 : this.UNSIGNALED);
  getBufferSubData = () => void ++this.fetched;
  bindBuffer = () => undefined;
  bufferData = () => undefined;
  readPixels = () => undefined;
  flush = () => undefined;
  deleteSync = () => undefined;
}

function readback(card: Card, isQuiet: () => boolean): Readback {
  return new Readback(card as unknown as WebGL2RenderingContext, 0, 1, 1, isQuiet);
}

describe('Readback', () => {
  beforeEach(() => void vi.useFakeTimers());
  afterEach(() => void vi.useRealTimers());

  it('fetches a picture once it is drawn and the card is quiet, and asks for that quiet until then', async () => {
    const card = new Card();
    let quiet = false;
    const back = readback(card, () => quiet);
    const reading = back.read(new Float32Array(4));
    await vi.advanceTimersByTimeAsync(3000);
    expect([back.arrived, card.fetched]).toEqual([false, 0]);
    card.drawn = true;
    await vi.advanceTimersByTimeAsync(60);
    expect([back.arrived, card.fetched]).toEqual([true, 0]);
    quiet = true;
    await vi.advanceTimersByTimeAsync(10);
    await reading;
    expect([back.arrived, card.fetched, card.buffers]).toEqual([false, 1, 0]);
  });

  it('asks for no quiet where it is quiet already', async () => {
    const card = new Card();
    card.drawn = true;
    const back = readback(card, () => true);
    const reading = back.read(new Float32Array(4));
    const asked: boolean[] = [];
    while (card.fetched === 0) {
      await vi.advanceTimersByTimeAsync(1);
      asked.push(back.arrived);
    }
    await reading;
    expect(asked).not.toContain(true);
  });

  it('asks for quiet until the last of two has been fetched', async () => {
    const card = new Card();
    card.drawn = true;
    const back = readback(card, () => false);
    const first = back.read(new Float32Array(4));
    await vi.advanceTimersByTimeAsync(500);
    const second = back.read(new Float32Array(4));
    await vi.advanceTimersByTimeAsync(600); // the first has waited for quiet long enough
    await first;
    expect([back.arrived, card.fetched]).toEqual([true, 1]);
    await vi.advanceTimersByTimeAsync(600);
    await second;
    expect([back.arrived, card.fetched]).toEqual([false, 2]);
  });

  it('never fetches what a card has not drawn after a minute', async () => {
    const card = new Card();
    const back = readback(card, () => true);
    const failed = expect(back.read(new Float32Array(4))).rejects.toThrow('does not draw');
    await vi.advanceTimersByTimeAsync(61_000);
    await failed;
    expect([back.arrived, card.fetched, card.buffers]).toEqual([false, 0, 0]);
  });

  it('gives up where the context is lost on the way', async () => {
    const card = new Card();
    const back = readback(card, () => true);
    const failed = expect(back.read(new Float32Array(4))).rejects.toThrow('lost');
    back.forget();
    card.drawn = true;
    await vi.advanceTimersByTimeAsync(100);
    await failed;
    expect(card.fetched).toBe(0);
  });
});
