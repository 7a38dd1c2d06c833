// Draws frames into a buffer with as many pixels as there is time for, and copies it onto the canvas, which keeps its
// size: to change the canvas's size makes browsers wait for all that the card has to draw, which takes seconds in
// software. Uses OpenGL directly, as three.js would wait for answers.

import { WebGLRenderTarget, type WebGLRenderer } from 'three';

/** Samples a pixel, as browsers give a canvas with smooth edges. */
const SAMPLES = 4;

/** A method of three.js for headsets: draws into a framebuffer that three.js does not own. */
interface TakesFramebuffers {
  setRenderTargetFramebuffer(target: WebGLRenderTarget, framebuffer: WebGLFramebuffer): void;
}

/** Buffers of one size, for the samples and for the resolved pixels. 36 bytes a pixel on the card. */
class Layer {
  readonly target: WebGLRenderTarget;
  private readonly buffers: WebGLRenderbuffer[] = [];
  private readonly drawn: WebGLFramebuffer;
  private readonly smooth: WebGLFramebuffer;

  constructor(
    renderer: WebGLRenderer,
    private readonly gl: WebGL2RenderingContext,
    readonly width: number,
    readonly height: number,
  ) {
    const samples = Math.min(SAMPLES, renderer.capabilities.maxSamples);
    renderer.setRenderTarget(null); // the state that this leaves OpenGL in
    this.drawn = gl.createFramebuffer();
    this.attach(this.drawn, gl.COLOR_ATTACHMENT0, gl.RGBA8, samples);
    this.attach(this.drawn, gl.DEPTH_ATTACHMENT, gl.DEPTH_COMPONENT24, samples);
    this.smooth = gl.createFramebuffer();
    this.attach(this.smooth, gl.COLOR_ATTACHMENT0, gl.RGBA8, 0);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    this.target = new WebGLRenderTarget(width, height);
    (renderer as unknown as TakesFramebuffers).setRenderTargetFramebuffer(this.target, this.drawn);
  }

  /** The canvas's framebuffer is bound before and after, as three.js expects. */
  bringTo(width: number, height: number): void {
    const { gl } = this;
    const size = [0, 0, this.width, this.height] as const;
    gl.bindFramebuffer(gl.READ_FRAMEBUFFER, this.drawn);
    gl.bindFramebuffer(gl.DRAW_FRAMEBUFFER, this.smooth);
    gl.blitFramebuffer(...size, ...size, gl.COLOR_BUFFER_BIT, gl.NEAREST);
    gl.invalidateFramebuffer(gl.READ_FRAMEBUFFER, [gl.COLOR_ATTACHMENT0, gl.DEPTH_ATTACHMENT]);
    gl.bindFramebuffer(gl.READ_FRAMEBUFFER, this.smooth);
    gl.bindFramebuffer(gl.DRAW_FRAMEBUFFER, null);
    const filter = width === this.width && height === this.height ? gl.NEAREST : gl.LINEAR;
    gl.blitFramebuffer(...size, 0, 0, width, height, gl.COLOR_BUFFER_BIT, filter);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
  }

  dispose(): void {
    for (const buffer of this.buffers) this.gl.deleteRenderbuffer(buffer);
    for (const framebuffer of [this.drawn, this.smooth]) this.gl.deleteFramebuffer(framebuffer);
  }

  private attach(framebuffer: WebGLFramebuffer, point: number, format: number, samples: number): void {
    const { gl } = this;
    const buffer = gl.createRenderbuffer();
    gl.bindRenderbuffer(gl.RENDERBUFFER, buffer);
    gl.renderbufferStorageMultisample(gl.RENDERBUFFER, samples, format, this.width, this.height);
    gl.bindRenderbuffer(gl.RENDERBUFFER, null);
    gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
    gl.framebufferRenderbuffer(gl.FRAMEBUFFER, point, gl.RENDERBUFFER, buffer);
    this.buffers.push(buffer);
  }
}

export class Screen {
  /** Size in pixels of the last frame. */
  drawn: readonly [number, number] = [0, 0];
  /** The wanted size, and the canvas's actual size, which is smaller where memory is scarce. */
  private asked = '';
  private size: readonly [number, number] = [1, 1];
  private whole: Layer | undefined;
  /** For frames of movement. Only one is kept, as their scale seldom changes. */
  private coarse: Layer | undefined;

  constructor(
    private readonly renderer: WebGLRenderer,
    private readonly gl: WebGL2RenderingContext,
  ) {}

  /** Size of the canvas in CSS pixels. A change clears the canvas and waits for the card. */
  resize(width: number, height: number, ratio: number): void {
    const [wide, high] = [width, height].map((side) => Math.floor(side * ratio)) as [number, number];
    if (this.asked === `${wide},${high}`) return;
    this.asked = `${wide},${high}`;
    this.renderer.setDrawingBufferSize(width, height, ratio);
    // A lost context has size 0, and returns with the wanted size.
    this.size = [this.gl.drawingBufferWidth || wide, this.gl.drawingBufferHeight || high];
    for (const layer of [this.whole, this.coarse]) layer?.dispose();
    this.whole = this.coarse = undefined;
  }

  /** Draws a frame. `scale`: of each side of the canvas. */
  draw(scale: number, render: () => void): void {
    const layer = this.layerOf(scale);
    this.renderer.setRenderTarget(layer.target);
    render();
    this.renderer.setRenderTarget(null);
    layer.bringTo(...this.size);
    this.drawn = [layer.width, layer.height];
  }

  /** The context is lost, and its layers with it. */
  forget(): void {
    this.whole = this.coarse = undefined;
  }

  private layerOf(scale: number): Layer {
    const [width, height] = this.size.map((side) => Math.max(1, Math.round(side * scale))) as [number, number];
    if (scale === 1) return (this.whole ??= new Layer(this.renderer, this.gl, width, height));
    if (this.coarse?.width !== width || this.coarse.height !== height) {
      this.coarse?.dispose();
      this.coarse = new Layer(this.renderer, this.gl, width, height);
    }
    return this.coarse;
  }
}
