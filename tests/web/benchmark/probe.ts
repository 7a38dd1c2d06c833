// What runs inside of a measured page, from before its first script: notes when tiles come, when frames are drawn, and
// which tasks keep the page from answering. Times are milliseconds since navigation started.

import type {} from '../../../client/web/src/main';

export interface Probe {
  /** Of each frame of the page, as long as it is measured. */
  frames: number[];
  longTasks: { start: number; ms: number }[];
  /** First tile of each scene revision. */
  tiles: Record<number, number>;
  /** First frame after one that was drawn with a tile of the revision, or a newer one. */
  shown: Record<number, number>;
  /** First frame after one that was drawn with all light of a solve that has reached its target. */
  converged?: number;
}

declare global {
  interface Window {
    probe?: Probe;
  }
}

/** Serialised into the page, so it must not refer to anything outside of itself. The marks are those of trace.ts. */
export function installProbe(): void {
  const probe: Probe = { frames: [], longTasks: [], tiles: {}, shown: {} };
  window.probe = probe;
  new PerformanceObserver((list) => {
    for (const { startTime, duration } of list.getEntries()) probe.longTasks.push({ start: startTime, ms: duration });
  }).observe({ type: 'longtask', buffered: true });

  window.WebSocket = class extends WebSocket {
    constructor(url: string | URL, protocols?: string | string[]) {
      super(url, protocols);
      this.addEventListener('message', ({ data }) => {
        if (!(data instanceof ArrayBuffer)) return;
        const revision = Number(new DataView(data).getBigUint64(32, true));
        if (Object.keys(probe.tiles).length === 0) performance.mark('probe: first tile');
        probe.tiles[revision] ??= performance.now();
      });
    }
  };

  // This runs before the page's own callback of the same frame, and so sees what the frame before has drawn.
  let marked = false;
  const markDrawn = ({ view }: NonNullable<Window['viewer']>) => {
    marked = true;
    const others = view.onDrawn.bind(view);
    view.onDrawn = () => {
      others();
      performance.mark('probe: drawn');
    };
  };
  const frame = () => {
    requestAnimationFrame(frame);
    const now = performance.now();
    probe.frames.push(now);
    const app = window.viewer;
    if (app && !marked) markDrawn(app);
    const set = app?.viewer.shown?.set;
    if (!app || !set || app.viewer.set !== set) return;
    if (set.revision > 0) probe.shown[set.revision] ??= now;
    const over = app.progress?.state === 'converged' && set.complete && set.waiting === 0;
    if (!over || probe.converged !== undefined) return;
    probe.converged = now;
    performance.mark('probe: converged');
  };
  requestAnimationFrame(frame);
}
