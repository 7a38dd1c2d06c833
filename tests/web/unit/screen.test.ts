// How many pixels frames are drawn with; browser and card are our own.
import type { WebGLRenderer } from 'three';
import { Screen } from '../../../client/web/src/view/frames/screen';

/** Gives a canvas as many pixels as it may have, and none while the context is lost. */
class Browser {
  lost = false;
  most = 4096;
  drawingBufferWidth = 0;
  drawingBufferHeight = 0;
  resized = 0;
  private readonly renderer = {
    capabilities: { maxSamples: 4 },
    setRenderTarget: () => undefined,
    setRenderTargetFramebuffer: () => undefined,
    setDrawingBufferSize: (width: number, height: number, ratio: number) => {
      ++this.resized;
      const give = (side: number) => (this.lost ? 0 : Math.min(this.most, Math.floor(side * ratio)));
      [this.drawingBufferWidth, this.drawingBufferHeight] = [give(width), give(height)];
    },
  };
  /** OpenGL: all that it is told is of no interest here. */
  readonly gl = new Proxy(this, {
    get: (self, name) => (name in self ? self[name as keyof Browser] : () => ({})),
  }) as unknown as WebGL2RenderingContext;
  readonly screen = new Screen(this.renderer as unknown as WebGLRenderer, this.gl);

  drawn(): readonly [number, number] {
    this.screen.draw(1, () => undefined);
    return this.screen.drawn;
  }
}

describe('Screen', () => {
  it('draws with as many pixels as the canvas was given, though it asked for more', () => {
    const browser = new Browser();
    browser.most = 1000;
    browser.screen.resize(1600, 600, 1.5);
    expect(browser.drawn()).toEqual([1000, 900]);
    browser.screen.resize(1600, 600, 1.5);
    expect(browser.resized).toBe(1);
  });

  it('draws with what it asked for where its size changed while the context was lost', () => {
    const browser = new Browser();
    browser.screen.resize(800, 600, 1);
    browser.lost = true;
    browser.screen.forget();
    browser.screen.resize(640, 480, 1);
    browser.lost = false;
    expect(browser.drawn()).toEqual([640, 480]);
  });
});
