// What a camera of three.js sees, as 32-bit R, G, B, A of each pixel, rows from the bottom. Linear, neither exposed nor
// mapped.
import * as THREE from 'three';

export function drawFloats(scene, camera, width, height) {
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
}
