// Files of one layout: a scene's lightmap coordinates fit the pages that were laid out with them, and no others. An edit
// between two requests may lay all of them out anew.

import type { LightmapsNote } from '../protocol/messages';

const NO_CONTENT = 204;
/** Of all that belongs together; whoever edits faster than this has to come to rest first. */
const TRIES = 4;
/** A layout that has just come may be told of a moment after the answer that its forerunner is gone. */
const PAUSES = 30;

export interface Layouts {
  /** The newest that the page was told of; undefined: there is none. */
  now(): LightmapsNote | undefined;
  /** Rejects with what the server says is wrong. */
  fetch(path: string, init?: RequestInit): Promise<Response>;
  /** A moment in which the server's messages come in. */
  pause(): Promise<void>;
}

/** The lit scene, with coordinates for the pages that the page was told of. */
export function fetchLitScene(layouts: Layouts): Promise<Blob> {
  return ofOneLayout(layouts, async ({ uvs }) => {
    const response = await layouts.fetch(uvs);
    return response.status === NO_CONTENT ? undefined : await response.blob();
  });
}

/** All pages of light, every one of the same layout. */
export function fetchLightmaps(layouts: Layouts): Promise<Blob[]> {
  return ofOneLayout(layouts, async ({ pages, uvs }) => {
    // Layouts only ever rise, so one that is there after the last page was there all the while.
    const isThere = async () => (await layouts.fetch(uvs, { method: 'HEAD' })).status !== NO_CONTENT;
    const blobs: Blob[] = [];
    try {
      for (let page = 0; page < pages.length; ++page)
        blobs.push(await (await layouts.fetch(`/lightmaps/${page}.exr`)).blob());
    } catch (error) {
      if (await isThere()) throw error;
      return undefined; // the new layout may have fewer pages
    }
    return (await isThere()) ? blobs : undefined;
  });
}

/** `take` returns undefined where the layout was gone before all of it was there. */
async function ofOneLayout<T>(layouts: Layouts, take: (note: LightmapsNote) => Promise<T | undefined>): Promise<T> {
  for (let tried = 0; tried < TRIES; ++tried) {
    const note = layouts.now();
    if (!note) throw new Error('there is no light yet');
    const taken = await take(note);
    if (taken !== undefined) return taken;
    for (let pause = 0; pause < PAUSES && layouts.now() === note; ++pause) await layouts.pause();
  }
  throw new Error('the scene kept changing while it was fetched; try again when nobody is editing it');
}
