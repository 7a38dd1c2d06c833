// The sign of a light that is no surface: a small ball in its colour, with a ring, and its outline. All but points also
// show their direction; one that is selected shows more of itself.

import {
  BufferGeometry,
  Float32BufferAttribute,
  Line,
  LinearSRGBColorSpace,
  LineBasicMaterial,
  LineLoop,
  LineSegments,
  Mesh,
  MeshBasicMaterial,
  Object3D,
  SphereGeometry,
  Vector3,
} from 'three';
import type { Vec3 } from '../../document/gltf';
import type { LightType } from '../../document/lights';
import type { Lines } from './lamp_outline';

const BALL = new SphereGeometry(1, 16, 12);
const RING = new BufferGeometry();
const RAY = new BufferGeometry();
{
  const circle: number[] = [];
  for (let i = 0; i < 32; ++i) circle.push(1.8 * Math.cos((i * Math.PI) / 16), 1.8 * Math.sin((i * Math.PI) / 16), 0);
  RING.setAttribute('position', new Float32BufferAttribute(circle, 3));
  RAY.setAttribute('position', new Float32BufferAttribute([0, 0, 0, 0, 0, -8], 3));
}

/** Of the outline of a lamp that is not selected. */
const SUBTLE = 0.3;

/** What a lamp looks like, in metres along its node's axes. */
export interface LampLook {
  light: { type: LightType; color?: Vec3 };
  outline: Lines;
  /** The photometric web of a lamp that is selected. */
  web?: Lines;
  selected: boolean;
}

export class LampMarker extends Object3D {
  private readonly ball = new Mesh(BALL, new MeshBasicMaterial({ toneMapped: false }));
  private readonly line = new LineBasicMaterial({ toneMapped: false });
  private readonly ray = new Line(RAY, this.line);
  private readonly outline = new LineSegments(
    new BufferGeometry(),
    new LineBasicMaterial({ toneMapped: false, transparent: true, depthWrite: false }),
  );
  private readonly web = new LineSegments(
    new BufferGeometry(),
    new LineBasicMaterial({ toneMapped: false, transparent: true, depthWrite: false, opacity: 0.6 }),
  );
  private shownOutline = '';
  private shownWeb: Lines | undefined;
  /** The light comes from far away, in the direction of the negative Z axis. */
  isSun = false;

  constructor(readonly node: number) {
    super();
    for (const material of [this.line, this.outline.material, this.web.material])
      material.color.setRGB(0.94, 0.62, 0.12, LinearSRGBColorSpace);
    this.web.material.color.setRGB(0.35, 0.75, 1, LinearSRGBColorSpace);
    this.add(this.ball, new LineLoop(RING, this.line), this.ray, this.outline, this.web);
  }

  /** `size`: radius of the ball in metres, whatever the scale of the nodes above. */
  display({ light, outline, web, selected }: LampLook, size: number): void {
    const [r, g, b] = light.color ?? [1, 1, 1];
    const top = Math.max(r, g, b, 1e-6);
    this.ball.material.color.setRGB(r / top, g / top, b / top, LinearSRGBColorSpace);
    this.ray.visible = light.type !== 'point';
    this.isSun = light.type === 'directional';
    this.scaleTo(size);
    this.drawOutline(outline, selected);
    this.drawWeb(web);
    for (const lines of [this.outline, this.web]) lines.scale.setScalar(1 / size); // metres
    // Mirrors do not mirror light: its axes are -Z and X of the node, and the third follows from them.
    if (this.isMirrored()) this.web.scale.y *= -1;
    this.updateMatrixWorld(true);
  }

  /** A lamp's size along each axis is its own: a node that is scaled unevenly does not bend it. */
  private scaleTo(size: number): void {
    const above = this.parent?.getWorldScale(new Vector3()) ?? new Vector3(1, 1, 1);
    const inverse = (scale: number) => size / Math.max(Math.abs(scale), 1e-9);
    this.scale.set(inverse(above.x), inverse(above.y), inverse(above.z));
  }

  /** After scaleTo(), which brings the parent's matrix up to date. */
  private isMirrored(): boolean {
    return (this.parent?.matrixWorld.determinant() ?? 1) < 0;
  }

  /** A drag makes many documents, of which few have another outline. */
  private drawOutline(lines: Lines, selected: boolean): void {
    this.outline.material.opacity = selected ? 1 : SUBTLE;
    this.outline.visible = lines.length > 0;
    const text = lines.join();
    if (text === this.shownOutline) return;
    this.shownOutline = text;
    fill(this.outline, lines);
  }

  private drawWeb(lines: Lines | undefined): void {
    this.web.visible = lines !== undefined;
    if (lines === this.shownWeb) return;
    this.shownWeb = lines;
    fill(this.web, lines ?? []);
  }

  destroy(): void {
    this.ball.material.dispose();
    this.line.dispose();
    for (const { geometry, material } of [this.outline, this.web]) {
      geometry.dispose();
      material.dispose();
    }
    this.removeFromParent();
  }
}

function fill(of: LineSegments<BufferGeometry, LineBasicMaterial>, lines: Lines): void {
  of.geometry.dispose();
  of.geometry = new BufferGeometry();
  of.geometry.setAttribute('position', new Float32BufferAttribute(lines, 3));
}
