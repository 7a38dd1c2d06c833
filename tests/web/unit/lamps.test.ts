// Lamps that the viewer adds, what it shows of them in other units, and how it draws them.

import { Object3D, Vector3 } from 'three';
import { applyPatch } from '../../../client/web/src/document/json_patch';
import { undoOnServer, redoOnServer } from '../../../client/web/src/document/edits';
import { largestScale, type Gltf } from '../../../client/web/src/document/gltf';
import { lightOf, webOf, type LampWeb, type LightField } from '../../../client/web/src/document/lights';
import { addLamp, profileName, profileType, type NewLamp } from '../../../client/web/src/document/new_lamps';
import { lampLike } from '../../../client/web/src/editing/placement';
import type { Json } from '../../../client/web/src/protocol/messages';
import { WebFetch } from '../../../client/web/src/scenes/web_fetch';
import { shownValue, storedValue } from '../../../client/web/src/ui/lamp_section';
import { LampMarker } from '../../../client/web/src/view/scene/lamp_marker';
import { LampMarkers } from '../../../client/web/src/view/scene/lamp_markers';
import { outlineOf, webLines, type Lines } from '../../../client/web/src/view/scene/lamp_outline';

const json = (gltf: Gltf) => gltf as unknown as Json;
const empty = (): Gltf => ({ asset: { version: '2.0' }, scenes: [{ nodes: [] }], nodes: [] });

function withLamp(lamp: NewLamp, gltf = empty()): { gltf: Gltf; node: number } {
  const { patch, node } = addLamp(gltf, [1, 2, 3], lamp);
  applyPatch(json(gltf), patch);
  return { gltf, node };
}

const FILE = { uri: '/uploads/ab', bytes: 700, mimeType: profileType('beam.ies') };

describe('new lamps', () => {
  it.each<[string, NewLamp, object]>([
    ['point', { type: 'point', candela: 50 }, { type: 'point', intensity: 50 }],
    ['spot', lampLike('spot', 50, 2), { type: 'spot', intensity: 50, spot: { outerConeAngle: 0.7 } }],
    ['rect', { type: 'rect', nits: 900, size: 0.5 }, { type: 'rect', intensity: 900, size: 0.5, rect: { aspect: 1 } }],
    ['disk', { type: 'disk', nits: 900, size: 0.5 }, { type: 'disk', intensity: 900, size: 0.5 }],
    ['ies', { type: 'ies', name: 'beam', file: FILE }, { bufferView: 0, mimeType: 'application/x-ies-lm-63' }],
  ])('of type %s hang in the scene, and undo and redo only unhang and hang them', (type, lamp, light) => {
    const gltf = empty();
    const { patch, node } = addLamp(gltf, [1, 2, 3], lamp);
    const inverse = applyPatch(json(gltf), patch);
    expect(lightOf(gltf, node)?.type).toBe(type);
    const all = Object.values(gltf.extensions!).flatMap((extension) => (extension as { lights: object[] }).lights);
    expect(all).toEqual([expect.objectContaining({ name: gltf.nodes![node]!.name })]);
    expect(all[0]).toMatchObject(light);
    expect(gltf.extensionsUsed).toHaveLength(1);
    expect(gltf.scenes![0]!.nodes).toEqual([node]);
    const undo = undoOnServer(patch, inverse);
    applyPatch(json(gltf), undo);
    expect(gltf.scenes![0]!.nodes).toEqual([]);
    expect(gltf.nodes).toHaveLength(1); // lists of the server do not shrink
    applyPatch(json(gltf), redoOnServer(patch));
    expect(gltf.scenes![0]!.nodes).toEqual([node]);
  });

  it('share lists with those that are there, and have names of their own', () => {
    const { gltf } = withLamp({ type: 'rect', nits: 1, size: 1 });
    const { node } = withLamp({ type: 'rect', nits: 2, size: 1 }, gltf);
    expect(gltf.nodes![node]).toMatchObject({ name: 'panel 2', extensions: { EXT_lights_area: { light: 1 } } });
    withLamp({ type: 'ies', name: 'beam', file: FILE }, gltf);
    const second = withLamp({ type: 'ies', name: 'beam', file: { ...FILE, uri: '/uploads/cd' } }, gltf).node;
    expect(gltf).toMatchObject({ buffers: [{ uri: '/uploads/ab' }, { uri: '/uploads/cd' }] });
    expect(gltf).toMatchObject({ bufferViews: [{ buffer: 0 }, { buffer: 1, byteLength: 700 }] });
    expect(webOf(gltf, second)).toBe(1);
  });

  it('have names that JSON can carry', () => {
    expect(profileName('Flood 40.ies')).toBe('Flood 40');
    expect(profileName(`${'a'.repeat(59)}\u{1f4a1}\u{1f4a1}.ldt`)).toBe(`${'a'.repeat(59)}\u{1f4a1}`);
    expect(profileName('half \ud83d letter.ies')).toBe('half \ufffd letter');
  });

  it('light a wall alike, whatever their kind', () => {
    const onAxis = (lamp: NewLamp) =>
      'nits' in lamp ? lamp.nits * lamp.size ** 2 * (lamp.type === 'disk' ? Math.PI / 4 : 1) : 0;
    for (const type of ['rect', 'disk'] as const) expect(onAxis(lampLike(type, 80, 2)) / 80).toBeCloseTo(1, 1);
    expect(profileType('A.LDT')).toBe('application/x-eulumdat');
  });
});

