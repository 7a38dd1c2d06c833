// The camera. The user orbits about a point or walks in the first person, by mouse, touch and keyboard.

import { Box3, Euler, MathUtils, PerspectiveCamera, Quaternion, Vector3 } from 'three';
import { OrbitControls } from 'three/addons/controls/OrbitControls.js';

export type Walk = 'orbit' | 'walk';

const WALK_KEYS: Record<string, [number, number, number]> = {
  KeyW: [0, 0, -1],
  KeyS: [0, 0, 1],
  KeyA: [-1, 0, 0],
  KeyD: [1, 0, 0],
  KeyE: [0, 1, 0],
  KeyQ: [0, -1, 0],
};

/** Space around a framed box, as a factor. */
const FRAME_MARGIN = 1.08;
/** Degrees. Wider than usual, as walls of a room are near. */
const ROOM_FOV = 65;

/** Farthest coordinate of a camera in a link; the same as for shared cameras. */
const FARTHEST_M = 1e12;
/** Part of the distance to the target that nobody sees: a tenth of a pixel of a large screen. */
const SAME_PICTURE = 3e-5;
/** Most decimals of a number. */
const MOST_DIGITS = 100;

export class CameraRig {
  readonly camera = new PerspectiveCamera(45, 1, 0.01, 1000);
  readonly orbit: OrbitControls;
  mode: Walk = 'orbit';
  private size = 1;
  private readonly down = new Set<string>();
  private readonly look = new Euler(0, 0, 0, 'YXZ');
  private active = true;
  private readonly drags = new Map<number, { x: number; y: number }>();
  /** Vertical field of view of a wide screen, degrees. Narrow screens see more above and below. */
  private fov = 45;

  constructor(
    private readonly element: HTMLElement,
    private readonly moved: () => void,
  ) {
    this.orbit = new OrbitControls(this.camera, element);
    this.orbit.enableDamping = true;
    this.orbit.dampingFactor = 0.18;
    this.orbit.zoomToCursor = true;
    this.orbit.addEventListener('change', moved);
    element.addEventListener('pointerdown', (event) => this.startDrag(event));
    element.addEventListener('pointermove', (event) => this.drag(event));
    for (const type of ['pointerup', 'pointercancel'] as const)
      element.addEventListener(type, (event) => this.drags.delete(event.pointerId));
    element.addEventListener('wheel', (event) => this.wheel(event), { passive: true });
    window.addEventListener('blur', () => this.down.clear());
  }

  get target(): Vector3 {
    return this.orbit.target;
  }

  setMode(mode: Walk): void {
    this.mode = mode;
    this.orbit.enabled = this.active && mode === 'orbit';
    if (mode === 'walk') this.look.setFromQuaternion(this.camera.quaternion);
    else this.aimAhead();
    this.moved();
  }

  /** False: nothing moves the camera, because the user drags the gizmo, or looks at pages. */
  set enabled(enabled: boolean) {
    this.active = enabled;
    this.orbit.enabled = enabled && this.mode === 'orbit';
    if (enabled) return;
    this.drags.clear();
    this.down.clear();
  }

  /** True: the key moves the camera. */
  key(event: KeyboardEvent, pressed: boolean): boolean {
    // A key may be released while Control is held. While Command is held, browsers do not report releases.
    if (!pressed) this.down.delete(event.code);
    if (event.key === 'Meta') this.down.clear();
    if (!this.active || !(event.code in WALK_KEYS) || event.ctrlKey || event.metaKey || event.altKey) return false;
    if (pressed) this.down.add(event.code);
    this.moved();
    return true;
  }

  /** Turns about the target, or looks around. Radians. */
  turn(right: number, up: number): void {
    if (!this.active) return;
    if (this.mode === 'walk') {
      this.lookBy(-right, up);
      return;
    }
    const offset = this.camera.position.clone().sub(this.target);
    const around = new Quaternion().setFromAxisAngle(new Vector3(0, 1, 0), right);
    const sideways = new Vector3(1, 0, 0).applyQuaternion(this.camera.quaternion);
    const raised = offset.clone().applyAxisAngle(sideways, -up);
    const polar = raised.angleTo(new Vector3(0, 1, 0));
    if (polar > 0.02 && polar < Math.PI - 0.02) offset.copy(raised);
    this.camera.position.copy(this.target).add(offset.applyQuaternion(around));
    this.orbit.update();
    this.moved();
  }

