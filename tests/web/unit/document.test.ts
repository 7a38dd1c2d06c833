import { existsSync, readFileSync } from 'node:fs';
import * as edits from '../../../client/web/src/document/edits';
import { addLamp } from '../../../client/web/src/document/new_lamps';
import { hangingNodes, isSameScene, type Gltf } from '../../../client/web/src/document/gltf';
import { applyPatch, sameJson, withoutNames } from '../../../client/web/src/document/json_patch';
import { SceneDocument } from '../../../client/web/src/document/scene_document';
import type { Json, Patch, ScenePatchReply } from '../../../client/web/src/protocol/messages';
import { RpcError } from '../../../client/web/src/protocol/rpc';

function room(): Gltf {
  return {
    asset: { version: '2.0' },
    scene: 0,
    scenes: [{ nodes: [0, 1] }],
    nodes: [
      {
        name: 'floor',
        mesh: 0,
        translation: [0, 0, 0],
        rotation: [0, 0, 0, 1],
        scale: [1, 1, 1],
      },
      {
        name: 'box',
        mesh: 0,
        translation: [1, 0, 0],
        rotation: [0, 0, 0, 1],
        scale: [1, 1, 1],
      },
    ],
    materials: [
      {
        name: 'white',
        emissiveFactor: [0, 0, 0],
        pbrMetallicRoughness: { baseColorFactor: [1, 1, 1, 1] },
      },
    ],
    meshes: [{ primitives: [{ material: 0 }] }],
  };
}

const json = (gltf: Gltf) => gltf as unknown as Json;

describe('JSON Patch', () => {
  const suite = new URL('../../../../shared/suites/json-patch-tests/', import.meta.url);
  const files = ['tests.json', 'spec_tests.json'].map((name) => new URL(name, suite)).filter((url) => existsSync(url));

  it.skipIf(files.length === 0)(
    'does what the suite of others expects, and undoes it (skipped without ../shared)',
    () => {
      interface Case {
        comment?: string;
        doc: Json;
        patch: Patch;
        expected?: Json;
        error?: string;
        disabled?: boolean;
      }
      let run = 0;
      for (const file of files)
        for (const { comment, doc, patch, expected, error, disabled } of JSON.parse(
          readFileSync(file, 'utf8'),
        ) as Case[]) {
          // The scene is an object that is never replaced as a whole; the rest of the suite is about just that.
          if (disabled || patch.some((op) => op.path === '' && op.op !== 'test')) continue;
          ++run;
          const after = structuredClone(doc);
          if (error !== undefined) {
            expect(() => applyPatch(after, patch), comment ?? error).toThrow();
            expect(after, comment).toEqual(doc);
          } else {
            const inverse = applyPatch(after, patch);
            if (expected !== undefined) expect(sameJson(after, expected), comment ?? JSON.stringify(patch)).toBe(true);
            applyPatch(after, inverse);
            expect(sameJson(after, doc), `inverse of ${JSON.stringify(patch)}`).toBe(true);
          }
        }
      expect(run).toBeGreaterThan(80);
    },
  );

  it('finds elements by names that are unique', () => {
    expect(withoutNames(json(room()), '/nodes/@box/translation')).toBe('/nodes/1/translation');
    expect(() => withoutNames(json(room()), '/nodes/@chair/translation')).toThrow('0 elements');
    const twice = room();
    twice.nodes![0]!.name = 'box';
    expect(() => withoutNames(json(twice), '/nodes/@box')).toThrow('2 elements');
  });

  it('is all or nothing', () => {
    const gltf = room();
    const patch: Patch = [
      { op: 'replace', path: '/nodes/1/translation', value: [9, 9, 9] },
      { op: 'remove', path: '/nodes/7' },
    ];
    expect(() => applyPatch(json(gltf), patch)).toThrow();
    expect(gltf).toEqual(room());
  });

  it('does not reach prototypes', () => {
    const document = { a: {} } as Json;
    applyPatch(document, [{ op: 'add', path: '/a/__proto__', value: { polluted: true } }]);
    expect(({} as Record<string, unknown>)['polluted']).toBeUndefined();
    expect(() => applyPatch(document, [{ op: 'replace', path: '/constructor/name', value: 1 }])).toThrow();
  });
});

