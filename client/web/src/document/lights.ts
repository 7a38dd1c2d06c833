// The lights of nodes that are no surfaces: point, spot and directional ones, area lights, and lamps with a photometric
// web (IES). What the viewer shows of them, and where in the document it lies.

import type { Gltf, GltfAreaLight, GltfLight, Vec3 } from './gltf';

export type LightType = GltfLight['type'] | GltfAreaLight['type'] | 'ies';

/** A number that people may change. `path`: its JSON pointer. */
export interface LightField {
  label: string;
  path: string;
  value: number;
}

export interface NodeLight {
  type: LightType;
  color: Vec3;
  colorPath: string;
  /** The first is its strength. */
  fields: LightField[];
}

const WHITE: Vec3 = [1, 1, 1];

/** The light of a node, if it has one. */
export function lightOf(gltf: Gltf, node: number): NodeLight | undefined {
  const {
    KHR_lights_punctual: punctual,
    EXT_lights_area: area,
    EXT_lights_ies: ies,
  } = gltf.nodes?.[node]?.extensions ?? {};
  const { KHR_lights_punctual: lights, EXT_lights_area: areas } = gltf.extensions ?? {};
  if (punctual && lights?.lights[punctual.light])
    return punctualLight(lights.lights[punctual.light]!, `/extensions/KHR_lights_punctual/lights/${punctual.light}`);
  if (area && areas?.lights[area.light])
    return areaLight(areas.lights[area.light]!, `/extensions/EXT_lights_area/lights/${area.light}`);
  if (!ies) return undefined;
  const path = `/nodes/${node}/extensions/EXT_lights_ies`;
  const multiplier = { label: 'Multiplier', path: `${path}/multiplier`, value: ies.multiplier ?? 1 };
  return { type: 'ies', color: ies.color ?? WHITE, colorPath: `${path}/color`, fields: [multiplier] };
}

function punctualLight(light: GltfLight, path: string): NodeLight {
  const unit = light.type === 'directional' ? 'lx' : 'cd';
  const fields = [{ label: `Intensity, ${unit}`, path: `${path}/intensity`, value: light.intensity ?? 1 }];
  if (light.type !== 'directional')
    fields.push({
      label: 'Radius, m',
      path: `${path}/extras/radiosityRadius`,
      value: light.extras?.radiosityRadius ?? 0,
    });
  return { type: light.type, color: light.color ?? WHITE, colorPath: `${path}/color`, fields };
}

function areaLight(light: GltfAreaLight, path: string): NodeLight {
  const size = light.type === 'disk' ? 'Diameter, m' : 'Height, m';
  const fields = [
    { label: 'Intensity, nits', path: `${path}/intensity`, value: light.intensity ?? 1000 },
    { label: size, path: `${path}/size`, value: light.size ?? 1 },
  ];
  if (light.type === 'rect')
    fields.push({ label: 'Width / height', path: `${path}/rect/aspect`, value: light.rect?.aspect ?? 1 });
  return { type: light.type, color: light.color ?? WHITE, colorPath: `${path}/color`, fields };
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
  const type = lightOf(gltf, node)?.type;
  return !type || mesh !== undefined || children?.length ? ALL_HANDLES : (LIGHT_HANDLES[type] ?? ALL_HANDLES);
}
