// Draws what a folder for PlayCanvas holds, by its own script. Linear, neither exposed nor mapped. In nits: its units
// are those of the exposure that comes with it.
import { loadLitScene } from '/lit_scene.js';
import * as pc from 'playcanvas';

window.draw = async (width, height) => {
  const app = new pc.Application(document.createElement('canvas'));
  app.scene.ambientLight = new pc.Color(0, 0, 0);
  const { entity, exposure, about } = await loadLitScene(app, '/');
  app.scene.exposure = exposure / about.exposure; // what is left are nits
  app.root.addChild(entity);
  const colorBuffer = new pc.Texture(app.graphicsDevice, {
    width,
    height,
    format: pc.PIXELFORMAT_RGBA32F,
    mipmaps: false,
    minFilter: pc.FILTER_NEAREST,
    magFilter: pc.FILTER_NEAREST,
  });
  const camera = entity.findComponent('camera');
  camera.enabled = true;
  camera.clearColor = new pc.Color(0, 0, 0, 1);
  camera.aspectRatioMode = pc.ASPECT_AUTO;
  camera.gammaCorrection = pc.GAMMA_NONE;
  camera.toneMapping = pc.TONEMAP_LINEAR;
  camera.renderTarget = new pc.RenderTarget({ colorBuffer, depth: true });
  app.start();
  await new Promise((resolve) => app.once('frameend', resolve));
  const pixels = await colorBuffer.read(0, 0, width, height, { renderTarget: camera.renderTarget, immediate: true });
  app.destroy();
  return pixels;
};
