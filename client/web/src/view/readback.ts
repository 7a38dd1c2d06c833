// Brings a small picture back from the card without waiting for it: the page looks now and then whether it is there. It is
// fetched while the card has nothing else to do, as Chromium answers in turn, after all that it was given meanwhile.

/** Between looks. */
const LOOK_MS = 4;
/** A driver that never says it is done holds nothing up for longer, nor does a page that is not looked at. */
const MOST_WAIT_MS = 5000;
const MOST_QUIET_MS = 1000;

const look = () => new Promise((resolve) => setTimeout(resolve, LOOK_MS));

export class Readback {
  /** The picture is there to be fetched: nothing else is to be drawn until it is. */
  arrived = false;
  /** Raised when a context is lost: what was on its way in it never comes. */
  private context = 0;

  constructor(
    private readonly gl: WebGL2RenderingContext,
    private readonly type: number,
    private readonly width: number,
    private readonly height: number,
    private readonly isQuiet: () => boolean,
  ) {}

  /**
   * Of the framebuffer that is bound, RGBA, into `pixels`; one at a time. Ends when they are there; where the card has not
   * said so after five seconds, it is waited for. Rejects where the context is lost on the way.
   */
  async read(pixels: Uint16Array | Float32Array): Promise<void> {
    const { gl } = this;
    const { context } = this;
    const buffer = gl.createBuffer(); // Chromium warns of one that is written twice
    gl.bindBuffer(gl.PIXEL_PACK_BUFFER, buffer);
    gl.bufferData(gl.PIXEL_PACK_BUFFER, pixels.byteLength, gl.STREAM_READ);
    gl.readPixels(0, 0, this.width, this.height, gl.RGBA, this.type, 0);
    gl.bindBuffer(gl.PIXEL_PACK_BUFFER, null);
    await this.arrival();
    await this.quiet();
    if (context !== this.context) throw new Error('the context is lost');
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
    this.arrived = true;
    for (const end = performance.now() + MOST_QUIET_MS; !this.isQuiet() && performance.now() < end; ) await look();
    this.arrived = false;
  }

  private async arrival(): Promise<void> {
    const { gl } = this;
    const fence = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    if (!fence) throw new Error('the context is lost');
    gl.flush();
    const end = performance.now() + MOST_WAIT_MS;
    while (gl.getSyncParameter(fence, gl.SYNC_STATUS) === gl.UNSIGNALED && performance.now() < end) await look();
    gl.deleteSync(fence);
  }
}
