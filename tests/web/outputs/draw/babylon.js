// Draws what a folder for Babylon.js holds, by its own script. Linear, neither exposed nor mapped.
import { loadLitScene } from '/lit_scene.js';

const B = globalThis.BABYLON;

window.draw = async (width, height) => {
  const engine = new B.Engine(document.createElement('canvas'), false);
  engine.setSize(width, height);
  const scene = new B.Scene(engine);
  scene.clearColor = new B.Color4(0, 0, 0, 1);
  const processing = scene.imageProcessingConfiguration;
  processing.applyByPostProcess = true; // and there is none
  processing.skipFinalColorClamp = true;
  const { container } = await loadLitScene(scene, '/');
  scene.activeCamera = container.cameras[0];
  const target = new B.RenderTargetTexture('out', { width, height }, scene, {
    type: B.Constants.TEXTURETYPE_FLOAT,
    generateMipMaps: false,
  });
  target.activeCamera = scene.activeCamera;
  target.renderList = null; // all meshes
  scene.customRenderTargets.push(target);
  await scene.whenReadyAsync(true);
  scene.render(); // which finds out what is to be drawn
  scene.render();
  const pixels = await target.readPixels();
  engine.dispose();
  return pixels;
};
