// Lights of nodes: what the viewer shows of them, and which handles they have.

import * as edits from '../../../client/web/src/document/edits';
import type { Gltf, GltfLight } from '../../../client/web/src/document/gltf';
import { applyPatch } from '../../../client/web/src/document/json_patch';
import { handlesOf, lightOf, lookOf } from '../../../client/web/src/document/lights';
import type { Json } from '../../../client/web/src/protocol/messages';
import { storedValue } from '../../../client/web/src/ui/lamp_section';

const json = (gltf: Gltf) => gltf as unknown as Json;

describe('lights', () => {
  const lamps = (): Gltf => ({
    asset: { version: '2.0' },
    nodes: [
      { extensions: { EXT_lights_area: { light: 1 } } },
      { extensions: { EXT_lights_ies: { light: 0, multiplier: 0.5, color: [1, 0.5, 0] } } },
      { extensions: { KHR_lights_punctual: { light: 0 } } },
      { extensions: { EXT_lights_area: { light: 7 } } },
    ],
    extensions: {
      KHR_lights_punctual: { lights: [{ type: 'point', intensity: 40 }] },
      EXT_lights_area: { lights: [{ type: 'disk' }, { type: 'rect', intensity: 500, size: 2, rect: { aspect: 3 } }] },
      EXT_lights_ies: { lights: [{}] },
    },
  });
  const shown = (node: number) => lightOf(lamps(), node)!.fields.map(({ label, value }) => `${label}: ${value}`);

  it('tell what may be changed about them, and where that lies', () => {
    expect(shown(0)).toEqual([
      'Intensity, nits: 500',
      `Flux, lm: ${500 * Math.PI * 12}`,
      'Height, m: 2',
      'Width / height: 3',
    ]);
    expect(shown(1)).toEqual(['Multiplier: 0.5']);
    expect(shown(2)).toEqual(['Intensity, cd: 40', `Flux, lm: ${160 * Math.PI}`, 'Radius, m: 0']);
    expect(lightOf(lamps(), 1)).toMatchObject({ type: 'ies', color: [1, 0.5, 0] });
    expect(lightOf(lamps(), 3)).toBeUndefined(); // no such light
    for (const node of [0, 1, 2]) {
      const { colorPath, fields } = lightOf(lamps(), node)!;
      expect([colorPath, ...fields.map(({ path }) => path)].every((path) => path.startsWith('/'))).toBe(true);
    }
  });

  it('get a member that they lack with the objects on the way to it', () => {
    const gltf = lamps();
    const [strength, , radius] = lightOf(gltf, 2)!.fields;
    expect(edits.setLight(gltf, strength!.path, 50)[0]).toMatchObject({ op: 'replace', value: 50 });
    applyPatch(json(gltf), edits.setLight(gltf, radius!.path, 0.1));
    expect(lightOf(gltf, 2)!.fields[2]!.value).toBe(0.1);
    expect(edits.setLight(gltf, radius!.path, 0.2)[0]).toMatchObject({ op: 'replace', value: 0.2 });
    expect(edits.describePatch(gltf, edits.setLight(gltf, radius!.path, 0.2))).toContain('light: radius');
  });

  it('look as they are whether their fields are asked for or not', () => {
    for (const node of [0, 1, 2]) {
      const { type, color } = lightOf(lamps(), node)!;
      expect(lookOf(lamps(), node)).toEqual({ type, color });
    }
    expect(lookOf(lamps(), 3)).toBeUndefined();
  });

  it('have handles for what changes something', () => {
    expect(handlesOf(lamps(), 0)).toEqual(['translate', 'rotate', 'scale']);
    expect(handlesOf(lamps(), 1)).toEqual(['translate', 'rotate']);
  });
});

describe('handles', () => {
  const lamp = (type: GltfLight['type'], more: object = {}): Gltf => ({
    asset: { version: '2.0' },
    nodes: [{ extensions: { KHR_lights_punctual: { light: 0 } }, ...more }, { mesh: 0 }, {}],
    extensions: { KHR_lights_punctual: { lights: [{ type }] } },
  });
  const all = ['translate', 'rotate', 'scale'];

  it('are offered where they change something', () => {
    expect(handlesOf(lamp('point'), 0)).toEqual(['translate']);
    expect(handlesOf(lamp('spot'), 0)).toEqual(['translate', 'rotate']);
    expect(handlesOf(lamp('directional'), 0)).toEqual(['rotate']);
    expect(handlesOf(lamp('point'), 1)).toEqual(all);
    expect(handlesOf(lamp('point'), 2)).toEqual(all);
    expect(handlesOf(lamp('area' as never), 0)).toEqual(all);
  });

  it('are all offered of a lamp with something else to it', () => {
    expect(handlesOf(lamp('point', { mesh: 0 }), 0)).toEqual(all);
    expect(handlesOf(lamp('point', { children: [1] }), 0)).toEqual(all);
  });
});

describe('the cones of a spot', () => {
  const DEGREE = Math.PI / 180;
  const spot = (inner: number, outer: number): Gltf => ({
    asset: { version: '2.0' },
    nodes: [{ extensions: { KHR_lights_punctual: { light: 0 } } }],
    extensions: {
      KHR_lights_punctual: {
        lights: [{ type: 'spot', spot: { innerConeAngle: inner * DEGREE, outerConeAngle: outer * DEGREE } }],
      },
    },
  });
  /** The spot in degrees after a number was written into the field; undefined: the field refused it. */
  const after = (gltf: Gltf, label: string, text: string) => {
    const field = lightOf(gltf, 0)!.fields.find((one) => one.label === label)!;
    const stored = storedValue(field, text);
    if (stored === undefined) return undefined;
    const patch = edits.setLight(gltf, field.path, field.written!(stored));
    expect(patch).toHaveLength(1);
    applyPatch(json(gltf), patch);
    const { innerConeAngle, outerConeAngle } = gltf.extensions!.KHR_lights_punctual!.lights[0]!.spot!;
    expect(innerConeAngle!).toBeLessThan(outerConeAngle!);
    expect(outerConeAngle!).toBeLessThanOrEqual(Math.PI / 2);
    return [innerConeAngle!, outerConeAngle!].map((angle) => Number((angle / DEGREE).toFixed(3)));
  };

  it('stay apart, whichever of them is written', () => {
    expect(after(spot(10, 40), 'Edge at, °', '60')).toEqual([10, 60]);
    expect(after(spot(10, 40), 'Full to, °', '20')).toEqual([20, 40]);
    expect(after(spot(30, 40), 'Edge at, °', '20')).toEqual([19.9, 20]);
    expect(after(spot(10, 40), 'Full to, °', '50')).toEqual([50, 50.1]);
    expect(after(spot(10, 40), 'Full to, °', '89.9')).toEqual([89.9, 90]);
    expect(after(spot(10, 40), 'Edge at, °', '0.1')).toEqual([0, 0.1]);
  });

  it('are no wider than a half space, and never shut', () => {
    expect(after(spot(10, 40), 'Edge at, °', '0')).toBeUndefined();
    expect(after(spot(10, 40), 'Edge at, °', '91')).toBeUndefined();
    expect(after(spot(10, 40), 'Full to, °', '90')).toBeUndefined();
  });
});