  /** Nearer for factors below 1. */
  zoom(factor: number): void {
    if (!this.active) return;
    if (this.mode === 'walk') return this.walk(() => this.camera.translateZ((factor - 1) * this.size * 0.3));
    this.camera.position.sub(this.target).multiplyScalar(factor).add(this.target);
    this.orbit.update();
    this.moved();
  }

  /** Continues movements. True: the camera is still moving. */
  update(seconds: number): boolean {
    const moving = this.down.size > 0;
    if (moving) {
      const step = new Vector3();
      for (const code of this.down) step.add(new Vector3(...WALK_KEYS[code]!));
      step.multiplyScalar(Math.min(seconds, 0.1) * this.size * 0.35).applyQuaternion(this.camera.quaternion);
      this.camera.position.add(step);
      this.target.add(step);
    }
    if (this.mode === 'orbit') this.orbit.update();
    this.fitPlanes();
    return moving;
  }

  /** The scene's size sets speeds and depth range. */
  setBounds(box: Box3): void {
    this.size = Math.max(box.getSize(new Vector3()).length(), 1e-6);
    // The camera keeps its distance, even if somebody has typed a position that is a million times too large.
    const distance = this.camera.position.distanceTo(this.target);
    this.orbit.minDistance = distance > 0 ? Math.min(this.size * 1e-3, distance) : this.size * 1e-3;
    this.orbit.maxDistance = Math.max(this.size * 20, distance);
  }

  /** Looks at the middle of the box from as near as possible, with all corners in the picture. */
  frame(box: Box3): void {
    const center = box.getCenter(new Vector3());
    const back = this.camera.getWorldDirection(new Vector3()).negate();
    const upright = MathUtils.degToRad(this.camera.fov) / 2;
    const sideways = MathUtils.degToRad(this.horizontalFov) / 2;
    const turned = this.camera.quaternion.clone().invert();
    let distance = this.size * 2e-3;
    for (let corner = 0; corner < 8; ++corner) {
      const at = new Vector3(...'xyz'.split('').map((axis, i) => box[corner & (1 << i) ? 'max' : 'min'][axis as 'x']));
      const { x, y, z } = at.sub(center).applyQuaternion(turned);
      distance = Math.max(distance, z + (FRAME_MARGIN * Math.abs(x)) / Math.tan(sideways));
      distance = Math.max(distance, z + (FRAME_MARGIN * Math.abs(y)) / Math.tan(upright));
    }
    this.target.copy(center);
    this.camera.position.copy(center).addScaledVector(back, distance);
    if (this.mode === 'orbit') this.orbit.update();
    this.moved();
  }

  /** Takes a camera of the scene. The target is ahead of it, as far away as the middle of the scene. */
  take(from: PerspectiveCamera, box: Box3): void {
    from.updateWorldMatrix(true, false);
    from.matrixWorld.decompose(this.camera.position, this.camera.quaternion, new Vector3());
    this.fov = from.fov;
    this.resize(this.camera.aspect);
    const ahead = this.camera.getWorldDirection(new Vector3());
    const distance = box.getCenter(new Vector3()).sub(this.camera.position).dot(ahead);
    this.aimAt(Math.max(distance, this.size * 0.05));
    this.look.setFromQuaternion(this.camera.quaternion);
    this.moved();
  }

  /** Looks from one point to another. */
  lookFrom(eye: Vector3, target: Vector3): void {
    this.camera.position.copy(eye);
    this.target.copy(target);
    this.camera.lookAt(target);
    if (this.mode === 'orbit') this.orbit.update();
    this.moved();
  }

  /** Looks around in a room. */
  stand(eye: Vector3, target: Vector3): void {
    this.fov = ROOM_FOV;
    this.resize(this.camera.aspect);
    this.lookFrom(eye, target);
  }

  /** Looks at the whole scene from in front and a little above. */
  overview(box: Box3): void {
    this.fov = 45;
    this.resize(this.camera.aspect);
    this.camera.position.copy(box.getCenter(new Vector3())).add(new Vector3(0.25, 0.2, 1));
    this.camera.lookAt(box.getCenter(new Vector3()));
    this.frame(box);
  }

  resize(aspect: number): void {
    this.camera.aspect = aspect;
    const wide = 2 * Math.atan(Math.tan(MathUtils.degToRad(this.fov) / 2) / Math.min(1, aspect));
    this.camera.fov = aspect < 1 ? Math.min(100, MathUtils.radToDeg(wide)) : this.fov;
    this.camera.updateProjectionMatrix();
  }