describe('the flux of a lamp', () => {
  const flux = (gltf: Gltf, node: number) => lightOf(gltf, node)!.fields.find(({ label }) => label === 'Flux, lm')!;

  it('is the integral of its intensity', () => {
    const spot: NewLamp = { type: 'spot', candela: 100, innerConeAngle: 0.3, outerConeAngle: 0.8 };
    const { gltf, node } = withLamp(spot);
    let sum = 0;
    const steps = 20_000;
    for (let i = 0; i < steps; ++i) {
      const cosine = 1 - (i + 0.5) / steps;
      const falloff = (cosine - Math.cos(0.8)) / (Math.cos(0.3) - Math.cos(0.8));
      sum += (100 * Math.min(1, Math.max(0, falloff)) ** 2 * 2 * Math.PI) / steps;
    }
    expect(flux(gltf, node).value).toBeCloseTo(sum, 2);
  });

  it('grows with the largest scale of the node and of those above', () => {
    const { gltf, node } = withLamp({ type: 'rect', nits: 10, size: 1 });
    gltf.nodes![node]!.scale = [1, 3, 0.5];
    gltf.nodes!.push({ children: [node], scale: [2, 1, 1], rotation: [0, 0, Math.SQRT1_2, Math.SQRT1_2] });
    // A quarter turn about Z: the node's own Y, three long, lies along -X, which then counts; the parent's X is scaled.
    expect(largestScale(gltf, node)).toBeCloseTo(3, 10);
    gltf.nodes![node]!.rotation = [0, 0, Math.SQRT1_2, Math.SQRT1_2];
    expect(largestScale(gltf, node)).toBeCloseTo(6, 10);
    expect(flux(gltf, node).value).toBeCloseTo(Math.PI * 10 * 36, 6);
    gltf.nodes!.push({ children: [gltf.nodes!.length], scale: [2, 2, 2] }); // a circle ends
    expect(largestScale(gltf, gltf.nodes!.length - 1)).toBe(2);
  });

  it('is found for a hundred panels without a pass over all nodes for each', () => {
    const { gltf } = withLamp({ type: 'rect', nits: 10, size: 1 });
    let reads = 0;
    const panel = { extensions: { EXT_lights_area: { light: 0 } } };
    const counted = Object.defineProperty({ ...panel }, 'children', { get: () => void ++reads });
    gltf.nodes = Array.from({ length: 100 }, () => counted);
    gltf.scenes = [{ nodes: gltf.nodes.map((_, i) => i) }];
    const markers = new LampMarkers();
    markers.place(gltf, new Map(), new Object3D(), 10);
    expect([...markers.values()]).toHaveLength(100);
    expect(reads).toBeLessThan(500);
    markers.dispose();
  });

  it('sets the intensity, and is refused where it is no number that the lamp can have', () => {
    const { gltf, node } = withLamp({ type: 'point', candela: 10 });
    const field = flux(gltf, node);
    expect(shownValue(field)).toBe('125.66');
    expect(storedValue(field, '1000')).toBeCloseTo(1000 / (4 * Math.PI), 4);
    for (const text of ['-1', 'much', '']) expect(storedValue(field, text)).toBeUndefined();
    const angle: LightField = { label: '', path: '', value: 45, per: 180 / Math.PI, most: 90 };
    expect(storedValue(angle, '90')).toBeCloseTo(Math.PI / 2, 6);
    expect(storedValue(angle, '91')).toBeUndefined();
  });

  it('of a lamp with a web is known once the web is', () => {
    const { gltf, node } = withLamp({ type: 'ies', name: 'beam', file: FILE });
    expect(lightOf(gltf, node)!.fields).toHaveLength(1);
    const fields = lightOf(gltf, node, new Map([[0, beam()]]))!.fields;
    expect(fields.map(({ label, value }) => `${label}: ${value}`)).toEqual([
      'Multiplier: 1',
      'Flux, lm: 12',
      'Peak, cd: 500',
    ]);
    gltf.nodes![node]!.extensions!.EXT_lights_ies!.color = [0, 1, 0];
    const [, , peak] = lightOf(gltf, node, new Map([[0, beam()]]))!.fields;
    expect(peak!.value, 'of its colour, as the flux is').toBeCloseTo(0.7152 * 500, 9);
  });
});

