// What a page holds on the graphics card.

import type { Page } from 'playwright-core';
import type {} from '../../../client/web/src/main';

const KINDS = ['Texture', 'Buffer', 'VertexArray', 'Program', 'Framebuffer', 'Sync'];

declare global {
  interface Window {
    /** Of each kind: those that were made and not deleted. */
    alive?: Record<string, number>;
  }
}

/** Before the page is opened. */
export async function countAlive(page: Page): Promise<void> {
  await page.addInitScript((kinds) => {
    const counts: Record<string, number> = {};
    window.alive = counts;
    const type = WebGL2RenderingContext.prototype as unknown as Record<string, (...of: unknown[]) => unknown>;
    for (const kind of kinds) {
      const [make, end] = kind === 'Sync' ? ['fenceSync', 'deleteSync'] : [`create${kind}`, `delete${kind}`];
      const [making, ending] = [type[make]!, type[end]!];
      type[make] = function (...of) {
        counts[kind] = (counts[kind] ?? 0) + 1;
        return making.apply(this, of);
      };
      type[end] = function (...of) {
        if (of[0]) counts[kind] = (counts[kind] ?? 0) - 1;
        return ending.apply(this, of);
      };
    }
  }, KINDS);
}

export function alive(page: Page): Promise<Record<string, number>> {
  return page.evaluate(() => ({ ...window.alive }));
}

/**
 * What may be alive later if that is alive now. three.js keeps a vertex array for each pair of a geometry and a program
 * that has drawn it, and a geometry has two programs: one while its pages fill, and one for whole pages. Pages that were
 * whole at the first picture were drawn by the second alone, so one more array may come for each geometry.
 */
export async function mayLive(page: Page): Promise<Record<string, number>> {
  const geometries = await page.evaluate(() => {
    const found = new Set<unknown>();
    window.viewer!.viewer.shown!.root.traverse((object) => {
      if ('geometry' in object) found.add(object.geometry);
    });
    return found.size;
  });
  const now = await alive(page);
  return { ...now, VertexArray: (now['VertexArray'] ?? 0) + geometries };
}

/**
 * Kinds of which there are more than before. A frame or two may be on their way, hence the 3.
 */
export async function grown(page: Page, before: Record<string, number>): Promise<[string, number, number][]> {
  return Object.entries(await alive(page))
    .map(([kind, count]): [string, number, number] => [kind, before[kind] ?? 0, count])
    .filter(([, then, now]) => now - then > 3);
}
