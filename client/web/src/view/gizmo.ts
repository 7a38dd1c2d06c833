// Handles to move, turn and scale the selected object, and the lines that show which it is.

import {
  Box3,
  Box3Helper,
  type BufferGeometry,
  EdgesGeometry,
  LineBasicMaterial,
  LinearSRGBColorSpace,
  LineSegments,
  Mesh,
  type Object3D,
  type PerspectiveCamera,
  Scene,
} from 'three';
import { TransformControls } from 'three/addons/controls/TransformControls.js';

export type GizmoMode = 'translate' | 'rotate' | 'scale' | 'off';

/** Finding edges takes about a microsecond a triangle; larger objects show their box. */
const MAX_EDGE_TRIANGLES = 30_000;

export class Gizmo {
  mode: GizmoMode = 'translate';
  private object: Object3D | undefined;
  private readonly controls: TransformControls;
  private readonly lines = new LineBasicMaterial({
    toneMapped: false,
    depthTest: false,
    transparent: true,
    opacity: 0.9,
  });
  private outline: Object3D[] = [];

  constructor(
    private readonly scene: Scene,
    camera: PerspectiveCamera,
    element: HTMLElement,
    events: { dragging(active: boolean): void; changed(object: Object3D, mode: GizmoMode): void; redraw(): void },
  ) {
    this.lines.color.setRGB(1, 0.66, 0.16, LinearSRGBColorSpace);
    this.controls = new TransformControls(camera, element);
    this.controls.size = 0.8;
    scene.add(this.controls.getHelper());
    this.controls.addEventListener('change', () => events.redraw());
    this.controls.addEventListener('dragging-changed', ({ value }) => events.dragging(value as boolean));
    this.controls.addEventListener('objectChange', () => {
      if (!this.object) return;
      this.refresh();
      events.changed(this.object, this.mode);
    });
  }

  get dragging(): boolean {
    return this.controls.dragging;
  }

  /** The pointer is over a handle, or holds one. */
  get busy(): boolean {
    return this.controls.dragging || this.controls.axis !== null;
  }

  attach(object: Object3D | undefined): void {
    this.object = object;
    this.clearOutline();
    if (object && this.mode !== 'off') this.controls.attach(object);
    else this.controls.detach();
    if (object) this.makeOutline(object);
  }

  setMode(mode: GizmoMode): void {
    this.mode = mode;
    if (mode !== 'off') this.controls.setMode(mode);
    this.attach(this.object);
  }

  /** The object was moved by someone else. */
  refresh(): void {
    for (const line of this.outline) {
      const of = line.userData['of'] as Object3D | undefined;
      if (of) {
        of.updateWorldMatrix(true, false);
        line.matrix.copy(of.matrixWorld);
        line.matrixWorld.copy(of.matrixWorld);
      } else if (this.object) {
        (line as Box3Helper).box.setFromObject(this.object);
      }
    }
  }

  setVisible(visible: boolean): void {
    this.controls.getHelper().visible = visible && this.controls.object !== undefined;
    for (const line of this.outline) line.visible = visible;
  }

  private makeOutline(object: Object3D): void {
    let triangles = 0;
    const meshes: Mesh[] = [];
    object.traverse((child) => {
      if (!(child instanceof Mesh)) return;
      meshes.push(child);
      const geometry = child.geometry as BufferGeometry;
      triangles += (geometry.index?.count ?? geometry.getAttribute('position').count) / 3;
    });
    if (triangles > MAX_EDGE_TRIANGLES || meshes.length > 200) {
      this.outline = [new Box3Helper(new Box3().setFromObject(object), this.lines.color)];
    } else {
      this.outline = meshes.map((mesh) => {
        const line = new LineSegments(new EdgesGeometry(mesh.geometry as BufferGeometry, 20), this.lines);
        line.matrixAutoUpdate = false;
        line.userData['of'] = mesh;
        line.renderOrder = 10;
        return line;
      });
    }
    this.scene.add(...this.outline);
    this.refresh();
  }

  private clearOutline(): void {
    for (const line of this.outline) {
      line.removeFromParent();
      (line as LineSegments).geometry.dispose();
    }
    this.outline = [];
  }
}
