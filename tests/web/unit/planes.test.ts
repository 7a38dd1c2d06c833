// Measuring planes: where they are in a document, edits of them, and what the panel says of what was measured.

import { Box3, Vector3 } from 'three';
import type { Gltf } from '../../../client/web/src/document/gltf';
import { describePatch } from '../../../client/web/src/document/edits';
import { applyPatch } from '../../../client/web/src/document/json_patch';
import { addPlane, planeKey, planeNodes, planeOf, setPlane, withTarget } from '../../../client/web/src/document/planes';
import { planeOver } from '../../../client/web/src/editing/placement';
import type { Json, MeasuredPlane } from '../../../client/web/src/protocol/messages';
import { figuresText, verdictText } from '../../../client/web/src/ui/planes_panel';
import { STOPS, paletteColour } from '../../../client/web/src/view/looks/palette';
import { cellText } from '../../../client/web/src/view/scene/plane_marker';

const json = (gltf: Gltf) => gltf as unknown as Json;
const room = (): Gltf => ({
  asset: { version: '2.0' },
  scenes: [{ nodes: [0, 1] }],
  nodes: [
    { name: 'floor' },
    { name: 'desk', extras: { radiosityPlane: { width: 2, depth: 1 } }, translation: [0, 0.75, 0] },
    { name: 'loose', extras: { radiosityPlane: { width: 2, depth: 1 } } },
    { name: 'odd', extras: { radiosityPlane: 7 } },
  ],
});

describe('planes of a document', () => {
  it('are those of nodes that hang in the scene', () => {
    expect(planeNodes(room())).toEqual([1]);
    expect(planeOf(room(), 1)).toEqual({ width: 2, depth: 1 });
    expect(planeOf(room(), 0)).toBeUndefined();
    expect(planeOf(room(), 3)).toBeUndefined();
  });

  it('are added at the end, under a name of their own', () => {
    const gltf = room();
    const { patch, node } = addPlane(gltf, [1, 2, 3], { width: 4, depth: 3, margin: 0.5 });
    applyPatch(json(gltf), patch);
    expect(node).toBe(4);
    expect(planeNodes(gltf)).toEqual([1, 4]);
    expect(gltf.nodes![4]).toMatchObject({ name: 'measuring plane', translation: [1, 2, 3] });
    expect(describePatch(gltf, patch)).toBe('added measuring plane');
    expect((addPlane(gltf, [0, 0, 0], { width: 1, depth: 1 }).patch[0]!.value as { name: string }).name).toBe(
      'measuring plane 2',
    );
  });

  it('change as a whole', () => {
    const gltf = room();
    applyPatch(json(gltf), setPlane(1, withTarget(planeOf(gltf, 1)!, 'lux', 500)));
    expect(planeOf(gltf, 1)).toEqual({ width: 2, depth: 1, target: { lux: 500 } });
    expect(withTarget(planeOf(gltf, 1)!, 'lux', undefined)).toEqual({ width: 2, depth: 1 });
  });

  it('have another key where they are moved or changed, and the same where something else is', () => {
    const [before, moved, sized, named] = [room(), room(), room(), room()];
    moved.nodes![1]!.translation = [0, 1, 0];
    sized.nodes![1]!.extras = { radiosityPlane: { width: 3, depth: 1 } };
    named.nodes![0]!.name = 'ground';
    expect(planeKey(moved, 1)).not.toBe(planeKey(before, 1));
    expect(planeKey(sized, 1)).not.toBe(planeKey(before, 1));
    expect(planeKey(named, 1)).toBe(planeKey(before, 1));
    const below = (x: number): Gltf => {
      const gltf = room();
      gltf.nodes![0] = { name: 'floor', children: [1], translation: [x, 0, 0] };
      return gltf;
    };
    expect(planeKey(below(1), 1)).not.toBe(planeKey(below(0), 1));
    expect(planeKey({ ...below(0), nodes: [{ children: [0] }] }, 0)).toBeDefined(); // a circle ends
  });
});

describe('a new plane', () => {
  const box = (low: [number, number, number], high: [number, number, number]) =>
    new Box3(new Vector3(...low), new Vector3(...high));
  const scene = box([0, 0, 0], [6, 3, 4]);
  const over = (...corners: Parameters<typeof box>) => planeOver(box(...corners), scene);

  it('hangs 0.75 m above a floor, without the band along walls', () => {
    expect(over([0, 0, 0], [6, 0.1, 4])).toEqual({
      place: [3, 0.85, 2],
      plane: { width: 6, depth: 4, margin: 0.5 },
    });
  });

  it('hangs as high above the bottom of a room', () => {
    expect(over([0, 0, 0], [6, 3, 4]).place).toEqual([3, 0.75, 2]);
  });

  it('stays within a small scene', () => {
    const small = box([0, 0, 0], [0.5, 0.6, 0.5]);
    expect(planeOver(small, small)).toEqual({ place: [0.25, 0.3, 0.25], plane: { width: 0.5, depth: 0.5 } });
    expect(planeOver(box([0, 0, 0], [0.5, 0, 0.5]), small).place).toEqual([0.25, 0.3, 0.25]);
  });

  it('lies on a table', () => {
    expect(over([1, 0, 1], [2, 0.7, 3])).toEqual({ place: [1.5, 0.71, 2], plane: { width: 1, depth: 2 } });
  });
});

describe('what was measured', () => {
  const plane: MeasuredPlane = {
    ...{ node: 1, name: 'desk', columns: 2, rows: 1, mean: 540.4, meanError: 1.234, minimum: 480, minimumError: 2 },
    ...{ maximum: 590, maximumError: 2, median: 540, uniformity: 0.888, uniformityError: 0.01, solveError: 0 },
  };

  it('is told in three digits', () => {
    expect(figuresText(plane, 'lx')).toBe('540 ± 1.23 lx, minimum 480, maximum 590, U0 0.89');
    expect([540.4, 54.04, 5.404].map(cellText)).toEqual(['540', '54.0', '5.40']);
  });

  it('comes with a verdict where something is asked for', () => {
    expect(verdictText(plane)).toBeUndefined();
    const asked = {
      target: { lux: 500, uniformity: 0.6 },
      verdict: { lux: 'passes', uniformity: 'undecided' } as const,
    };
    expect(verdictText({ ...plane, ...asked, verdict: { ...asked.verdict, all: 'undecided' } })).toBe(
      '500 lx: passes, U0 0.6: undecided (95 %)',
    );
  });

  it('has the colours of the palette', () => {
    expect(paletteColour(0)).toEqual([...STOPS[0]!]);
    expect(paletteColour(2)).toEqual([...STOPS.at(-1)!]);
    expect(paletteColour(0.5 / (STOPS.length - 1))[0]).toBeCloseTo((STOPS[0]![0] + STOPS[1]![0]) / 2);
  });
});
