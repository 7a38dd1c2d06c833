// Draws what a folder for three.js holds, by its own script.
import { drawFloats } from '/draw/float_target.js';
import { loadLitScene } from '/lit_scene.js';

window.draw = async (width, height) => {
  const { scene, cameras } = await loadLitScene('/');
  return drawFloats(scene, cameras[0], width, height);
};
