// The page of this folder: the lit scene, a camera to orbit with, tone mapping.
import { Box3, NeutralToneMapping, PerspectiveCamera, Sphere, Vector3, WebGLRenderer } from 'three';
import { OrbitControls } from 'three/addons/controls/OrbitControls.js';
import { loadLitScene } from './lit_scene.js';

/** The scene's first camera, or one that frames the scene, and the point to orbit about. */
function firstView({ scene, cameras }) {
  const ball = new Box3().setFromObject(scene).getBoundingSphere(new Sphere());
  const camera = new PerspectiveCamera(50, 1, ball.radius / 1000, ball.radius * 20);
  const given = cameras.find((one) => one.isPerspectiveCamera);
  if (!given) {
    camera.position.set(0.6, 0.4, 1).setLength(2.2 * ball.radius).add(ball.center); // prettier-ignore
    return { camera, target: ball.center };
  }
  given.updateWorldMatrix(true, false);
  given.matrixWorld.decompose(camera.position, camera.quaternion, new Vector3());
  camera.fov = given.fov;
  const ahead = camera.getWorldDirection(new Vector3());
  const distance = Math.max(ball.radius / 10, ahead.dot(ball.center.clone().sub(camera.position)));
  return { camera, target: ahead.multiplyScalar(distance).add(camera.position) };
}

export async function showPage() {
  const lit = await loadLitScene('./');
  const renderer = new WebGLRenderer({ antialias: true });
  renderer.toneMapping = NeutralToneMapping;
  renderer.toneMappingExposure = lit.exposure;
  renderer.setPixelRatio(devicePixelRatio);
  document.body.append(renderer.domElement);
  const { camera, target } = firstView(lit);
  const controls = new OrbitControls(camera, renderer.domElement);
  controls.target.copy(target);
  controls.update();
  const resize = () => {
    renderer.setSize(innerWidth, innerHeight);
    camera.aspect = innerWidth / innerHeight;
    camera.updateProjectionMatrix();
  };
  addEventListener('resize', resize);
  resize();
  renderer.setAnimationLoop(() => renderer.render(lit.scene, camera));
}