describe('edits', () => {
  it('add a lamp to a scene without lights, and take it out again', () => {
    const gltf = room();
    const { patch, node } = addLamp(gltf, [0, 1, 0], { type: 'point', candela: 50 });
    const undo = edits.undoOnServer(patch, applyPatch(json(gltf), patch));
    expect(node).toBe(2);
    expect(gltf.scenes![0]!.nodes).toEqual([0, 1, 2]);
    expect(gltf.extensionsUsed).toEqual(['KHR_lights_punctual']);
    expect(gltf.extensions!.KHR_lights_punctual!.lights[0]).toMatchObject({
      type: 'point',
      intensity: 50,
    });
    applyPatch(json(gltf), undo);
    expect(gltf.scenes![0]!.nodes).toEqual([0, 1]);
    expect(gltf.nodes!.length).toBe(3); // lists do not shrink
    applyPatch(json(gltf), edits.redoOnServer(patch));
    expect(gltf.scenes![0]!.nodes).toEqual([0, 1, 2]);
    expect(gltf.nodes!.length).toBe(3);
  });

  it('hide a node that has no extensions yet', () => {
    const gltf = room();
    applyPatch(json(gltf), edits.setVisible(gltf, 1, false));
    expect(edits.isVisible(gltf, 1)).toBe(false);
    applyPatch(json(gltf), edits.setVisible(gltf, 1, true));
    expect(edits.isVisible(gltf, 1)).toBe(true);
    expect(gltf.extensionsUsed).toEqual(['KHR_node_visibility']);
  });

  it('are told in words', () => {
    expect(edits.describePatch(room(), edits.setColour(0, room(), [1, 0, 0]))).toBe('changed white: colour');
    expect(edits.describePatch(room(), [{ op: 'replace', path: '/nodes/@box/translation', value: [0, 0, 0] }])).toBe(
      'changed box: position',
    );
    const gltf = room();
    const { patch, node } = addLamp(gltf, [0, 1, 0], { type: 'point', candela: 5 });
    applyPatch(json(gltf), patch);
    expect(edits.describePatch(gltf, patch)).toBe('added lamp');
    const removed = edits.detachNode(gltf, node)!;
    const back = applyPatch(json(gltf), removed);
    expect(edits.describePatch(gltf, removed)).toBe('removed lamp');
    applyPatch(json(gltf), back);
    expect(edits.describePatch(gltf, back)).toBe('added lamp');
    expect(edits.describePatch(gltf, [])).toBe('changed the scene');
    expect(edits.describePatch(gltf, [{ op: 'remove', path: `/nodes/${node}` }, { op: 'remove', path: '/scenes/0/nodes/1' }])).toBe('removed an object'); // prettier-ignore
    expect(edits.describePatch(gltf, [{ op: 'replace', path: '/scenes/0/nodes', value: [0] }])).toBe('changed objects of the scene'); // prettier-ignore
  });
});

/** A server whose answers the test gives. */
function session() {
  const calls: {
    patch: Patch;
    id: string;
    sameSceneAs: number;
    answer: (reply: ScenePatchReply) => void;
    refuse: (error: Error) => void;
    isMeant: () => boolean;
  }[] = [];
  const refused: string[] = [];
  const document = new SceneDocument(
    (by) => by === 'me',
    ({ patch, requestId: id, sameSceneAs }, isMeant) =>
      new Promise((answer, refuse) => {
        calls.push({ patch, id, sameSceneAs, answer, refuse, isMeant });
      }),
    {
      changed: () => undefined,
      refused: (label, reason) => refused.push(`${label}: ${reason}`),
      historyChanged: () => undefined,
    },
  );
  document.reset(room(), 1);
  return { document, calls, refused };
}

const move = (x: number): Patch => edits.setPlacement(1, { translation: [x, 0, 0] });
const reply = (revision: number): ScenePatchReply => ({
  revision,
  affected: { surfaces: 1, shots: 1 },
});
const settle = () => new Promise((resolve) => setImmediate(resolve));

