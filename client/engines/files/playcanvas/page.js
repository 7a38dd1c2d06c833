// The page of this folder: the lit scene, a camera to orbit with, tone mapping.
import { Application, BoundingBox, Color, Entity, FILLMODE_FILL_WINDOW, RESOLUTION_AUTO } from 'playcanvas';
import { TONEMAP_NEUTRAL, Vec3 } from 'playcanvas';
import { loadLitScene } from './lit_scene.js';

function boundsOf(entity) {
  const boxes = entity.findComponents('render').flatMap(({ meshInstances }) => meshInstances.map(({ aabb }) => aabb));
  const bounds = new BoundingBox(boxes[0]?.center, boxes[0]?.halfExtents);
  for (const box of boxes) bounds.add(box);
  return bounds;
}

/** Turns the camera about a point: drag to turn, wheel to come closer. */
function orbit(camera, target, canvas) {
  const offset = camera.getPosition().clone().sub(target);
  let distance = offset.length();
  let yaw = Math.atan2(offset.x, offset.z);
  let pitch = Math.asin(offset.y / distance);
  const place = () => {
    const [flat, up] = [distance * Math.cos(pitch), distance * Math.sin(pitch)];
    camera.setPosition(target.x + flat * Math.sin(yaw), target.y + up, target.z + flat * Math.cos(yaw));
    camera.lookAt(target);
  };
  canvas.addEventListener('pointermove', ({ buttons, movementX, movementY }) => {
    if (!(buttons & 1)) return;
    yaw -= movementX / 200;
    pitch = Math.min(1.5, Math.max(-1.5, pitch + movementY / 200));
    place();
  });
  canvas.addEventListener('wheel', (event) => {
    event.preventDefault();
    distance *= Math.exp(event.deltaY / 1000);
    place();
  });
  place();
}

/** The scene's first camera, or one that frames the scene. */
function addCamera(app, entity) {
  const { center, halfExtents } = boundsOf(entity);
  const radius = halfExtents.length();
  const camera = new Entity('camera');
  camera.addComponent('camera', {
    clearColor: new Color(0.02, 0.02, 0.02),
    nearClip: radius / 1000,
    farClip: 20 * radius,
    toneMapping: TONEMAP_NEUTRAL,
  });
  camera.camera.requestSceneColorMap(true); // what is seen through glass
  const given = entity.findComponent('camera');
  const target = center.clone();
  if (given) {
    camera.camera.fov = given.fov;
    camera.setPosition(given.entity.getPosition());
    const ahead = given.entity.forward.clone();
    const distance = ahead.dot(new Vec3().sub2(center, camera.getPosition()));
    target.copy(camera.getPosition()).add(ahead.mulScalar(Math.max(radius / 10, distance)));
  } else {
    camera.setPosition(new Vec3(0.6, 0.4, 1).normalize().mulScalar(2.2 * radius).add(center)); // prettier-ignore
  }
  app.root.addChild(camera);
  return { camera, target };
}

export async function showPage(canvas) {
  const app = new Application(canvas);
  app.setCanvasFillMode(FILLMODE_FILL_WINDOW);
  app.setCanvasResolution(RESOLUTION_AUTO);
  addEventListener('resize', () => app.resizeCanvas());
  app.scene.ambientLight = new Color(0, 0, 0);
  app.start();
  const { entity, exposure } = await loadLitScene(app, './');
  app.scene.exposure = exposure;
  app.root.addChild(entity);
  const { camera, target } = addCamera(app, entity);
  orbit(camera, target, canvas);
}
