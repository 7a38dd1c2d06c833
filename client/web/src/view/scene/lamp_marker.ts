// The sign of a light that is no surface: a small ball in its colour, with a ring. All but points also show their
// direction.

import {
  BufferGeometry,
  Float32BufferAttribute,
  Line,
  LinearSRGBColorSpace,
  LineBasicMaterial,
  LineLoop,
  Mesh,
  MeshBasicMaterial,
  Object3D,
  SphereGeometry,
} from 'three';
import type { Vec3 } from '../../document/gltf';
import type { LightType } from '../../document/lights';

const BALL = new SphereGeometry(1, 16, 12);
const RING = new BufferGeometry();
const RAY = new BufferGeometry();
{
  const circle: number[] = [];
  for (let i = 0; i < 32; ++i) circle.push(1.8 * Math.cos((i * Math.PI) / 16), 1.8 * Math.sin((i * Math.PI) / 16), 0);
  RING.setAttribute('position', new Float32BufferAttribute(circle, 3));
  RAY.setAttribute('position', new Float32BufferAttribute([0, 0, 0, 0, 0, -8], 3));
}

export class LampMarker extends Object3D {
  private readonly ball = new Mesh(BALL, new MeshBasicMaterial({ toneMapped: false }));
  private readonly line = new LineBasicMaterial({ toneMapped: false });
  private readonly ray = new Line(RAY, this.line);
  /** The light comes from far away, in the direction of the negative Z axis. */
  isSun = false;

  constructor(readonly node: number) {
    super();
    this.line.color.setRGB(0.94, 0.62, 0.12, LinearSRGBColorSpace);
    this.add(this.ball, new LineLoop(RING, this.line), this.ray);
  }

  /** `size`: radius in metres, whatever the scale of the nodes above. */
  display(light: { type: LightType; color?: Vec3 }, size: number): void {
    const [r, g, b] = light.color ?? [1, 1, 1];
    const top = Math.max(r, g, b, 1e-6);
    this.ball.material.color.setRGB(r / top, g / top, b / top, LinearSRGBColorSpace);
    this.ray.visible = light.type !== 'point';
    this.isSun = light.type === 'directional';
    const above = this.parent?.matrixWorld.getMaxScaleOnAxis() ?? 1;
    this.scale.setScalar(size / Math.max(above, 1e-9));
    this.updateMatrixWorld(true);
  }

  destroy(): void {
    this.ball.material.dispose();
    this.line.dispose();
    this.removeFromParent();
  }
}