  /** Eye and target in metres, in as few digits as show the same picture, however far from the origin. */
  get place(): { position: number[]; target: number[] } {
    const distance = this.camera.position.distanceTo(this.target) || this.size;
    const behindPoint = (step: number) => MathUtils.clamp(Math.ceil(-Math.log10(step)), 0, MOST_DIGITS);
    // Five digits in any case, as the target may be far beyond what the user looks at.
    const digits = (v: number) => behindPoint(Math.min(distance * SAME_PICTURE, Math.abs(v) * 1e-5 || Infinity));
    const rounded = (at: Vector3) => at.toArray().map((v) => Number(v.toFixed(digits(v))));
    return { position: rounded(this.camera.position), target: rounded(this.target) };
  }

  /** Eight numbers for a link: eye, target, field of view and mode. */
  toText(): string {
    const { position, target } = this.place;
    return [...position, ...target, Number(this.fov.toPrecision(5)), this.mode === 'walk' ? 1 : 0].join(',');
  }

  fromText(text: string): boolean {
    const n = text.split(',').map(Number);
    // From farther away the user could not return: distances overflow, and framing needs a direction.
    const isNear = n.slice(0, 6).every((v) => Math.abs(v) <= FARTHEST_M);
    if (n.length !== 8 || !isNear || !Number.isFinite(n[7]) || !(n[6]! > 1 && n[6]! < 170)) return false;
    this.camera.position.set(n[0]!, n[1]!, n[2]!);
    this.target.set(n[3]!, n[4]!, n[5]!);
    this.fov = n[6]!;
    this.camera.lookAt(this.target);
    this.resize(this.camera.aspect);
    this.setMode(n[7] === 1 ? 'walk' : 'orbit');
    return true;
  }

  /** Diagonal of the scene, metres. */
  get sceneSize(): number {
    return this.size;
  }

  private get horizontalFov(): number {
    const half = MathUtils.degToRad(this.camera.fov) / 2;
    return 2 * MathUtils.radToDeg(Math.atan(Math.tan(half) * this.camera.aspect));
  }

  private aimAhead(): void {
    this.aimAt(Math.max(this.camera.position.distanceTo(this.target), this.size * 0.05));
  }

  private aimAt(distance: number): void {
    const ahead = this.camera.getWorldDirection(new Vector3());
    this.target.copy(this.camera.position).addScaledVector(ahead, distance);
    if (this.mode === 'orbit') this.orbit.update();
  }

  private fitPlanes(): void {
    const far = this.camera.position.distanceTo(this.target) + this.size * 2;
    // A camera that is a million times as far away as the scene is large still has to see the scene.
    const distance = this.camera.position.distanceTo(this.target);
    const near = Math.max(Math.min(this.size * 2e-4, distance * 0.2), far * 1e-6);
    if (Math.abs(this.camera.far / far - 1) < 0.2 && Math.abs(this.camera.near / near - 1) < 0.2) return;
    this.camera.near = near;
    this.camera.far = far;
    this.camera.updateProjectionMatrix();
  }

  private startDrag(event: PointerEvent): void {
    if (this.active && this.mode === 'walk') this.drags.set(event.pointerId, { x: event.clientX, y: event.clientY });
  }

  /** One finger or button looks around, two walk. */
  private drag(event: PointerEvent): void {
    const last = this.drags.get(event.pointerId);
    if (!last || this.mode !== 'walk') return;
    const [dx, dy] = [event.clientX - last.x, event.clientY - last.y];
    this.drags.set(event.pointerId, { x: event.clientX, y: event.clientY });
    const perPixel = MathUtils.degToRad(this.camera.fov) / this.element.clientHeight;
    if (this.drags.size === 1) return this.lookBy(dx * perPixel, dy * perPixel);
    const step = (this.size * 0.5) / this.element.clientHeight;
    this.walk(() => this.camera.translateX(-dx * step).translateZ(-dy * step));
  }

  private wheel(event: WheelEvent): void {
    if (this.mode === 'walk') this.zoom(event.deltaY > 0 ? 1.15 : 0.87);
  }

  private lookBy(yaw: number, pitch: number): void {
    this.look.setFromQuaternion(this.camera.quaternion);
    this.look.y += yaw;
    this.look.x = MathUtils.clamp(this.look.x + pitch, -1.55, 1.55);
    this.look.z = 0;
    this.walk(() => this.camera.quaternion.setFromEuler(this.look));
  }

  /** A step in the first person. The target stays as far ahead, for links and for other viewers. */
  private walk(step: () => void): void {
    const distance = this.camera.position.distanceTo(this.target);
    step();
    this.aimAt(distance);
    this.moved();
  }
}
