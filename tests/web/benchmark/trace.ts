// Tasks of a page's main thread in processor time, from Chromium's own trace: what other programs take from the machine
// does not count, as it does in what the page itself can measure.

import type { Browser, Page } from 'playwright-core';

interface TraceEvent {
  name: string;
  cat: string;
  ph: string;
  pid: number;
  tid: number;
  /** Microseconds. */
  ts: number;
  dur?: number;
  tdur?: number;
}

export interface MainThread {
  /** Milliseconds of processor time of each task, from the first tile on, and before. */
  withTiles: number[];
  before: number[];
  /** Of each frame's own scripts alone, whatever draws it: while tiles arrive, and while the picture turns at rest. */
  framesWithTiles: number[];
  framesOfTurning: number[];
}

/** Names of the performance marks that the page sets. */
export const FIRST_TILE = 'probe: first tile';
export const CONVERGED = 'probe: converged';
/** Inside of each frame that draws. */
export const DRAWN = 'probe: drawn';
export const TURNING = 'probe: turning';
export const TURNED = 'probe: turned';

export async function startTrace(browser: Browser, page: Page): Promise<void> {
  await browser.startTracing(page, { categories: ['toplevel', 'blink.user_timing', 'devtools.timeline'] });
}

export async function endTrace(browser: Browser): Promise<MainThread> {
  const { traceEvents } = JSON.parse((await browser.stopTracing()).toString()) as { traceEvents: TraceEvent[] };
  return mainThread(traceEvents);
}

/** The thread that set the marks is the page's main thread. */
export function mainThread(events: readonly TraceEvent[]): MainThread {
  const mark = (name: string) => events.find((event) => event.name === name && event.cat.includes('user_timing'));
  const [firstTile, over] = [mark(FIRST_TILE), mark(CONVERGED)];
  if (!firstTile || !over) throw new Error('the trace has no marks of the page');
  const tasks = events.filter(
    ({ name, ph, pid, tid, ts }) =>
      ph === 'X' && name.endsWith('RunTask') && pid === over.pid && tid === over.tid && ts <= over.ts,
  );
  const took = ({ tdur, dur }: TraceEvent) => (tdur ?? dur ?? 0) / 1000;
  const hasTiles = ({ ts, dur }: TraceEvent) => ts + (dur ?? 0) >= firstTile.ts;
  const drawn = events.filter(({ name, pid, tid }) => name === DRAWN && pid === over.pid && tid === over.tid);
  const scripts = events.filter(
    ({ name, ph, pid, tid, ts, dur }) =>
      ph === 'X' &&
      name === 'FireAnimationFrame' &&
      pid === over.pid &&
      tid === over.tid &&
      drawn.some((mark) => mark.ts >= ts && mark.ts <= ts + (dur ?? 0)),
  );
  const between = (from: TraceEvent | undefined, to: TraceEvent | undefined) =>
    from && to ? scripts.filter(({ ts }) => ts >= from.ts && ts <= to.ts).map(took) : [];
  return {
    withTiles: tasks.filter(hasTiles).map(took),
    before: tasks.filter((task) => !hasTiles(task)).map(took),
    framesWithTiles: between(firstTile, over),
    framesOfTurning: between(mark(TURNING), mark(TURNED)),
  };
}
