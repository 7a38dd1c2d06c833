// Handles to move, turn and scale the selected object, and the lines that show which it is. The handles are in the middle
// of the object, wherever its own origin may be: many scenes have all their origins in one corner.

import {
  Box3Helper,
  type BufferGeometry,
  EdgesGeometry,
  LineBasicMaterial,
  LinearSRGBColorSpace,
  LineSegments,
  Matrix4,
  Mesh,
  MeshBasicMaterial,
  Object3D,
  type PerspectiveCamera,
  Scene,
  Vector2,
  type Vector3,
} from 'three';
import { TransformControls } from 'three/addons/controls/TransformControls.js';
import type { Handle } from '../../document/gltf';
import { LampMarker } from '../scene/lamp_marker';
import { surfaceBox } from '../scene/object_box';

export type GizmoMode = Handle;

/** Finding edges takes about a microsecond a triangle; larger objects show their box. */
const MAX_EDGE_TRIANGLES = 30_000;
/** One drag makes an object at most so many times larger or smaller, and never turns it inside out. */
const MOST_SCALE = 100;
/** The middle handle doubles the size in so many pixels to the right or upwards. */
const DOUBLING_PX = 100;

interface GizmoEvents {
  dragging(active: boolean): void;
  changed(object: Object3D, mode: GizmoMode): void;
  redraw(): void;
}

export class Gizmo {
  mode: GizmoMode = 'translate';
  private object: Object3D | undefined;
  private readonly pivot = new Object3D();
  /** From the pivot to the object, when the handles were put there. */
  private readonly fromPivot = new Matrix4();
  /** Made when something is selected for the first time: a visitor does not wait for what few will use. */
  private made: TransformControls | undefined;
  private readonly lines = new LineBasicMaterial({
    toneMapped: false,
    depthTest: false,
    transparent: true,
    opacity: 0.9,
  });
  private visible = true;
  private outline: Object3D[] = [];
  /** In pixels of the page; where it took hold, and where it is now. */
  private readonly grabbed = new Vector2();
  private readonly pointer = new Vector2();
  /** Where the object was when it was taken hold of, in its parent. */
  private readonly before = new Object3D();

  constructor(
    private readonly scene: Scene,
    private readonly camera: PerspectiveCamera,
    private readonly element: HTMLElement,
    private readonly events: GizmoEvents,
  ) {
    this.lines.color.setRGB(1, 0.66, 0.16, LinearSRGBColorSpace);
    // Handles lie where they were last drawn, which is some time ago where frames are slow: what is under the pointer
    // is decided by where they are now.
    const place = () => this.object && this.made?.getHelper().updateMatrixWorld(true);
    const locate = ({ clientX, clientY }: PointerEvent) => {
      place();
      this.pointer.set(clientX, clientY);
      if (!this.dragging) this.grabbed.copy(this.pointer);
    };
    for (const type of ['pointermove', 'pointerdown'] as const)
      element.addEventListener(type, locate, { capture: true });
    scene.add(this.pivot);
  }

  get dragging(): boolean {
    return this.made?.dragging ?? false;
  }

  /** What is held follows the pointer; after cancel() it does not, though the button is still down. */
  get moves(): boolean {
    return this.dragging && this.made?.axis !== null;
  }

  /**
   * Puts the object back to where it was taken hold of. The drag goes on without it until the pointer is let go, so that
   * what is left of it does not turn the camera. False: nothing is held.
   */
  cancel(): boolean {
    if (!this.moves || !this.object) return false;
    this.made!.axis = null;
    const { position, quaternion, scale } = this.before;
    this.object.position.copy(position);
    this.object.quaternion.copy(quaternion);
    this.object.scale.copy(scale);
    this.refresh();
    this.events.redraw();
    return true;
  }

  /** The pointer is over a handle, or holds one. */
  get busy(): boolean {
    return this.made !== undefined && (this.made.dragging || this.made.axis !== null);
  }

  /** Where the handles are, in metres. */
  get middle(): Vector3 {
    return this.pivot.position.clone();
  }

  attach(object: Object3D | undefined): void {
    this.object = object;
    this.clearOutline();
    this.placePivot();
    if (object) this.controls.attach(this.pivot);
    else this.made?.detach();
    this.showHandles();
    if (object) this.makeOutline(object);
  }

  setMode(mode: GizmoMode): void {
    this.mode = mode;
    this.made?.setMode(mode);
    this.attach(this.object);
  }

  /** The object was moved, by these handles or by someone else. */
  refresh(): void {
    if (!this.moves) this.placePivot();
    for (const line of this.outline) {
      const of = line.userData['of'] as Object3D | undefined;
      if (of) {
        of.updateWorldMatrix(true, false);
        line.matrix.copy(of.matrixWorld);
        line.matrixWorld.copy(of.matrixWorld);
      } else if (this.object) {
        (line as Box3Helper).box.copy(surfaceBox(this.object));
      }
    }
  }

