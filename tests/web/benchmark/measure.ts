// One opening of the viewer, and edits seen in it, in a real browser with a real server.

import type { Page } from 'playwright-core';
import { converged, Pages, SCENES, Server } from '../browser/harness';
import { installProbe, type Probe } from './probe';
import { endTrace, startTrace, type MainThread } from './trace';

export interface Opening {
  /** Milliseconds from navigation to the picture that showed it. */
  geometry: number;
  light: number;
  converged: number;
  /** Tasks of the main thread from the first tile on that took 50 ms or more, as the page sees it. */
  longTasks: number[];
  /** All of its tasks, in processor time. */
  thread: MainThread;
  /** From the arrival of each tile, once there is light, to the picture with it; milliseconds. */
  tileToPicture: number[];
  /** Pictures a second while it turns. */
  rate: number;
  /** Milliseconds that page and card take for a picture of all pixels, of many drawn without a pause. */
  picture: number;
}

export interface Edit {
  /** Milliseconds from one to the next. */
  ackToTile: number;
  tileToPicture: number;
  askToPicture: number;
}

/** Of pages of which nothing is timed: in software every pixel of theirs would cost time of the machine. */
const SMALL = [160, 100] as const;
const TURNING_PICTURES = 60;
/** Drawn without a pause between them. */
const PICTURES_ON_END = 10;
/** Where pictures take long there are fewer. */
const MOST_TURNING_MS = 3000;

async function openProbed(pages: Pages, url: string): Promise<Page> {
  const page = await pages.open('about:blank');
  await page.addInitScript(installProbe);
  await page.goto(url);
  return page;
}

/** Turns the picture with every turn of the page. Returns how many pictures a second that gives, from the first on. */
async function turn(page: Page): Promise<number> {
  return page.evaluate(
    async ([count, mostMs]) => {
      const { viewer } = window.viewer!;
      const { pictures } = window.probe!;
      const nextTurn = () => new Promise((resolve) => requestAnimationFrame(resolve));
      performance.mark('probe: turning');
      const [before, begin] = [pictures.length, performance.now()];
      while (pictures.length - before < count! && performance.now() - begin < mostMs!) {
        viewer.rig.turn(0.01, 0);
        await nextTurn();
      }
      performance.mark('probe: turned');
      const done = pictures.slice(before).map((picture) => picture.done);
      return done.length < 2 ? 0 : (1000 * (done.length - 1)) / (done.at(-1)! - done[0]!);
    },
    [TURNING_PICTURES, MOST_TURNING_MS],
  );
}

/** What page and card take for a picture of all pixels, whatever the browser then does with it. */
async function drawOften(page: Page): Promise<number> {
  return page.evaluate((count) => {
    const { viewer } = window.viewer!;
    const drawing = viewer as unknown as { draw(scale: number): void };
    const gl = viewer.renderer.getContext() as WebGL2RenderingContext;
    const finish = () => gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
    drawing.draw(1);
    finish();
    const begin = performance.now();
    for (let i = 0; i < count; ++i) drawing.draw(1);
    finish();
    return (performance.now() - begin) / count;
  }, PICTURES_ON_END);
}

/** Turns a second of a page that does no more than clear a canvas of the same size: what the browser leaves a viewer. */
export async function browsersRate(pages: Pages): Promise<number> {
  const page = await pages.open('about:blank');
  const rate = await page.evaluate(async (count) => {
    const canvas = document.createElement('canvas');
    [canvas.width, canvas.height] = [innerWidth, innerHeight];
    document.body.style.margin = '0';
    document.body.append(canvas);
    const gl = canvas.getContext('webgl2')!;
    const nextTurn = () => new Promise((resolve) => requestAnimationFrame(resolve));
    let begin = 0;
    for (let i = -5; i <= count; ++i) {
      await nextTurn();
      if (i === 0) begin = performance.now();
      gl.clearColor((i & 1) / 2, 0, 0, 1);
      gl.clear(gl.COLOR_BUFFER_BIT);
    }
    return (1000 * count) / (performance.now() - begin);
  }, TURNING_PICTURES);
  await pages.closeAll();
  return rate;
}

async function takeOpening(pages: Pages, url: string): Promise<Opening> {
  const page = await pages.open('about:blank');
  await page.addInitScript(installProbe);
  await startTrace(pages.started, page);
  await page.goto(url);
  await page.waitForFunction(() => window.probe?.converged !== undefined, undefined, { timeout: 120_000 });
  const rate = await turn(page);
  await page.waitForTimeout(300); // a task that has just begun is told of when it is over
  const thread = await endTrace(pages.started);
  const picture = await drawOften(page);
  const firstTile = await page.evaluate(() => window.viewer!.marks['firstTile']!);
  const probe: Probe = await page.evaluate(() => window.probe!);
  const until = probe.converged!;
  const isLate = ({ start, ms }: { start: number; ms: number }) => start + ms >= firstTile && start <= until;
  return {
    geometry: probe.pictures[0]?.done ?? NaN,
    light: probe.pictures.find(({ light }) => light)?.done ?? NaN,
    converged: until,
    longTasks: probe.longTasks.filter(isLate).map(({ ms }) => ms),
    thread,
    tileToPicture: probe.tileToPicture,
    rate,
    picture,
  };
}

/** A page that opens a scene that is solved already, each time in a browser profile of its own (no cache). */
export async function openSolved(pages: Pages, scene: string, runs: number): Promise<Opening[]> {
  const server = new Server(`${SCENES}/${scene}`);
  await server.start();
  const openings: Opening[] = [];
  try {
    await converged(await pages.open(server.url, ...SMALL));
    await pages.closeAll();
    for (let run = 0; run < runs; ++run) {
      openings.push(await takeOpening(pages, server.url));
      await pages.closeAll();
    }
  } finally {
    await server.stop('SIGTERM');
  }
  return openings;
}

