// Shows where other viewers look from: a small pyramid for each, with a name beside it. The places come a few times a
// second, and the pyramids move smoothly between them. Main thread.

import {
  BufferGeometry,
  Color,
  Float32BufferAttribute,
  Group,
  LinearSRGBColorSpace,
  LineBasicMaterial,
  LineSegments,
  Mesh,
  MeshBasicMaterial,
  Object3D,
  Vector3,
  type PerspectiveCamera,
} from 'three';
import type { SharedCamera } from '../../protocol/messages';
import { shownName } from '../../protocol/page_name';
import { button, h } from '../../page/dom';

/** In this time, seconds, the rest of the way shrinks to 1/e. */
const EASE_S = 0.12;
/** Greatest length of a pyramid as a part of its distance, so that a near one hides no more of the picture. */
const MOST_OF_DISTANCE = 0.12;
/** Degrees between the hues of two viewers: steps of the golden angle keep any number of hues apart. */
const HUE_STEP = 137.508;

// The eye is at the origin, and the corners of the picture are ahead: +Z, as lookAt() turns objects that are no camera.
const CORNERS = [
  [-0.6, -0.4, 1],
  [0.6, -0.4, 1],
  [0.6, 0.4, 1],
  [-0.6, 0.4, 1],
] as const;
const SIDES = new BufferGeometry();
const EDGES = new BufferGeometry();
{
  const sides: number[] = [];
  const edges: number[] = [];
  CORNERS.forEach((corner, i) => {
    const next = CORNERS[(i + 1) % 4]!;
    sides.push(0, 0, 0, ...corner, ...next);
    edges.push(0, 0, 0, ...corner, ...corner, ...next);
  });
  SIDES.setAttribute('position', new Float32BufferAttribute(sides, 3));
  EDGES.setAttribute('position', new Float32BufferAttribute(edges, 3));
}

class Person extends Object3D {
  readonly label: HTMLButtonElement;
  private readonly eye = new Vector3();
  private readonly aim = new Vector3();
  private readonly shownAim = new Vector3();
  private readonly side: MeshBasicMaterial;
  private readonly edge: LineBasicMaterial;
  /** Length of the pyramid from afar, metres. */
  length = 0;
  private placed = false;

  constructor(camera: SharedCamera, visit: (eye: Vector3, target: Vector3) => void) {
    super();
    const hue = Math.round((camera.viewer * HUE_STEP) % 360);
    // The viewer encodes no colours of helpers: the numbers are the screen's, as those of the label.
    const color = new Color().setHSL(hue / 360, 0.85, 0.6, LinearSRGBColorSpace);
    this.side = new MeshBasicMaterial({ color, transparent: true, opacity: 0.35, side: 2, depthWrite: false });
    this.edge = new LineBasicMaterial({ color });
    this.add(new Mesh(SIDES, this.side), new LineSegments(EDGES, this.edge));
    const name = shownName(camera.name) || 'Someone';
    this.label = button(name, () => visit(this.eye, this.aim), {
      class: 'person',
      title: `Look from where ${name} looks`,
    });
    this.label.style.setProperty('--hue', String(hue));
  }

  moveTo(camera: SharedCamera): void {
    this.eye.set(...camera.position);
    this.aim.set(...camera.target);
    if (this.placed) return;
    this.placed = true;
    this.position.copy(this.eye);
    this.shownAim.copy(this.aim);
  }

  /** True: still on its way. `size`: length of the pyramid in metres, unless it is close to `from`. */
  step(seconds: number, size: number, from: Vector3): boolean {
    const part = 1 - Math.exp(-seconds / EASE_S);
    const left = Math.max(this.position.distanceTo(this.eye), this.shownAim.distanceTo(this.aim));
    const near = left < 1e-3 * size;
    this.position.lerp(this.eye, near ? 1 : part);
    this.shownAim.lerp(this.aim, near ? 1 : part);
    this.length = size;
    this.scale.setScalar(Math.min(size, MOST_OF_DISTANCE * this.position.distanceTo(from)));
    if (this.position.distanceToSquared(this.shownAim) > 0) this.lookAt(this.shownAim);
    return left > 0;
  }

  destroy(): void {
    this.side.dispose();
    this.edge.dispose();
    this.removeFromParent();
    this.label.remove();
  }
}

export class People {
  /** To be added to the drawn scene; no part of its light. */
  readonly root = new Group();
  /** The names, to be laid over the picture. */
  readonly labels = h('div', { class: 'labels' });
  private readonly people = new Map<number, Person>();
  private readonly projected = new Vector3();

  constructor(private readonly visit: (eye: Vector3, target: Vector3) => void) {}

  show(cameras: readonly SharedCamera[]): void {
    const there = new Set(cameras.map((camera) => camera.viewer));
    for (const [viewer, person] of this.people) {
      if (there.has(viewer)) continue;
      person.destroy();
      this.people.delete(viewer);
    }
    for (const camera of cameras) {
      let person = this.people.get(camera.viewer);
      if (!person) {
        person = new Person(camera, this.visit);
        this.people.set(camera.viewer, person);
        this.root.add(person);
        this.labels.append(person.label);
      }
      person.moveTo(camera);
    }
  }

  /** True: some pyramids are still on their way. */
  step(seconds: number, size: number, from: Vector3): boolean {
    let moving = false;
    for (const person of this.people.values()) moving = person.step(seconds, size, from) || moving;
    return moving;
  }

  /** Hides pyramids around the camera, which would only be in the way. */
  leaveOut(camera: PerspectiveCamera): void {
    for (const person of this.people.values())
      person.visible = person.position.distanceTo(camera.position) > 1.3 * person.length;
  }

  /** Puts the names at the eyes, except for viewers behind or beside the picture. */
  placeLabels(camera: PerspectiveCamera, width: number, height: number): void {
    for (const person of this.people.values()) {
      const { x, y, z } = this.projected.copy(person.position).project(camera);
      const seen = person.visible && z < 1 && Math.abs(x) < 1 && Math.abs(y) < 1;
      person.label.hidden = !seen;
      if (!seen) continue;
      const [left, top] = [((x + 1) / 2) * width, ((1 - y) / 2) * height];
      person.label.style.transform = `translate(${Math.round(left)}px, ${Math.round(top)}px) translate(-50%, -160%)`;
    }
  }
}
