// The lights of nodes that are no surfaces: point, spot and directional ones, area lights, and lamps with a photometric
// web (IES). What the viewer shows of them, and where in the document it lies.

import type { Json } from '../protocol/messages';
import { type Gltf, type GltfAreaLight, type GltfLight, largestScale, type Vec3 } from './gltf';

export type LightType = GltfLight['type'] | GltfAreaLight['type'] | 'ies';

/**
 * A number that people may change. `path`: its JSON pointer. `per`: the document's number is `value` / `per`, as for a
 * flux in lumens beside an intensity in candela, or degrees beside radians. `least` (0 without) and `most` are accepted.
 * `written`: what the document gets at `path` for its number, where others change with that.
 */
export interface LightField {
  label: string;
  path: string;
  value: number;
  per?: number;
  least?: number;
  most?: number;
  written?: (stored: number) => Json;
}

/** What a light is, without what may be changed about it. */
export interface LightLook {
  type: LightType;
  color: Vec3;
}

export interface NodeLight extends LightLook {
  colorPath: string;
  /** The first is its strength. */
  fields: LightField[];
}

/** A photometric web as the server tells it: /webs/<light>.json. Angles in degrees; candela azimuth by azimuth. */
export interface LampWeb {
  lumens: number;
  candelaMost: number;
  /** In the node's space: where `polar` is 0, and where `polar` is 90 and `azimuth` 0. */
  axis: Vec3;
  across: Vec3;
  polar: number[];
  azimuth: number[];
  candela: number[];
}

/** By index in EXT_lights_ies; those that are known. */
export type LampWebs = ReadonlyMap<number, LampWeb>;

const WHITE: Vec3 = [1, 1, 1];
const NO_WEBS: LampWebs = new Map();
const DEGREE = Math.PI / 180;
/** glTF's own: half of the angle of a cone. */
const OUTER_CONE = Math.PI / 4;
/** Degrees between the cones of a spot, which KHR_lights_punctual wants apart. */
const CONE_GAP = 0.1;

/** What extensions of a node name: by index a light that is there, and a web with what is told beside it. */
function namedBy(gltf: Gltf, node: number) {
  const {
    KHR_lights_punctual: punctual,
    EXT_lights_area: area,
    EXT_lights_ies: ies,
  } = gltf.nodes?.[node]?.extensions ?? {};
  const { KHR_lights_punctual: lights, EXT_lights_area: areas } = gltf.extensions ?? {};
  return {
    punctual: punctual && lights?.lights[punctual.light],
    punctualPath: `/extensions/KHR_lights_punctual/lights/${punctual?.light}`,
    area: area && areas?.lights[area.light],
    areaPath: `/extensions/EXT_lights_area/lights/${area?.light}`,
    ies,
  };
}

/** What the light of a node is, if it has one. O(1). */
export function lookOf(gltf: Gltf, node: number): LightLook | undefined {
  const { punctual, area, ies } = namedBy(gltf, node);
  const light = punctual ?? area;
  if (light) return { type: light.type, color: light.color ?? WHITE };
  return ies && { type: 'ies', color: ies.color ?? WHITE };
}

/** The light of a node, if it has one. A pass over all nodes where the light has an area: of many, ask lookOf(). */
export function lightOf(gltf: Gltf, node: number, webs = NO_WEBS): NodeLight | undefined {
  const { punctual, punctualPath, area, areaPath, ies } = namedBy(gltf, node);
  if (punctual) return punctualLight(punctual, punctualPath);
  if (area) return areaLight(area, areaPath, largestScale(gltf, node));
  if (!ies) return undefined;
  const path = `/nodes/${node}/extensions/EXT_lights_ies`;
  const color = ies.color ?? WHITE;
  const multiplier = { label: 'Multiplier', path: `${path}/multiplier`, value: ies.multiplier ?? 1 };
  const web = webs.get(ies.light);
  const bright = brightness(color);
  const fields = [multiplier, ...inUnits(multiplier, 'Flux, lm', (web?.lumens ?? 0) * bright)];
  return {
    type: 'ies',
    color,
    colorPath: `${path}/color`,
    fields: [...fields, ...inUnits(multiplier, 'Peak, cd', (web?.candelaMost ?? 0) * bright)],
  };
}

/** Index in EXT_lights_ies of the web that a node shines by. */
export function webOf(gltf: Gltf, node: number | undefined): number | undefined {
  const extensions = gltf.nodes?.[node ?? -1]?.extensions;
  return lookOf(gltf, node ?? -1)?.type === 'ies' ? extensions?.EXT_lights_ies?.light : undefined;
}

/** A field in another unit, which is `per` times its number; none where that is not known, or 0. */
function inUnits({ path, value }: LightField, label: string, per: number): LightField[] {
  return per > 0 ? [{ label, path, value: value * per, per }] : [];
}

