// Fetches the geometry of layouts.

import { pause } from '../page/pause';
import { pauseMs } from '../protocol/connection';
import { NO_CONTENT, type LightmapsNote } from '../protocol/messages';
import type { Notes } from '../ui/toast';
import type { LightmapSet } from '../view/light/lightmap_set';
import type { Viewer } from '../view/viewer';

export class GeometryFetch {
  private running: AbortController | undefined;

  constructor(
    private readonly fetch: (path: string, init: RequestInit) => Promise<Response>,
    private readonly picture: Pick<Viewer, 'set' | 'load'>,
    private readonly notes: Pick<Notes, 'show'>,
  ) {}

  /**
   * Loads the geometry of a new layout and gives up that of the last. The light of a layout may arrive before its
   * geometry and is not sent twice: therefore the fetch is repeated after a broken connection, as long as the layout is
   * the newest.
   */
  async load(note: LightmapsNote, set: LightmapSet): Promise<void> {
    this.running?.abort();
    const { signal } = (this.running = new AbortController());
    const isWanted = () => this.picture.set === set;
    try {
      const glb = await this.fetchGlb(note.uvs, isWanted, signal);
      if (glb && isWanted()) await this.picture.load(glb, set);
    } catch (error) {
      if (isWanted() && !signal.aborted)
        this.notes.show(`The geometry could not be fetched: ${(error as Error).message}`, 'bad');
    }
  }

  /** Undefined: the layout is no longer the newest. Rejects with the reason that the server gives. */
  private async fetchGlb(path: string, isWanted: () => boolean, signal: AbortSignal): Promise<ArrayBuffer | undefined> {
    for (let attempt = 0; !signal.aborted && isWanted(); ++attempt) {
      try {
        const response = await this.fetch(path, { signal });
        // The server has a newer layout, and a message about it is on the way.
        return response.status === NO_CONTENT ? undefined : await response.arrayBuffer();
      } catch (error) {
        if (signal.aborted) return undefined;
        if (!(error instanceof TypeError)) throw error; // fetch() has no other sign of a broken connection
        await pause(pauseMs(attempt, Math.random()));
      }
    }
    return undefined;
  }
}
