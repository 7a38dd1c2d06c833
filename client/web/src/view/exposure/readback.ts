// Reads a small picture back from the card without waiting for it: the page looks now and then whether the picture is
// there. It fetches the picture while the card has nothing else to do, as Chromium answers only after all that the card
// was given meanwhile.

import { pause } from '../../page/pause';

/** Time between looks; longer after a while. */
const LOOK_MS = 4;
const SELDOM_MS = 50;
const LONG_MS = 2000;
/** After so long the picture is given up: to fetch a picture that is not drawn yet would hold the page up. */
const MOST_WAIT_MS = 60_000;
/** Longest wait for a quiet card, as some pages always draw something. */
const MOST_QUIET_MS = 1000;

export class Readback {
  /** Pictures that are drawn and wait to be fetched. */
  private waiting = 0;
  /** Counts lost contexts: pictures of an earlier context never come. */
  private context = 0;

  constructor(
    private readonly gl: WebGL2RenderingContext,
    private readonly type: number,
    private readonly width: number,
    private readonly height: number,
    private readonly isQuiet: () => boolean,
  ) {}

  /** A picture waits to be fetched; until then nothing else should be drawn. */
  get arrived(): boolean {
    return this.waiting > 0;
  }

  /**
   * Reads the bound framebuffer into `pixels`, as RGBA. Rejects when the context is lost, and when the card has not
   * drawn the picture after a minute.
   */
  async read(pixels: Uint16Array | Float32Array): Promise<void> {
    const { gl } = this;
    const { context } = this;
    const buffer = gl.createBuffer(); // a new one each time, as Chromium warns of buffers that are written twice
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

  /** The context is lost, and its buffers with it. */
  forget(): void {
    ++this.context;
  }

  private async quiet(): Promise<void> {
    ++this.waiting;
    try {
      for (const end = performance.now() + MOST_QUIET_MS; !this.isQuiet() && performance.now() < end; )
        await pause(LOOK_MS);
    } finally {
      --this.waiting;
    }
  }

  /** Waits until the picture is drawn. False: it took too long. */
  private async arrival(): Promise<boolean> {
    const { gl } = this;
    const fence = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    if (!fence) throw new Error('the context is lost');
    gl.flush();
    const begin = performance.now();
    const passed = () => performance.now() - begin;
    const isDrawn = () => gl.getSyncParameter(fence, gl.SYNC_STATUS) !== gl.UNSIGNALED; // also true of a lost context
    while (!isDrawn() && passed() < MOST_WAIT_MS) await pause(passed() < LONG_MS ? LOOK_MS : SELDOM_MS);
    const drawn = isDrawn();
    gl.deleteSync(fence);
    return drawn;
  }
}
