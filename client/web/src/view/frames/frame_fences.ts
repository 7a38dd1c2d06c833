// Tells when the card has drawn a frame, without waiting for it, by a fence behind each frame.

/** Longest wait for a driver that never reports a frame as done. */
const MOST_WAIT_MS = 3000;

export class FrameFences {
  private pending: { fence: WebGLSync; sinceMs: number }[] = [];

  constructor(private readonly gl: WebGL2RenderingContext) {}

  /** After a frame's last command. */
  put(nowMs: number): void {
    const fence = this.gl.fenceSync(this.gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    if (!fence) return; // the context is lost
    this.gl.flush();
    this.pending.push({ fence, sinceMs: nowMs });
  }

  /** Number of frames that were done since the last call. Takes some microseconds. */
  poll(nowMs: number): number {
    const { gl } = this;
    const open = this.pending.findIndex(
      ({ fence, sinceMs }) =>
        gl.getSyncParameter(fence, gl.SYNC_STATUS) === gl.UNSIGNALED && nowMs - sinceMs < MOST_WAIT_MS,
    );
    const done = this.pending.splice(0, open < 0 ? this.pending.length : open);
    for (const { fence } of done) gl.deleteSync(fence);
    return done.length;
  }

  /** The context is lost, and its fences with it. */
  forget(): void {
    this.pending = [];
  }
}
