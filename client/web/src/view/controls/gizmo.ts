// Handles that move, turn and scale the selected object, and its outline. The handles are in the middle of the object,
// as many scenes have the origins of all objects in one corner.

import {
  Box3Helper,
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
import type { Handle } from '../../document/lights';
import { surfaceBox, surfacesOf, trianglesOf } from '../scene/object_box';

export type GizmoMode = Handle;

/** Finding edges takes about a microsecond a triangle; objects with more triangles show their box. */
const MAX_EDGE_TRIANGLES = 30_000;
const MAX_EDGE_MESHES = 200;
/** Edges at which faces meet at a smaller angle are not drawn. */
const EDGE_DEGREES = 20;
/** One drag makes an object at most so many times larger or smaller, and never mirrors it. */
const MOST_SCALE = 100;
/** A drag of the middle handle by so many pixels, right or up, doubles the size. */
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
  /** From the pivot to the object, as of placePivot(). */
  private readonly fromPivot = new Matrix4();
  /** Made at the first selection, as few visitors need it and none should wait for it. */
  private made: TransformControls | undefined;
  private readonly lines = new LineBasicMaterial({
    toneMapped: false,
    depthTest: false,
    transparent: true,
    opacity: 0.9,
  });
  private visible = true;
  private outline: Object3D[] = [];
  /** The pointer in pixels of the page: at the start of the drag, and now. */
  private readonly grabbed = new Vector2();
  private readonly pointer = new Vector2();
  /** Placement of the object at the start of the drag, in its parent. */
  private readonly before = new Object3D();

  constructor(
    private readonly scene: Scene,
    private readonly camera: PerspectiveCamera,
    private readonly element: HTMLElement,
    private readonly events: GizmoEvents,
  ) {
    this.lines.color.setRGB(1, 0.66, 0.16, LinearSRGBColorSpace);
    // With slow frames the handles were last drawn some time ago; the pointer must meet them where they are now.
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

  /** The object follows the pointer; after cancel() it does not, though the button is still down. */
  get moves(): boolean {
    return this.dragging && this.made?.axis !== null;
  }

  /**
   * Puts the object back to the start of the drag. The drag itself goes on until the button is released, so that the
   * rest of it does not turn the camera. False: nothing is dragged.
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

  /** The pointer is over a handle, or drags one. */
  get busy(): boolean {
    return this.made !== undefined && (this.made.dragging || this.made.axis !== null);
  }

  /** Place of the handles, in metres. */
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

  /** These handles, or another viewer, have moved the object. */
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

  /** Invisible handles must not react to the pointer. */
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

  /** The viewer encodes no colours of helpers, so three.js's conversion of them to linear light is reversed. */
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

  /** Puts the pivot into the middle of the object, and turns it alike, so that scaling does not skew the object. */
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
   * The controls divide by the distance between pointer and middle at the start of the drag. For the middle handle that
   * is nearly 0, so the pointer's way decides instead.
   */
  private limitScale(): void {
    const { scale } = this.pivot;
    if (this.made?.axis === 'XYZ') {
      const { x, y } = this.pointer.clone().sub(this.grabbed);
      scale.setScalar(2 ** ((x - y) / DOUBLING_PX));
    }
    // A drag across the middle ends at the least scale. A drag that began in the middle has no ratio.
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
    const meshes = surfacesOf(object);
    const triangles = meshes.reduce((sum, { geometry }) => sum + trianglesOf(geometry), 0);
    if (triangles > MAX_EDGE_TRIANGLES || meshes.length > MAX_EDGE_MESHES) {
      this.outline = [new Box3Helper(surfaceBox(object), this.lines.color)];
    } else {
      this.outline = meshes.map((mesh) => {
        const line = new LineSegments(new EdgesGeometry(mesh.geometry, EDGE_DEGREES), this.lines);
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
