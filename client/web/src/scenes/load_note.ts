// What the server's history tells of loaded scenes. Pure functions.

import type { PastRevision, SceneHistory } from '../protocol/messages';
import { shownName } from '../protocol/page_name';

/**
 * Revision of the scene that a server begins with. When nobody is known to have loaded it, it replaced nobody's work.
 */
const FIRST = 1;

/** The server's name for a scene that was sent to it without one. */
const UNNAMED = 'unnamed scene';

/** What people are told of another scene, given the newest revisions; undefined: nobody has loaded this revision. */
export function loadNote(revisions: readonly PastRevision[], revision: number): string | undefined {
  const load = revisions.find((past) => past.revision === revision && past.kind === 'load');
  if (!load || (!load.by && revision === FIRST)) return undefined;
  return `${shownName(load.by ?? '') || 'Someone'} loaded ${sceneName(load.summary)}`;
}

/** Whether the scene of a revision was replaced. It counts as replaced when the history does not reach back so far. */
export function wasReplaced({ revisions }: SceneHistory, revision: number): boolean {
  const load = revisions.filter(({ kind }) => kind === 'load').at(-1);
  return load ? load.revision > revision : (revisions[0]?.revision ?? 0) > revision + 1;
}

function sceneName(summary: string | undefined): string {
  if (!summary) return 'another scene';
  return summary === UNNAMED ? 'a scene without a name' : summary;
}