/** A page that is opened as soon as the server listens, while it still loads the scene. */
export async function openLoading(pages: Pages, scene: string, runs: number): Promise<Opening[]> {
  const openings: Opening[] = [];
  for (let run = 0; run < runs; ++run) {
    const server = new Server(`${SCENES}/${scene}`);
    await server.start();
    try {
      openings.push(await takeOpening(pages, server.url));
    } finally {
      await pages.closeAll();
      await server.stop('SIGTERM');
    }
  }
  return openings;
}

/**
 * Calls over a connection that the viewer knows nothing of; what the last answers. Times are milliseconds since 1970, as
 * all pages have them, around the last.
 */
async function call(
  editor: Page,
  calls: { method: string; params: object }[],
): Promise<{ result: unknown; asked: number; answered: number }> {
  return editor.evaluate(async (calls) => {
    const now = () => performance.timeOrigin + performance.now();
    const socket = new WebSocket(`ws://${location.host}/ws`, 'radiosity.v1');
    const answers = new Map<number, (message: { result?: unknown; error?: unknown }) => void>();
    socket.onmessage = ({ data }) => {
      const message = JSON.parse(data as string) as { id?: number; result?: unknown; error?: unknown };
      if (message.id !== undefined) answers.get(message.id)?.(message);
    };
    await new Promise((resolve) => (socket.onopen = resolve));
    let last = { result: undefined as unknown, asked: 0, answered: 0 };
    for (const [id, { method, params }] of [{ method: 'hello', params: { client: 'benchmark' } }, ...calls].entries()) {
      const asked = now();
      const message = await new Promise<{ result?: unknown; error?: unknown }>((resolve) => {
        answers.set(id, resolve);
        socket.send(JSON.stringify({ jsonrpc: '2.0', id, method, params }));
      });
      if (message.error) throw new Error(`${method}: ${JSON.stringify(message.error)}`);
      last = { result: message.result, asked, answered: now() };
    }
    socket.close();
    return last;
  }, calls);
}

async function recolour(editor: Page, rgb: number[]): Promise<{ revision: number; asked: number; answered: number }> {
  const patch = [{ op: 'replace', path: '/materials/@light/emissiveFactor', value: rgb }];
  const { result, ...times } = await call(editor, [{ method: 'scene.patch', params: { patch } }]);
  return { ...(result as { revision: number }), ...times };
}

/** A solve to a small error, from its beginning, in a page that is open already: of each tile, until it is seen. */
export async function watchSolve(pages: Pages, scene: string): Promise<number[]> {
  const TARGET_ERROR = 0.003;
  const server = new Server(`${SCENES}/${scene}`);
  await server.start();
  try {
    const page = await openProbed(pages, server.url);
    await converged(page);
    const editor = await pages.open(`${server.url}/status`, 100, 100);
    await page.evaluate(() => (window.probe!.tileToPicture = []));
    const settings = { method: 'solve.configure', params: { targetError: TARGET_ERROR } };
    await call(editor, [settings, { method: 'solve.restart', params: {} }]);
    await converged(page);
    return await page.evaluate(() => window.probe!.tileToPicture);
  } finally {
    await pages.closeAll();
    await server.stop('SIGTERM');
  }
}

/** A lamp that somebody else recolours, seen in an open page; the solve comes to rest before the next. */
export async function watchEdits(pages: Pages, scene: string, edits: number): Promise<Edit[]> {
  const server = new Server(`${SCENES}/${scene}`);
  await server.start();
  try {
    const page = await openProbed(pages, server.url);
    await converged(page);
    const editor = await pages.open(`${server.url}/status`, 100, 100);
    const out: Edit[] = [];
    for (let i = 0; i < edits; ++i) {
      const { revision, asked, answered } = await recolour(editor, i % 2 ? [1, 0.7, 0.4] : [0.4, 0.7, 1]);
      const seen = await page.waitForFunction((revision) => {
        const { tiles, shown } = window.probe!;
        const first = (times: Record<number, number>) =>
          Math.min(...Object.keys(times).filter((key) => Number(key) >= revision).map((key) => times[Number(key)]!)); // prettier-ignore
        const [tile, picture] = [first(tiles), first(shown)];
        return Number.isFinite(picture) ? { tile, picture, origin: performance.timeOrigin } : undefined;
      }, revision);
      const { tile, picture, origin } = (await seen.jsonValue())!;
      out.push({
        ackToTile: origin + tile - answered,
        tileToPicture: picture - tile,
        askToPicture: origin + picture - asked,
      });
      await converged(page);
    }
    return out;
  } finally {
    await pages.closeAll();
    await server.stop('SIGTERM');
  }
}

/** Bytes of JavaScript that a visit fetches, as packed and unpacked. */
export async function scriptSize(pages: Pages, scene: string): Promise<{ packed: number; unpacked: number }> {
  const server = new Server(`${SCENES}/${scene}`);
  await server.start();
  try {
    const page = await pages.open(server.url, ...SMALL);
    await converged(page);
    return await page.evaluate(() => {
      const entries = performance.getEntriesByType('resource') as PerformanceResourceTiming[];
      const scripts = entries.filter(({ name }) => name.endsWith('.js'));
      return {
        packed: scripts.reduce((sum, entry) => sum + entry.encodedBodySize, 0),
        unpacked: scripts.reduce((sum, entry) => sum + entry.decodedBodySize, 0),
      };
    });
  } finally {
    await pages.closeAll();
    await server.stop('SIGTERM');
  }
}