describe('nodes of the scene', () => {
  const scene = (nodes: Gltf['nodes'], roots: number[]): Gltf => ({
    asset: { version: '2.0' },
    scenes: [{ nodes: roots }],
    nodes,
  });

  it('come depth first, each with its depth, once', () => {
    const gltf = scene([{ children: [2, 1] }, {}, { children: [3] }, { children: [0] }, {}], [0, 4]);
    expect(hangingNodes(gltf)).toEqual([
      { node: 0, depth: 0 },
      { node: 2, depth: 1 },
      { node: 3, depth: 2 },
      { node: 1, depth: 1 },
      { node: 4, depth: 0 },
    ]);
  });

  it('may hang in a chain of any length', () => {
    const count = 200_000;
    const chain = Array.from({ length: count }, (_, i) => (i + 1 < count ? { children: [i + 1] } : {}));
    const all = hangingNodes(scene(chain, [0]));
    expect(all.length).toBe(count);
    expect(all.at(-1)).toEqual({ node: count - 1, depth: count - 1 });
  });
});

describe('scenes', () => {
  const named = (...names: (string | undefined)[]): Gltf => ({ asset: { version: '2.0' }, nodes: names.map((name) => ({ name })) }); // prettier-ignore

  it('are the same where most objects of a number have one name', () => {
    expect(isSameScene(named('a', 'b', 'c'), named('a', 'b', 'd'))).toBe(true);
    expect(isSameScene(named('a', undefined), named('a', undefined, 'lamp'))).toBe(true);
    expect(isSameScene(named('a'), named('a', 'lamp', 'lamp 2', 'panel')), 'it has grown').toBe(true);
    expect(isSameScene(named(undefined), named(undefined, 'lamp', 'lamp 2'))).toBe(false);
    expect(isSameScene(named('floor', 'wall'), named('far away'))).toBe(false);
    expect(isSameScene(named('a'), named('x', 'y', 'a'))).toBe(false);
    const solid = (...names: string[]): Gltf => ({ ...named(), nodes: names.map((name) => ({ name, mesh: 0 })) });
    const cubes = solid('Cube', 'Cube.001', 'Cube.002');
    expect(isSameScene(solid('Cube'), cubes), 'programs number their objects').toBe(false);
    expect(isSameScene(cubes, solid('Cube'))).toBe(false);
  });
});

