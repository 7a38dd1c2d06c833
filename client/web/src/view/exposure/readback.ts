// Brings a small picture back from the card without waiting for it: the page looks now and then whether it is there. From a
// slow card it is fetched while that has nothing else to do, as Chromium answers in turn, after all that it was given
// meanwhile.

/** Between looks; where a card takes long, it is not asked as often. */
const LOOK_MS = 4;
const SELDOM_MS = 50;
const LONG_MS = 2000;
/** A card that has not drawn it by then is not asked for it: to fetch it would hold the page up until it has. */
const MOST_WAIT_MS = 60_000;
/** A page that always draws something gets its picture all the same. */
const MOST_QUIET_MS = 1000;

const look = (ms = LOOK_MS) => new Promise((resolve) => setTimeout(resolve, ms));

export class Readback {
  /** Pictures that are there to be fetched. */
  private waiting = 0;
  /** Raised when a context is lost: what was on its way in it never comes. */
  private context = 0;

  constructor(
    private readonly gl: WebGL2RenderingContext,
    private readonly type: number,
    private readonly width: number,
    private readonly height: number,
    private readonly isQuiet: () => boolean,
  ) {}

  /** A picture is there to be fetched: nothing else is to be drawn until it is. */
  get arrived(): boolean {
    return this.waiting > 0;
  }

  /**
   * Of the framebuffer that is bound, RGBA, into `pixels`. Ends when they are there. Rejects where the context is lost on
   * the way, and where the card has not drawn them after a minute.
   */
  async read(pixels: Uint16Array | Float32Array): Promise<void> {
    const { gl } = this;
    const { context } = this;
    const buffer = gl.createBuffer(); // Chromium warns of one that is written twice
    gl.bindBuffer(gl.PIXEL_PACK_BUFFER, buffer);
    gl.bufferData(gl.PIXEL_PACK_BUFFER, pixels.byteLength, gl.STREAM_READ);
    gl.readPixels(0, 0, this.width, this.height, gl.RGBA, this.type, 0);
    gl.bindBuffer(gl.PIXEL_PACK_BUFFER, null);
    const drawn = await this.arrival();
    if (drawn) await this.quiet();
    if (context !== this.context) throw new Error('the context is lost');
    if (!drawn) {
      gl.deleteBuffer(buffer);
      throw new Error('the card does not draw');
    }
    gl.bindBuffer(gl.PIXEL_PACK_BUFFER, buffer);
    gl.getBufferSubData(gl.PIXEL_PACK_BUFFER, 0, pixels);
    gl.bindBuffer(gl.PIXEL_PACK_BUFFER, null);
    gl.deleteBuffer(buffer);
  }

  /** With the context its buffers are gone. */
  forget(): void {
    ++this.context;
  }

  private async quiet(): Promise<void> {
    ++this.waiting;
    try {
      for (const end = performance.now() + MOST_QUIET_MS; !this.isQuiet() && performance.now() < end; ) await look();
    } finally {
      --this.waiting;
    }
  }

  /** False: it is not drawn yet. */
  private async arrival(): Promise<boolean> {
    const { gl } = this;
    const fence = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    if (!fence) throw new Error('the context is lost');
    gl.flush();
    const begin = performance.now();
    const passed = () => performance.now() - begin;
    const isDrawn = () => gl.getSyncParameter(fence, gl.SYNC_STATUS) !== gl.UNSIGNALED; // of a lost context, too
    while (!isDrawn() && passed() < MOST_WAIT_MS) await look(passed() < LONG_MS ? LOOK_MS : SELDOM_MS);
    const drawn = isDrawn();
    gl.deleteSync(fence);
    return drawn;
  }
}
