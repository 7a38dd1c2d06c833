// Draws what a folder for three.js holds, by its own script. Linear, neither exposed nor mapped.
import { loadLitScene } from '/lit_scene.js';
import * as THREE from 'three';

window.draw = async (width, height) => {
  const { scene, cameras } = await loadLitScene('/');
  const camera = cameras[0];
  camera.aspect = width / height;
  camera.updateProjectionMatrix();
  const renderer = new THREE.WebGLRenderer();
  const target = new THREE.WebGLRenderTarget(width, height, { type: THREE.FloatType });
  renderer.setRenderTarget(target);
  renderer.render(scene, camera);
  const pixels = new Float32Array(4 * width * height);
  renderer.readRenderTargetPixels(target, 0, 0, width, height, pixels);
  renderer.dispose();
  return pixels;
};
