// What was measured, as tables, beside what it shall be. Pure.

import { median, ms, quantile, spread, table } from './figures';
import type { Edit, Opening } from './measure';

export interface Row {
  label: string;
  openings: Opening[];
}

export interface Figures {
  rows: Row[];
  edits: Edit[];
  /** From the arrival of each tile of a long solve to the picture with it. */
  solve: number[];
  size: { packed: number; unpacked: number };
  /** Turns a second that the browser leaves a page with a canvas of that size. */
  browser: number;
}

/** What a visitor shall not wait for any longer; sizes in kB, all else in milliseconds. */
const TARGETS = { light: 1000, tile: 100, task: 50, script: 400, rate: 60 } as const;

const all = (rows: readonly Row[]) => rows.flatMap(({ openings }) => openings);
const most = (values: readonly number[]) => Math.max(0, ...values);
const isLong = (value: number) => value > TARGETS.task;
const met = (is: boolean) => (is ? 'met' : 'missed');

/** Each figure over all openings: what is bounded, what came of it, and whether that is within bounds. */
export function targetsTable({ rows, edits, solve, size, browser }: Figures): string {
  const openings = all(rows);
  const light = openings.map((opening) => opening.light);
  const tiles = openings.flatMap((opening) => opening.tileToPicture);
  const relit = edits.map((edit) => edit.ackToTile + edit.tileToPicture);
  const byClock = openings.flatMap(({ longTasks }) => longTasks.filter(isLong));
  const byProcessor = openings.flatMap(({ thread }) => thread.withTiles.filter(isLong));
  const rate = openings.map((opening) => opening.rate);
  const packed = size.packed / 1000;
  const tasks = (long: number[]) => `${long.length} in ${openings.length} visits${long.length ? `, longest ${ms(most(long))} ms` : ''}`; // prettier-ignore
  return table(
    ['figure: median (largest)', 'measured', 'target', ''],
    [
      ['first light after opening', `${spread(light)} ms`, `under ${TARGETS.light} ms`, met(most(light) < TARGETS.light)],
      ['tile from its arrival to the screen, while a solve goes on', `${spread(solve)} ms`, `under ${TARGETS.tile} ms`, met(median(solve) < TARGETS.tile)],
      ['the same while the page itself is starting', tiles.length ? `${spread(tiles)} ms` : 'all came with the first light', `under ${TARGETS.tile} ms`, met(!tiles.length || median(tiles) < TARGETS.tile)],
      ['tile from the edit that it shows to the screen', `${spread(relit)} ms`, `under ${TARGETS.tile} ms`, met(median(relit) < TARGETS.tile)],
      ['tasks over 50 ms while tiles arrive, by processor time', tasks(byProcessor), 'none', met(byProcessor.length === 0)],
      ['the same by the clock, other programs included', tasks(byClock), 'none', met(byClock.length === 0)],
      ['JavaScript, packed', `${ms(packed)} kB`, `under ${TARGETS.script} kB`, met(packed < TARGETS.script)],
      ['a picture of all pixels, of many without a pause', `${spread(openings.map((opening) => opening.picture))} ms`, '–', ''],
      ['turns a second of a page that only clears such a canvas', ms(browser), '–', ''],
      ['pictures a second while it turns: median (fewest)', `${ms(median(rate))} (${ms(Math.min(...rate))})`, `${TARGETS.rate} with a card, to one in a hundred`, met(median(rate) >= 0.99 * TARGETS.rate)],
    ], // prettier-ignore
  );
}

export function openingsTable(rows: readonly Row[]): string {
  const head = ['opened', 'geometry', 'light', 'converged', 'tile to screen', 'main thread in all', 'its longest task before tiles', 'with tiles', 'tasks > 50 ms with tiles, a visit', 'pictures/s']; // prettier-ignore
  return table(
    head,
    rows.map(({ label, openings }) => {
      const of = (figure: (opening: Opening) => number) => spread(openings.map(figure));
      const sum = ({ before, withTiles }: Opening['thread']) => [...before, ...withTiles].reduce((a, b) => a + b, 0);
      return [
        label,
        of((opening) => opening.geometry),
        of((opening) => opening.light),
        of((opening) => opening.converged),
        spread(openings.flatMap((opening) => opening.tileToPicture)),
        of(({ thread }) => sum(thread)),
        of(({ thread }) => most(thread.before)),
        of(({ thread }) => most(thread.withTiles)),
        of(({ longTasks }) => longTasks.length),
        of(({ rate }) => rate),
      ];
    }),
  );
}

/** What 60 frames a second leave 16.7 ms for, where a card draws them. */
export function framesTable(rows: readonly Row[]): string {
  const head = ["a frame's own scripts: median, p95, max", 'while tiles arrive', 'while the picture turns'];
  return table(
    head,
    rows.map(({ label, openings }) => {
      const of = (figure: (opening: Opening) => number[]) => {
        const values = openings.flatMap(figure);
        return values.length === 0 ? '–' : [median(values), quantile(values, 0.95), most(values)].map(ms).join(', ');
      };
      return [label, of(({ thread }) => thread.framesWithTiles), of(({ thread }) => thread.framesOfTurning)];
    }),
  );
}

export function editsTable(edits: readonly Edit[]): string {
  return table(
    ['a lamp recoloured over another connection', 'ms'],
    [
      ['from the acknowledgement to its first tile in the page', spread(edits.map((edit) => edit.ackToTile))],
      ['from that tile to the picture that shows it', spread(edits.map((edit) => edit.tileToPicture))],
      ['from asking to the picture that shows it', spread(edits.map((edit) => edit.askToPicture))],
    ],
  );
}
