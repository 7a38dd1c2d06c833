// Fetches the geometry of layouts. Part of the App.

import type { App } from '../app/app';
import { pauseMs } from '../protocol/connection';
import type { LightmapsNote } from '../protocol/messages';
import type { LightmapSet } from '../view/light/lightmap_set';

const NO_CONTENT = 204;

export class GeometrySession {
  private running: AbortController | undefined;

  constructor(private readonly app: App) {}

  /**
   * Of a layout that has just come; what is on its way for another is given up. The light of a layout may be here before
   * its geometry, and is not sent twice: so a line that breaks in between is tried again, for as long as it is the layout.
   */
  async load(note: LightmapsNote, set: LightmapSet): Promise<void> {
    this.running?.abort();
    const { signal } = (this.running = new AbortController());
    const { viewer, frame } = this.app;
    try {
      const glb = await this.fetch(note.uvs, () => viewer.set === set, signal);
      if (glb && viewer.set === set) await viewer.load(glb, set);
    } catch (error) {
      if (viewer.set === set && !signal.aborted)
        frame.toasts.show(`The geometry could not be fetched: ${(error as Error).message}`, 'bad');
    }
  }

  /** Undefined: another layout has come, or none is shown any more. Rejects with what the server says against it. */
  private async fetch(path: string, wanted: () => boolean, signal: AbortSignal): Promise<ArrayBuffer | undefined> {
    for (let attempt = 0; !signal.aborted && wanted(); ++attempt) {
      try {
        const response = await this.app.fetch(path, { signal });
        // Pages have another layout by now: the server tells of it, and this one is not waited for.
        return response.status === NO_CONTENT ? undefined : await response.arrayBuffer();
      } catch (error) {
        if (signal.aborted) return undefined;
        if (!(error instanceof TypeError)) throw error; // fetch() has no other sign of a line that broke
        await new Promise((resolve) => setTimeout(resolve, pauseMs(attempt, Math.random())));
      }
    }
    return undefined;
  }
}
