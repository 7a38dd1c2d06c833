// Fetches files that belong to one layout: lightmap coordinates fit only the pages that were laid out with them, and an
// edit between two requests may make a new layout.

import { NO_CONTENT, type LightmapsNote } from '../protocol/messages';

/** Attempts to fetch all files of one layout. If edits come faster, the user has to wait for them to end. */
const TRIES = 4;
/** The message about a new layout may come a moment after the answer that the old one is gone. */
const PAUSES = 30;

export interface Layouts {
  /** The newest layout that the page knows of; undefined: there is none. */
  now(): LightmapsNote | undefined;
  /** Rejects with the reason that the server gives. */
  fetch(path: string, init?: RequestInit): Promise<Response>;
  /** A moment for the server's messages to arrive. */
  pause(): Promise<void>;
}

/** The lit scene, with coordinates for the newest lightmap pages. */
export function fetchLitScene(layouts: Layouts): Promise<Blob> {
  return ofOneLayout(layouts, async ({ uvs }) => {
    const response = await layouts.fetch(uvs);
    return response.status === NO_CONTENT ? undefined : await response.blob();
  });
}

/** All lightmap pages of the newest layout. */
export function fetchLightmaps(layouts: Layouts): Promise<Blob[]> {
  return ofOneLayout(layouts, async ({ pages, uvs }) => {
    // No layout returns, so one that is there after the last page was there all the time.
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

/** `take` returns undefined when the layout was gone before all of its files were fetched. */
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
