// What runs inside of a measured page, from before its first script: notes when tiles come, when pictures are there, and
// which tasks keep the page from answering. Times are milliseconds since navigation started. A picture is there when the
// card has drawn it (a fence behind its last command): where software draws, that is long after the page is done with it.

import type {} from '../../../client/web/src/main';

export interface Picture {
  /** When the card had drawn it. */
  done: number;
  /** Light is shown, not only geometry. */
  light: boolean;
}

export interface Probe {
  /** Of each turn of the page, as long as it is measured. */
  turns: number[];
  pictures: Picture[];
  longTasks: { start: number; ms: number }[];
  /** First tile of each scene revision. */
  tiles: Record<number, number>;
  /** First picture with a tile of the revision, or a newer one. */
  shown: Record<number, number>;
  /** From the arrival of each tile that came after the first light to the first picture with it. */
  tileToPicture: number[];
  /** First picture with all light of a solve that has reached its target. */
  converged?: number;
}

declare global {
  interface Window {
    probe?: Probe;
  }
}

/** Serialised into the page, so it must not refer to anything outside of itself. The marks are those of trace.ts. */
export function installProbe(): void {
  const LOOK_MS = 4;
  const probe: Probe = { turns: [], pictures: [], longTasks: [], tiles: {}, shown: {}, tileToPicture: [] };
  window.probe = probe;
  new PerformanceObserver((list) => {
    for (const { startTime, duration } of list.getEntries()) probe.longTasks.push({ start: startTime, ms: duration });
  }).observe({ type: 'longtask', buffered: true });

  const arrivals: number[] = []; // the page takes tiles up in the order in which they come
  window.WebSocket = class extends WebSocket {
    constructor(url: string | URL, protocols?: string | string[]) {
      super(url, protocols);
      this.addEventListener('message', ({ data }) => {
        if (!(data instanceof ArrayBuffer)) return;
        const revision = Number(new DataView(data).getBigUint64(32, true));
        if (arrivals.length === 0) performance.mark('probe: first tile');
        arrivals.push(performance.now());
        probe.tiles[revision] ??= performance.now();
      });
    }
  };

  type App = NonNullable<Window['viewer']>;
  interface UnderWay {
    fence: WebGLSync | null;
    light: boolean;
    revision: number;
    taken: number;
    whole: boolean;
  }
  const underWay: UnderWay[] = [];
  let looks = false;
  let last: UnderWay | undefined; // that is there
  let first: object | undefined; // the set that arrivals are counted for

  const isThere = ({ fence }: UnderWay, gl: WebGL2RenderingContext) =>
    !fence || gl.getSyncParameter(fence, gl.SYNC_STATUS) !== gl.UNSIGNALED;
  const take = (picture: UnderWay) => {
    const done = performance.now();
    probe.pictures.push({ done, light: picture.light });
    if (picture.revision > 0) probe.shown[picture.revision] ??= done;
    if (last?.light)
      for (const came of arrivals.slice(last.taken, picture.taken)) probe.tileToPicture.push(done - came);
    last = picture;
  };
  const look = (app: App) => {
    const gl = app.viewer.renderer.getContext() as WebGL2RenderingContext;
    while (underWay[0] && isThere(underWay[0], gl)) {
      const picture = underWay.shift()!;
      gl.deleteSync(picture.fence);
      take(picture);
    }
    const set = app.viewer.shown?.set;
    const over = app.progress?.state === 'converged' && set?.waiting === 0 && set.tilesTaken === last?.taken;
    if (over && last?.whole && probe.converged === undefined) {
      probe.converged = performance.now();
      performance.mark('probe: converged');
    }
    if (underWay.length > 0) lookSoon(app);
  };
  const lookSoon = (app: App) => {
    if (looks) return;
    looks = true;
    setTimeout(() => {
      looks = false;
      look(app);
    }, LOOK_MS);
  };
  const follow = (app: App) => {
    const { view, viewer } = app;
    const others = view.onDrawn.bind(view);
    view.onDrawn = () => {
      others();
      performance.mark('probe: drawn');
      const set = viewer.shown?.set;
      if (!set || viewer.set !== set) return;
      first ??= set;
      const gl = viewer.renderer.getContext() as WebGL2RenderingContext;
      const fence = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
      gl.flush();
      const { revision, showsLight } = set;
      const taken = first === set ? set.tilesTaken : 0; // tiles of another layout were counted for the first
      const light = showsLight && set.tilesTaken > 0;
      underWay.push({ fence, light, revision, taken, whole: set.complete && set.waiting === 0 });
      lookSoon(app);
    };
  };

  // This runs before the page's own callback of the same turn.
  let follows = false;
  const turn = () => {
    requestAnimationFrame(turn);
    probe.turns.push(performance.now());
    const app = window.viewer;
    if (!app) return;
    if (!follows) follow(app);
    follows = true;
    look(app);
  };
  requestAnimationFrame(turn);
}
