// What a lamp looks like, as lines: the edge of a rectangle or disc, a ball of the radius, a spot's cones, and the
// photometric web: a surface that is as far from the lamp in each direction as the lamp shines there. Pure functions.

import { Vector3 } from 'three';
import { largestScale, type Gltf, type GltfLight, type Parents, type Vec3 } from '../../document/gltf';
import { areaSize, conesOf, type LampWeb } from '../../document/lights';

/** Ends of lines, two points each: x, y, z. */
export type Lines = number[];

const CIRCLE = 48;
/** Lines along a web from pole to pole, and around its axis. */
const MERIDIANS = 24;
const MOST_RINGS = 18;

function polyline(points: readonly Vec3[], closed = false): Lines {
  const lines: Lines = [];
  for (let i = closed ? 0 : 1; i < points.length; ++i)
    lines.push(...points[(i + points.length - 1) % points.length]!, ...points[i]!);
  return lines;
}

function circle(radius: number, at: (u: number, v: number) => Vec3): Lines {
  const points = Array.from({ length: CIRCLE }, (_, i) => {
    const angle = (2 * Math.PI * i) / CIRCLE;
    return at(radius * Math.cos(angle), radius * Math.sin(angle));
  });
  return polyline(points, true);
}

/**
 * In metres, in the node's axes. `reach`: length of what has none of its own, such as a cone. `parents`: parentsOf()
 * the document; without, each area light is a pass over all nodes.
 */
export function outlineOf(gltf: Gltf, node: number, reach: number, parents?: Parents): Lines {
  const { KHR_lights_punctual: punctual, EXT_lights_area: area } = gltf.nodes?.[node]?.extensions ?? {};
  const panel = area && gltf.extensions?.EXT_lights_area?.lights[area.light];
  if (panel) {
    const [width, height] = areaSize(panel, largestScale(gltf, node, parents));
    if (panel.type === 'disk') return circle(width / 2, (x, y) => [x, y, 0]);
    const [x, y] = [width / 2, height / 2];
    return polyline(
      [
        [-x, -y, 0],
        [x, -y, 0],
        [x, y, 0],
        [-x, y, 0],
      ],
      true,
    );
  }
  const light = punctual && gltf.extensions?.KHR_lights_punctual?.lights[punctual.light];
  return light ? punctualOutline(light, reach) : [];
}

function punctualOutline(light: GltfLight, reach: number): Lines {
  const radius = light.extras?.radiosityRadius ?? 0;
  const disc = circle(radius, (x, y) => [x, y, 0]);
  if (light.type === 'directional') return [];
  if (light.type === 'point')
    return radius > 0 ? [...disc, ...circle(radius, (x, z) => [x, 0, z]), ...circle(radius, (y, z) => [0, y, z])] : [];
  const { inner, outer } = conesOf(light);
  const [z, r] = [-reach * Math.cos(outer), reach * Math.sin(outer)];
  const edge = ([x, y]: readonly [number, number]) =>
    polyline([
      [0, 0, 0],
      [x * r, y * r, z],
    ]);
  const sides = ([[1, 0], [-1, 0], [0, 1], [0, -1]] as const).flatMap(edge); // prettier-ignore
  const full = inner > 0 ? circle(reach * Math.sin(inner), (x, y) => [x, y, -reach * Math.cos(inner)]) : [];
  return [...(radius > 0 ? disc : []), ...sides, ...circle(r, (x, y) => [x, y, z]), ...full];
}

/** Position of a web's surface; `reach`: metres, where it shines most. */
function surfacePoint(web: LampWeb, p: number, candela: number, azimuth: number, reach: number): Vec3 {
  const [axis, across] = [new Vector3(...web.axis), new Vector3(...web.across)];
  const aside = new Vector3().crossVectors(across, axis);
  const [polar, turn] = [(web.polar[p]! * Math.PI) / 180, (azimuth * Math.PI) / 180];
  return axis
    .multiplyScalar(Math.cos(polar))
    .addScaledVector(across, Math.sin(polar) * Math.cos(turn))
    .addScaledVector(aside, Math.sin(polar) * Math.sin(turn))
    .multiplyScalar((reach * candela) / web.candelaMost)
    .toArray();
}

/** The columns of a web: an azimuth, and its candela by polar angle. One alone is turned about the axis. */
function columns({ polar, azimuth, candela }: LampWeb): { azimuth: number; candela: number[] }[] {
  const all = azimuth.map((degrees, a) => ({
    azimuth: degrees,
    candela: candela.slice(a * polar.length, (a + 1) * polar.length),
  }));
  if (all.length > 1) return all;
  return Array.from({ length: MERIDIANS + 1 }, (_, i) => ({
    azimuth: (360 * i) / MERIDIANS,
    candela: all[0]?.candela ?? [],
  }));
}

/** The web's lines in metres, in the node's axes. Undefined where the lamp is dark. */
export function webLines(web: LampWeb, reach: number): Lines | undefined {
  if (!(web.candelaMost > 0)) return undefined;
  const all = columns(web);
  const point = ({ azimuth, candela }: (typeof all)[number], p: number) =>
    surfacePoint(web, p, candela[p] ?? 0, azimuth, reach);
  const step = Math.max(1, Math.round((all.length - 1) / MERIDIANS));
  const meridians = all.filter((_, i) => i % step === 0 || i === all.length - 1);
  const rise = Math.max(1, Math.ceil((web.polar.length - 1) / MOST_RINGS));
  const rings = web.polar.map((_, p) => p).filter((p) => p % rise === 0 || p === web.polar.length - 1);
  return [
    ...meridians.flatMap((column) => polyline(web.polar.map((_, p) => point(column, p)))),
    ...rings.flatMap((p) => polyline(all.map((column) => point(column, p)))),
  ];
}