/** Shines along -Z: 500 cd, half as much at 30 degrees, and none at 60. */
function beam(): LampWeb {
  const round = { polar: [0, 30, 60], azimuth: [0], candela: [500, 250, 0] };
  return { lumens: 12, candelaMost: 500, axis: [0, 0, -1], across: [1, 0, 0], ...round };
}

const points = (lines: Lines) =>
  Array.from({ length: lines.length / 3 }, (_, i) => lines.slice(3 * i, 3 * i + 3) as [number, number, number]);
const extent = (lines: Lines, axis: number) => Math.max(...points(lines).map((point) => Math.abs(point[axis]!)));

describe('outlines', () => {
  it('are as large as the lamps, in metres', () => {
    const { gltf, node } = withLamp({ type: 'rect', nits: 1, size: 0.5 });
    gltf.extensions!.EXT_lights_area!.lights[0]!.rect!.aspect = 4;
    gltf.nodes![node]!.scale = [1, 2, 1];
    const rectangle = outlineOf(gltf, node, 1);
    for (const [axis, half] of [2, 0.5, 0].entries()) expect(extent(rectangle, axis)).toBeCloseTo(half, 12);
    const disc = withLamp({ type: 'disk', nits: 1, size: 0.5 });
    expect(extent(outlineOf(disc.gltf, disc.node, 1), 0)).toBeCloseTo(0.25, 10);
  });

  it('of points are balls of their radius, and of spots cones', () => {
    const { gltf, node } = withLamp({ type: 'point', candela: 1 });
    expect(outlineOf(gltf, node, 1)).toEqual([]);
    gltf.extensions!.KHR_lights_punctual!.lights[0]!.extras = { radiosityRadius: 0.2 };
    for (const [x, y, z] of points(outlineOf(gltf, node, 1))) expect(Math.hypot(x, y, z)).toBeCloseTo(0.2, 10);
    const spot = withLamp({ type: 'spot', candela: 1, innerConeAngle: 0.3, outerConeAngle: 0.6 });
    const cone = outlineOf(spot.gltf, spot.node, 2);
    const ends = points(cone).filter((point) => Math.hypot(...point) > 0);
    for (const point of ends) {
      expect(Math.hypot(...point)).toBeCloseTo(2, 10);
      const angle = Math.acos(-point[2] / 2);
      expect(Math.min(Math.abs(angle - 0.3), Math.abs(angle - 0.6))).toBeLessThan(1e-6);
    }
  });

  it('of webs are as far away in each direction as the lamp shines there', () => {
    for (const point of points(webLines(beam(), 2)!)) {
      const length = Math.hypot(...point);
      if (length < 1e-9) continue;
      const polar = (Math.acos(-point[2] / length) * 180) / Math.PI;
      expect(length).toBeCloseTo(2 * (polar < 1 ? 1 : 0.5), 9);
      expect(Math.min(polar, Math.abs(polar - 30))).toBeLessThan(1e-5);
    }
    expect(webLines({ ...beam(), candelaMost: 0 }, 2)).toBeUndefined();
    // 90 degrees from the axis, in the azimuths of `across` and of `across` x `axis`: (1, 0, 0) x (0, 0, -1) = +Y.
    const aside = { polar: [90, 91], azimuth: [0, 90], candela: [500, 0, 250, 0] };
    const lines = points(webLines({ ...beam(), ...aside }, 1)!);
    expect(lines.some(([x]) => Math.abs(x - 1) < 1e-9)).toBe(true);
    expect(lines.some(([, y]) => Math.abs(y - 0.5) < 1e-9)).toBe(true);
  });
});