  setVisible(visible: boolean): void {
    this.visible = visible;
    this.showHandles();
    for (const line of this.outline) line.visible = visible;
  }

  /** Handles that are not seen are not for the pointer either. */
  private showHandles(): void {
    if (!this.made) return;
    this.made.getHelper().visible = this.visible && this.made.object !== undefined;
    this.made.enabled = this.visible;
  }

  private get controls(): TransformControls {
    return (this.made ??= this.makeControls());
  }

  private makeControls(): TransformControls {
    const controls = new TransformControls(this.camera, this.element);
    controls.size = 0.8;
    controls.setMode(this.mode);
    this.scene.add(controls.getHelper());
    this.asOnScreen(controls);
    controls.addEventListener('change', () => this.events.redraw());
    controls.addEventListener('dragging-changed', ({ value }) => {
      if (!value) this.placePivot();
      else this.keepPlace();
      this.events.dragging(value as boolean);
    });
    controls.addEventListener('objectChange', () => {
      if (!this.object) return;
      if (this.mode === 'scale') this.limitScale();
      this.follow(this.object);
      this.refresh();
      this.events.changed(this.object, this.mode);
    });
    return controls;
  }

  /** Frames take colours as they are: grey of light that three.js computed from the screen's would be nearly black. */
  private asOnScreen(controls: TransformControls): void {
    const materials = new Set<MeshBasicMaterial>();
    controls.getHelper().traverse((part) => {
      if (part instanceof Mesh && part.material instanceof MeshBasicMaterial) materials.add(part.material);
    });
    for (const { color } of materials) color.convertLinearToSRGB();
  }

  private keepPlace(): void {
    if (!this.object) return;
    const { position, quaternion, scale } = this.object;
    this.before.position.copy(position);
    this.before.quaternion.copy(quaternion);
    this.before.scale.copy(scale);
  }

  /** Into the middle of the object, turned as it is, so that scaling along the handles does not skew it. */
  private placePivot(): void {
    const { object, pivot } = this;
    if (!object) return;
    object.updateWorldMatrix(true, true);
    const box = surfaceBox(object);
    if (box.isEmpty()) object.getWorldPosition(pivot.position);
    else box.getCenter(pivot.position);
    object.getWorldQuaternion(pivot.quaternion);
    pivot.scale.set(1, 1, 1);
    pivot.updateMatrixWorld(true);
    this.fromPivot.copy(pivot.matrixWorld).invert().multiply(object.matrixWorld);
  }

  /**
   * The controls divide by how far from the middle the pointer took hold, which for the handle in the middle is next to
   * nothing: there the way that it has gone decides.
   */
  private limitScale(): void {
    const { scale } = this.pivot;
    if (this.made?.axis === 'XYZ') {
      const { x, y } = this.pointer.clone().sub(this.grabbed);
      scale.setScalar(2 ** ((x - y) / DOUBLING_PX));
    }
    // Never nothing, nor less: a drag over the middle ends at the least. What was taken hold of in the middle has no ratio.
    for (const axis of ['x', 'y', 'z'] as const) if (Number.isNaN(scale[axis])) scale[axis] = 1;
    scale.clampScalar(1 / MOST_SCALE, MOST_SCALE);
  }

  private follow(object: Object3D): void {
    this.pivot.updateMatrixWorld(true);
    const local = object.parent ? object.parent.matrixWorld.clone().invert() : new Matrix4();
    local.multiply(this.pivot.matrixWorld).multiply(this.fromPivot);
    local.decompose(object.position, object.quaternion, object.scale);
    object.updateMatrixWorld(true);
  }

  private makeOutline(object: Object3D): void {
    let triangles = 0;
    const meshes: Mesh[] = [];
    object.traverse((child) => {
      if (!(child instanceof Mesh) || child.parent instanceof LampMarker) return;
      meshes.push(child);
      const geometry = child.geometry as BufferGeometry;
      triangles += (geometry.index?.count ?? geometry.getAttribute('position').count) / 3;
    });
    if (triangles > MAX_EDGE_TRIANGLES || meshes.length > 200) {
      this.outline = [new Box3Helper(surfaceBox(object), this.lines.color)];
    } else {
      this.outline = meshes.map((mesh) => {
        const line = new LineSegments(new EdgesGeometry(mesh.geometry as BufferGeometry, 20), this.lines);
        line.matrixAutoUpdate = false;
        line.userData['of'] = mesh;
        line.renderOrder = 10;
        return line;
      });
    }
    for (const line of this.outline) this.scene.add(line);
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
