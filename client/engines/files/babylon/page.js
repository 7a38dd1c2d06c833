// The page of this folder: the lit scene, a camera to orbit with, tone mapping.
import { loadLitScene } from './lit_scene.js';

const B = globalThis.BABYLON;

/** From the scene's first camera, or framing the scene. */
function addCamera(scene, container, canvas) {
  const { min, max } = scene.getWorldExtends();
  const centre = B.Vector3.Center(min, max);
  const radius = B.Vector3.Distance(min, max) / 2;
  const camera = new B.ArcRotateCamera('orbit', 1, 1.2, 2.2 * radius, centre, scene);
  const given = container.cameras[0];
  if (given) {
    given.computeWorldMatrix(true);
    const ahead = given.getForwardRay().direction;
    const distance = Math.max(radius / 10, B.Vector3.Dot(ahead, centre.subtract(given.globalPosition)));
    camera.target = given.globalPosition.add(ahead.scale(distance));
    camera.setPosition(given.globalPosition);
    camera.fov = given.fov;
  }
  camera.minZ = radius / 1000;
  camera.maxZ = 20 * radius;
  camera.wheelDeltaPercentage = 0.01;
  camera.attachControl(canvas, true);
  scene.activeCamera = camera;
}

export async function showPage(canvas) {
  const engine = new B.Engine(canvas, true);
  const scene = new B.Scene(engine);
  scene.clearColor = new B.Color4(0.02, 0.02, 0.02, 1);
  const { container, exposure } = await loadLitScene(scene, './');
  const processing = scene.imageProcessingConfiguration;
  processing.exposure = exposure;
  processing.toneMappingEnabled = true;
  processing.toneMappingType = B.ImageProcessingConfiguration.TONEMAPPING_KHR_PBR_NEUTRAL;
  addCamera(scene, container, canvas);
  addEventListener('resize', () => engine.resize());
  await scene.whenReadyAsync();
  engine.runRenderLoop(() => scene.render());
}
