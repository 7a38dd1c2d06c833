import { offerOf } from '../../../client/web/src/editing/edit_history';
import { loadNote, wasReplaced } from '../../../client/web/src/scenes/load_note';
import type { PastRevision, SceneHistory } from '../../../client/web/src/protocol/messages';

const history = (undoable: number, redoable: number, revisions: PastRevision[]): SceneHistory => ({
  revision: revisions.at(-1)?.revision ?? 0,
  undoable,
  redoable,
  revisions,
});

const load: PastRevision = { revision: 1, kind: 'load' };

describe('what is offered to be undone and redone', () => {
  it('is nothing where the server has nothing', () => {
    expect(offerOf(history(0, 0, [load]), new Set())).toEqual({ undo: false, redo: false });
    expect(offerOf(history(0, 0, []), new Set())).toEqual({ undo: false, redo: false });
  });

  it('is what others have done, and have taken back', () => {
    const edit: PastRevision = { revision: 2, kind: 'patch' };
    expect(offerOf(history(1, 0, [load, edit]), new Set())).toEqual({ undo: true, redo: false });
    const back: PastRevision[] = [load, { ...edit, undone: true }, { revision: 3, kind: 'undo' }];
    expect(offerOf(history(0, 1, back), new Set())).toEqual({ undo: false, redo: true });
  });

  it('is not what this page has taken back: undoing that would do it again', () => {
    const edits: PastRevision[] = [load, { revision: 2, kind: 'patch' }, { revision: 3, kind: 'patch' }];
    expect(offerOf(history(2, 0, edits), new Set([3]))).toEqual({ undo: false, redo: false });
    // Somebody's edit on top of it is.
    const more: PastRevision[] = [...edits, { revision: 4, kind: 'patch' }];
    expect(offerOf(history(3, 0, more), new Set([3])).undo).toBe(true);
    const less: PastRevision[] = [
      ...edits,
      { revision: 4, kind: 'patch', undone: true },
      { revision: 5, kind: 'undo' },
    ];
    expect(offerOf(history(2, 1, less), new Set([3]))).toEqual({ undo: false, redo: true });
  });

  it('is undone without knowing it where there is more than was asked for', () => {
    expect(offerOf(history(40, 0, [{ revision: 90, kind: 'redo' }]), new Set([3])).undo).toBe(true);
  });
});

it('a scene was replaced where a later load is known, or too much was done for it to be', () => {
  const [loaded, patch] = [{ revision: 4, kind: 'load' } as const, { revision: 5, kind: 'patch' } as const];
  expect(wasReplaced(history(1, 0, [loaded, patch]), 3)).toBe(true);
  expect(wasReplaced(history(1, 0, [loaded, patch]), 4)).toBe(false);
  expect(wasReplaced(history(1, 0, [patch]), 4)).toBe(false);
  expect(wasReplaced(history(1, 0, [patch]), 3)).toBe(true);
});

it('people are told who has loaded which scene, as far as that is known', () => {
  const loads: PastRevision[] = [
    { revision: 4, kind: 'load', summary: 'room.glb', by: 'Ann' },
    { revision: 5, kind: 'undo' },
    { revision: 6, kind: 'load', summary: 'hall.glb' },
    { revision: 7, kind: 'load' },
  ];
  expect([4, 5, 6, 7, 8].map((revision) => loadNote(loads, revision))).toEqual([
    'Ann loaded room.glb',
    undefined,
    'Someone loaded hall.glb',
    'Someone loaded another scene',
    undefined,
  ]);
  expect(loadNote([{ revision: 1, kind: 'load', summary: 'room.glb', by: 'Ann' }], 1)).toBe('Ann loaded room.glb');
  expect(loadNote([{ revision: 1, kind: 'load', summary: 'room.glb' }], 1)).toBeUndefined(); // the command line's
  const nameless = { revision: 2, kind: 'load', summary: 'unnamed scene', by: 'curl/7.88.1' } as const;
  expect(loadNote([nameless], 2)).toBe('curl/7.88.1 loaded a scene without a name');
});
