// Placements as the handles of the gizmo write them. Pure functions.

import { Vector3, type Box3, type Object3D, type PerspectiveCamera } from 'three';
import type { Placement } from '../document/edits';
import type { Vec3, Vec4 } from '../document/gltf';
import type { NewLamp } from '../document/new_lamps';
import type { PlaneSpec } from '../document/planes';
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

/** Area lights, as a part of the distance at which they are to light a wall; their steepest edge of spots. */
const PANEL = 0.3;
const SPOT = { innerConeAngle: 0.35, outerConeAngle: 0.7 };

/** A lamp of this kind that lights a wall as brightly as one of `candela` does. `reach`: from there, metres. */
export function lampLike(type: Exclude<NewLamp['type'], 'ies'>, candela: number, reach: number): NewLamp {
  if (type === 'point') return { type, candela };
  if (type === 'spot') return { type, candela, ...SPOT };
  const size = Number((PANEL * reach).toPrecision(2));
  const area = type === 'rect' ? size * size : (Math.PI / 4) * size * size;
  return { type, nits: Number((candela / area).toPrecision(2)), size };
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
): { place: Vec3; candela: number; reach: number } {
  const eye = camera.position;
  const at = eye.clone().addScaledVector(camera.getWorldDirection(new Vector3()), 0.75 * eye.distanceTo(target));
  bounds.clampPoint(at, at);
  // A grey wall would be a middle grey at a quarter of the scene's size away from the lamp.
  const reach = bounds.getSize(new Vector3()).length() / 4;
  const candela = Number(((0.5 * Math.PI * reach * reach) / exposure).toPrecision(2));
  return { place: at.toArray().map((v) => Number(v.toPrecision(4))) as Vec3, candela, reach };
}

/** Metres: of a working plane above the floor, of the band along walls that is left out, and of what is no room. */
const WORKING_HEIGHT = 0.75;
const BAND = 0.5;
const LEAST_ROOM = 3;
/** A flat object is a floor, and one as high as this is a room; what lies between is a table. */
const FLAT = 0.2;
const HIGH = 1.5;

/**
 * A measuring plane over a floor, within a room, or on a table: all of its box. `scene`: its box; a plane is no higher
 * than half of what is above the floor there.
 */
export function planeOver(box: Box3, scene: Box3): { place: Vec3; plane: PlaneSpec } {
  const [size, middle] = [box.getSize(new Vector3()), box.getCenter(new Vector3())];
  const isRoom = size.y >= HIGH || box.equals(scene);
  const isTable = !isRoom && size.y > FLAT;
  const floor = isRoom ? box.min.y : box.max.y;
  const room = scene.max.y - floor;
  const height = isTable ? box.max.y + 0.01 : floor + (room > 0 ? Math.min(WORKING_HEIGHT, room / 2) : WORKING_HEIGHT);
  const rounded = (v: number) => Number(v.toPrecision(4));
  const [width, depth] = [Math.max(rounded(size.x), 0.1), Math.max(rounded(size.z), 0.1)];
  const margin = !isTable && Math.min(width, depth) >= LEAST_ROOM ? { margin: BAND } : {};
  return { place: [rounded(middle.x), rounded(height), rounded(middle.z)], plane: { width, depth, ...margin } };
}

/** Rounded so that the quaternion keeps unit length to the last digit that counts. */
function unit(q: Vec4): Vec4 {
  const length = Math.hypot(...q) || 1;
  return q.map((v) => Number((v / length).toPrecision(9))) as Vec4;
}