function brightness([r, g, b]: Vec3): number {
  return 0.2126 * r + 0.7152 * g + 0.0722 * b;
}

/** Half of the angles of a spot's cones, radians: as KHR_lights_punctual has them, and the server takes them. */
export function conesOf({ spot = {} }: GltfLight): { inner: number; outer: number } {
  const outer = Math.min(spot.outerConeAngle ?? OUTER_CONE, Math.PI / 2);
  return { inner: Math.min(spot.innerConeAngle ?? 0, outer), outer };
}

/** Lumens for a candela: of a spot the integral of its falloff, whose root rises with the cosine between its cones. */
function lumensPerCandela(light: GltfLight): number {
  if (light.type !== 'spot') return 4 * Math.PI;
  const { inner, outer } = conesOf(light);
  return 2 * Math.PI * (1 - Math.cos(inner) + (Math.cos(inner) - Math.cos(outer)) / 3);
}

function punctualLight(light: GltfLight, path: string): NodeLight {
  const unit = light.type === 'directional' ? 'lx' : 'cd';
  const color = light.color ?? WHITE;
  const intensity = { label: `Intensity, ${unit}`, path: `${path}/intensity`, value: light.intensity ?? 1 };
  const fields: LightField[] = [intensity];
  if (light.type !== 'directional') {
    fields.push(...inUnits(intensity, 'Flux, lm', lumensPerCandela(light) * brightness(color)));
    fields.push({
      label: 'Radius, m',
      path: `${path}/extras/radiosityRadius`,
      value: light.extras?.radiosityRadius ?? 0,
      most: 1e6,
    });
  }
  if (light.type === 'spot') fields.push(...coneFields(light, `${path}/spot`));
  return { type: light.type, color, colorPath: `${path}/color`, fields };
}

/** One at a time the cones might cross on the way, so each field writes both: the other angle gives way. */
function coneFields(light: GltfLight, path: string): LightField[] {
  const { inner, outer } = conesOf(light);
  const gap = CONE_GAP * DEGREE;
  const both = (innerConeAngle: number, outerConeAngle: number) => ({ ...light.spot, innerConeAngle, outerConeAngle });
  const units = { path, per: 1 / DEGREE };
  return [
    {
      ...units,
      label: 'Edge at, °',
      value: outer / DEGREE,
      least: CONE_GAP,
      most: 90,
      written: (to) => both(Math.max(0, Math.min(inner, to - gap)), to),
    },
    {
      ...units,
      label: 'Full to, °',
      value: inner / DEGREE,
      most: 90 - CONE_GAP,
      written: (to) => both(to, Math.min(Math.max(outer, to + gap), Math.PI / 2)),
    },
  ];
}

/** Width and height of an area light in metres; of a disc both are its diameter. `scale`: the largest of its node. */
export function areaSize(light: GltfAreaLight, scale: number): [width: number, height: number] {
  const size = (light.size ?? 1) * scale;
  return [light.type === 'rect' ? size * (light.rect?.aspect ?? 1) : size, size];
}

function areaLight(light: GltfAreaLight, path: string, scale: number): NodeLight {
  const color = light.color ?? WHITE;
  const [width, height] = areaSize(light, scale);
  const area = light.type === 'rect' ? width * height : (Math.PI / 4) * width * height;
  const intensity = { label: 'Intensity, nits', path: `${path}/intensity`, value: light.intensity ?? 1000 };
  const fields: LightField[] = [
    intensity,
    ...inUnits(intensity, 'Flux, lm', Math.PI * area * brightness(color)),
    {
      label: light.type === 'disk' ? 'Diameter, m' : 'Height, m',
      path: `${path}/size`,
      value: light.size ?? 1,
      most: 1e6,
    },
  ];
  if (light.type === 'rect')
    fields.push({ label: 'Width / height', path: `${path}/rect/aspect`, value: light.rect?.aspect ?? 1, most: 1e6 });
  return { type: light.type, color, colorPath: `${path}/color`, fields };
}

export type Handle = 'translate' | 'rotate' | 'scale';

const ALL_HANDLES: readonly Handle[] = ['translate', 'rotate', 'scale'];
const LIGHT_HANDLES: Partial<Record<LightType, readonly Handle[]>> = {
  point: ['translate'],
  spot: ['translate', 'rotate'],
  directional: ['rotate'],
  ies: ['translate', 'rotate'],
};

/** The handles that change something about a node: a point light, for example, has no size and no direction. */
export function handlesOf(gltf: Gltf, node: number): readonly Handle[] {
  const { mesh, children } = gltf.nodes?.[node] ?? {};
  const type = lookOf(gltf, node)?.type;
  return !type || mesh !== undefined || children?.length ? ALL_HANDLES : (LIGHT_HANDLES[type] ?? ALL_HANDLES);
}