describe('webs', () => {
  it('lie in a mirrored node as the light does, which has no mirrored axes', () => {
    const node = new Object3D();
    node.scale.set(-2, 1, 1);
    const marker = new LampMarker(0);
    node.add(marker);
    const light = { type: 'ies' } as const;
    marker.display({ light, outline: [], web: [0, 0, 0, 1, 2, 3], selected: true }, 0.1);
    const web = marker.children.at(-1)!;
    // The server takes X, here towards -X, and Z as they are, and Z x X as the third: -Y.
    expect(web.localToWorld(new Vector3(1, 2, 3)).toArray()).toEqual([-1, -2, 3].map((v) => expect.closeTo(v, 9)));
    node.scale.set(-2, -1, 1);
    node.updateMatrixWorld(true);
    marker.display({ light, outline: [], web: [0, 0, 0, 1, 2, 3], selected: true }, 0.1);
    expect(web.localToWorld(new Vector3(1, 2, 3)).toArray()).toEqual([-1, -2, 3].map((v) => expect.closeTo(v, 9)));
  });

  it('are fetched once for each file, again a while after a failure, and forgotten with the document', async () => {
    const { gltf } = withLamp({ type: 'ies', name: 'beam', file: FILE });
    const asked: string[] = [];
    let broken = true;
    let known = -1;
    const fetch = (path: string) => {
      asked.push(path);
      return broken ? Promise.reject(new Error('gone')) : Promise.resolve(new Response(JSON.stringify(beam())));
    };
    const webs = new WebFetch({ fetch, changed: ({ size }) => (known = size) });
    await webs.want(gltf, undefined);
    await webs.want(gltf, 7);
    expect(asked).toEqual([]);
    vi.useFakeTimers({ toFake: ['Date'] });
    await webs.want(gltf, 0);
    broken = false;
    await webs.want(gltf, 0);
    expect(asked, 'not at each step of a drag').toEqual(['/webs/0.json']);
    vi.setSystemTime(Date.now() + 6000);
    await webs.want(gltf, 0);
    await webs.want(gltf, 0);
    vi.useRealTimers();
    expect(asked).toEqual(['/webs/0.json', '/webs/0.json']);
    expect(webs.webs.get(0)?.lumens).toBe(12);
    gltf.extensions!.EXT_lights_ies!.lights[0]!.bufferView = 1;
    await webs.want(gltf, 0);
    expect(asked).toHaveLength(3);
    webs.forget();
    expect(known).toBe(0);
  });
});