describe('scene document', () => {
  it('keeps one step of a drag whose last edits are answered after it ended', async () => {
    const { document, calls } = session();
    const first = document.edit('Move', move(5), 'move 1');
    const last = document.edit('Move', move(6), 'move 1');
    document.endGesture();
    calls[0]!.answer(reply(2));
    await first;
    calls[1]!.answer(reply(3));
    await last;
    expect(document.undoStack.length).toBe(1);
    const again = document.edit('Move', move(7), 'move 1');
    calls[2]!.answer(reply(4));
    await again;
    expect(document.undoStack.length, 'the next drag is a step of its own').toBe(2);
    const undone = document.undo();
    expect(calls[3]!.patch).toEqual([{ op: 'replace', path: '/nodes/1/translation', value: [6, 0, 0] }]);
    calls[3]!.answer(reply(5));
    await undone;
  });

  it('takes back a drag that is cancelled, of which the server has heard and hears, and keeps no step of it', async () => {
    const { document, calls } = session();
    const at = () => document.gltf.nodes![1]!.translation;
    const first = document.edit('Move', move(5), 'move 1');
    void document.edit('Move', move(6), 'move 1'); // waits, and is not told
    const cancelled = document.cancelGesture('Move', 'move 1', move(1));
    expect(at()).toEqual([1, 0, 0]);
    calls[0]!.answer(reply(2));
    await first;
    await settle();
    expect(at()).toEqual([1, 0, 0]);
    expect(calls.map(({ patch }) => patch)).toEqual([move(5), move(1)]);
    calls[1]!.answer(reply(3));
    await cancelled;
    expect(at()).toEqual([1, 0, 0]);
    expect(document.undoStack).toEqual([]);
    // To take back what put it back would be to move it again.
    expect([...document.takenBack]).toEqual([3]);
  });

  it('takes back a drag that is cancelled after the server has answered all of it, and nothing before it', async () => {
    const { document, calls } = session();
    for (const [i, x] of [3, 4].entries()) {
      const moved = document.edit('Move', move(x), 'move 1');
      document.endGesture();
      calls[i]!.answer(reply(2 + i));
      await moved;
    }
    const dragged = document.edit('Move', move(7), 'move 1');
    calls[2]!.answer(reply(4));
    await dragged;
    const cancelled = document.cancelGesture('Move', 'move 1', move(4));
    expect(calls[3]!.patch).toEqual(move(4));
    calls[3]!.answer(reply(5));
    await cancelled;
    expect(document.undoStack.map(({ forward }) => forward)).toEqual([move(3), move(4)]);
  });

  it('tells the server nothing of a cancelled drag that it has not heard of', async () => {
    const { document, calls } = session();
    const other = document.edit('Colour', [{ op: 'replace', path: '/materials/0/name', value: 'grey' }]);
    void document.edit('Move', move(5), 'move 1');
    await document.cancelGesture('Move', 'move 1', move(1));
    expect(document.gltf.nodes![1]!.translation).toEqual([1, 0, 0]);
    calls[0]!.answer(reply(2));
    await other;
    await document.settled();
    expect(calls.length).toBe(1);
    expect(document.undoStack.length).toBe(1);
  });

  it('shows an edit at once, and undoes it to what stood there before', async () => {
    const { document, calls } = session();
    const done = document.edit('Move', move(5));
    expect(document.gltf.nodes![1]!.translation).toEqual([5, 0, 0]);
    expect(document.patched(2, calls[0]!.patch, 'me')).toBe(true); // the notification comes first
    calls[0]!.answer(reply(2));
    await done;
    expect(document.gltf.nodes![1]!.translation).toEqual([5, 0, 0]);
    const undone = document.undo();
    expect(calls[1]!.patch).toEqual([{ op: 'replace', path: '/nodes/1/translation', value: [1, 0, 0] }]);
    calls[1]!.answer(reply(3));
    await undone;
    expect(document.gltf).toEqual(room());
    const redone = document.redo();
    calls[2]!.answer(reply(4));
    await redone;
    expect(document.gltf.nodes![1]!.translation).toEqual([5, 0, 0]);
  });

  it('sends one edit at a time, and of a drag only the newest place', async () => {
    const { document, calls } = session();
    void document.edit('Move', move(2), 'drag');
    void document.edit('Move', move(3), 'drag');
    void document.edit('Move', move(4), 'drag');
    expect(calls.map((call) => call.patch)).toEqual([move(2)]);
    calls[0]!.answer(reply(2));
    await settle();
    expect(calls.map((call) => call.patch)).toEqual([move(2), move(4)]);
    calls[1]!.answer(reply(3));
    await settle();
    expect(document.undoStack.length).toBe(1);
    expect(document.undoStack[0]!.inverse).toEqual(move(1));
    expect(document.undoStack[0]!.forward).toEqual(move(4));
  });

  it('snaps back with the reason when the server refuses', async () => {
    const { document, calls, refused } = session();
    const done = document.edit('Move', move(7));
    calls[0]!.refuse(new RpcError(-32022, 'would not be a scene', { pointer: '/nodes/1' }));
    await expect(done).rejects.toThrow();
    expect(document.gltf).toEqual(room());
    expect(refused).toEqual(['Move: would not be a scene (/nodes/1)']);
    expect(document.undoStack).toEqual([]);
  });

  it("lays its own edit upon other people's", async () => {
    const { document, calls } = session();
    const done = document.edit('Move', move(7));
    const theirs: Patch = [{ op: 'replace', path: '/nodes/@box/scale', value: [2, 2, 2] }];
    expect(document.patched(2, theirs, 'Ann')).toBe(true);
    expect(document.gltf.nodes![1]).toMatchObject({
      translation: [7, 0, 0],
      scale: [2, 2, 2],
    });
    calls[0]!.refuse(new Error('no'));
    await expect(done).rejects.toThrow();
    expect(document.gltf.nodes![1]).toMatchObject({
      translation: [1, 0, 0],
      scale: [2, 2, 2],
    });
  });

  it('adds a lamp once, whether the notification or the answer comes first', async () => {
    for (const notificationFirst of [true, false]) {
      const { document, calls } = session();
      const { patch } = addLamp(document.gltf, [0, 1, 0], { type: 'point', candela: 50 });
      const done = document.edit('Add lamp', patch);
      if (notificationFirst) document.patched(2, patch, 'me');
      calls[0]!.answer(reply(2));
      await done;
      if (!notificationFirst) document.patched(2, patch, 'me');
      expect(document.gltf.nodes!.length).toBe(3);
      expect(document.gltf.scenes![0]!.nodes).toEqual([0, 1, 2]);
    }
  });

  it('sends nothing to a scene that has taken the place of the one it was meant for, and says so once', async () => {
    const { document, calls, refused } = session();
    const edited = [document.edit('Move', move(2), 'drag'), document.edit('Colour', [{ op: 'replace', path: '/materials/0/name', value: 'grey' }])]; // prettier-ignore
    const ends = edited.map((edit) => edit.catch((error: Error) => error.message));
    document.leave('another scene was loaded');
    expect(await Promise.all(ends)).toEqual(['another scene was loaded', 'another scene was loaded']);
    expect(calls[0]!.isMeant()).toBe(false); // where its answer was lost it is not asked for again
    await document.edit('Move', move(3)).catch(() => undefined);
    expect(refused).toEqual([
      'Colour: another scene was loaded',
      'Move: the server has another scene, which is still on its way',
    ]);
    calls[0]!.refuse(new Error('late'));
    await settle();
    document.reset(room(), 7);
    const next = document.edit('Move', move(4));
    expect(calls.map(({ patch }) => patch)).toEqual([move(2), move(4)]);
    calls[1]!.answer(reply(8));
    await next;
    expect(refused.length).toBe(2);
  });

  it('tells with each edit of which scene it is, and drops all of them where the server has another', async () => {
    const { document, calls, refused } = session();
    const made = [document.edit('Move', move(2)), document.edit('Move', move(3))];
    document.patched(2, [{ op: 'replace', path: '/materials/0/name', value: 'grey' }], 'ann');
    calls[0]!.answer(reply(3));
    await made[0];
    const late = ['Tint', 'Turn'].map((label) => document.edit(label, move(4)).catch((error: Error) => error.message));
    await settle();
    calls[1]!.answer(reply(4));
    await made[1];
    await settle();
    calls[2]!.refuse(new RpcError(-32009, 'revision 3 is of another scene than the present one'));
    expect(await Promise.all(late)).toEqual(Array(2).fill('another scene was loaded'));
    expect(calls.map(({ sameSceneAs }) => sameSceneAs)).toEqual([1, 1, 3]);
    expect(refused).toEqual(['Turn: another scene was loaded']);
    expect(document.gltf.nodes![1]!.translation).toEqual([3, 0, 0]);
    document.reset(room(), 7);
    void document.edit('Move', move(5));
    expect(calls[3]!.sameSceneAs).toBe(7);
  });

  it('lays what waits to be sent upon the document that comes anew', async () => {
    const { document, calls } = session();
    const first = document.edit('Move', move(2));
    const second = document.edit('Name', [{ op: 'replace', path: '/nodes/1/name', value: 'crate' }]);
    document.reset(room(), 5);
    expect(document.gltf.nodes![1]).toMatchObject({ name: 'crate', translation: [1, 0, 0] });
    calls[0]!.answer(reply(6));
    await first;
    await settle();
    calls[1]!.answer(reply(7));
    await second;
    expect(document.undoStack.map(({ label }) => label)).toEqual(['Name']);
    expect(document.gltf.nodes![1]!.name).toBe('crate');
  });

  it('asks for the scene anew when a patch does not fit', () => {
    const { document } = session();
    expect(document.patched(2, [{ op: 'remove', path: '/nodes/9' }], 'Ann')).toBe(false);
  });

  it('asks for the scene anew when a patch was lost on the way', () => {
    const { document } = session();
    expect(document.patched(3, [{ op: 'replace', path: '/nodes/1/name', value: 'b' }], 'Ann')).toBe(false);
    expect(document.revision).toBe(1);
    expect(document.gltf).toEqual(room());
  });

  it('asks for the scene anew when its own edit comes back in other words', () => {
    const { document } = session();
    const { patch } = addLamp(document.gltf, [0, 1, 0], { type: 'point', candela: 50 });
    void document.edit('Add lamp', patch);
    const told = patch.map((operation) =>
      operation.path === '/nodes/-' ? { ...operation, path: '/nodes/2' } : operation,
    );
    expect(told).not.toEqual(patch);
    expect(document.patched(2, told, 'me')).toBe(false);
  });
});
