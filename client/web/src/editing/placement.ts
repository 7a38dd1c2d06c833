// Placements as the handles of the gizmo write them. Pure functions.

import { Vector3, type Box3, type Object3D, type PerspectiveCamera } from 'three';
import type { Placement } from '../document/edits';
import type { Vec3, Vec4 } from '../document/gltf';
import type { GizmoMode } from '../view/controls/gizmo';

/** The members that the handles of a mode write. Turning and scaling about the object's middle also move its origin. */
export function written(mode: GizmoMode, { translation, rotation, scale }: Placement): Placement {
  return {
    translation: translation ?? [0, 0, 0],
    ...(mode === 'rotate' ? { rotation: rotation ?? [0, 0, 0, 1] } : {}),
    ...(mode === 'scale' ? { scale: scale ?? [1, 1, 1] } : {}),
  };
}

/** Where an object is, in a few digits. */
export function placementOf({ position, quaternion, scale }: Object3D): Placement {
  const rounded = (values: number[]) => values.map((v) => Number(v.toPrecision(7)));
  return {
    translation: rounded(position.toArray()) as Vec3,
    rotation: unit(quaternion.toArray() as Vec4),
    scale: rounded(scale.toArray()) as Vec3,
  };
}

/**
 * A lamp in front of the camera, three quarters of the way to the point that the camera looks at, and within the scene.
 * `exposure`: the factor by which the picture shows radiance. The lamp is as bright as the scene is exposed for.
 */
export function lampAhead(
  camera: PerspectiveCamera,
  target: Vector3,
  bounds: Box3,
  exposure: number,
): { place: Vec3; candela: number } {
  const eye = camera.position;
  const at = eye.clone().addScaledVector(camera.getWorldDirection(new Vector3()), 0.75 * eye.distanceTo(target));
  bounds.clampPoint(at, at);
  // A grey wall would be a middle grey at a quarter of the scene's size away from the lamp.
  const reach = bounds.getSize(new Vector3()).length() / 4;
  const candela = Number(((0.5 * Math.PI * reach * reach) / exposure).toPrecision(2));
  return { place: at.toArray().map((v) => Number(v.toPrecision(4))) as Vec3, candela };
}

/** Rounded so that the quaternion keeps unit length to the last digit that counts. */
function unit(q: Vec4): Vec4 {
  const length = Math.hypot(...q) || 1;
  return q.map((v) => Number((v / length).toPrecision(9))) as Vec4;
}
