// `./dev bench viewer`: how soon the live viewer shows what, and how smoothly. Writes viewer.md and viewer.json.

import { mkdirSync, writeFileSync } from 'node:fs';
import { cpus, loadavg } from 'node:os';
import { join } from 'node:path';
import { parseArgs } from 'node:util';
import { Pages } from '../browser/harness';
import { median, ms, quantile, spread, table } from './figures';
import { openLoading, openSolved, scriptSize, watchEdits, type Edit, type Opening } from './measure';

const USAGE = `Usage: ./dev bench viewer [OPTION...]

Opens radiosityd in Chromium and measures what a visitor waits for. Figures are medians, with the largest in brackets.

  --runs N    openings of each scene (7)
  --edits N   edits of the lamp (20)
  --gpu       let Chromium use the graphics card; otherwise it renders in software, on the same cores as the server
  --help
`;

const SCENES = [
  { file: 'cornell.glb', label: 'Cornell box' },
  { file: 'room_small.glb', label: 'room of 402 polygons' },
];

interface Row {
  label: string;
  openings: Opening[];
}

const say = (text: string) => process.stderr.write(`${text}\n`);

/** Says what is measured, then what came of it, so that whoever waits sees at once which part takes how long. */
async function stage<T>(name: string, measure: () => Promise<T>, told: (result: T) => string): Promise<T> {
  say(`${name} ...`);
  const begin = performance.now();
  const result = await measure();
  say(`${name}, ${((performance.now() - begin) / 1000).toFixed(0)} s:\n${told(result)}\n`);
  return result;
}

function openingsTable(rows: readonly Row[]): string {
  const head = ['opened', 'geometry', 'light', 'converged', 'main thread in all', 'its longest task before tiles', 'with tiles', 'tasks > 50 ms with tiles, a visit', 'frame interval: median, p95, max']; // prettier-ignore
  return table(
    head,
    rows.map(({ label, openings }) => {
      const of = (figure: (opening: Opening) => number) => spread(openings.map(figure));
      const frames = openings.flatMap((opening) => opening.frames);
      const sum = ({ before, withTiles }: Opening['thread']) => [...before, ...withTiles].reduce((a, b) => a + b, 0);
      return [
        label,
        of((opening) => opening.geometry),
        of((opening) => opening.light),
        of((opening) => opening.converged),
        of(({ thread }) => sum(thread)),
        of(({ thread }) => Math.max(0, ...thread.before)),
        of(({ thread }) => Math.max(0, ...thread.withTiles)),
        of(({ longTasks }) => longTasks.length),
        [median(frames), quantile(frames, 0.95), Math.max(...frames)].map(ms).join(', '),
      ];
    }),
  );
}

/** What 60 frames a second leave 16.7 ms for, where a card draws them. */
function framesTable(rows: readonly Row[]): string {
  const head = ["a frame's own scripts: median, p95, max", 'while tiles arrive', 'while the picture turns'];
  return table(
    head,
    rows.map(({ label, openings }) => {
      const of = (figure: (opening: Opening) => number[]) => {
        const all = openings.flatMap(figure);
        return [median(all), quantile(all, 0.95), Math.max(...all)].map(ms).join(', ');
      };
      return [label, of(({ thread }) => thread.framesWithTiles), of(({ thread }) => thread.framesOfTurning)];
    }),
  );
}

function editsTable(edits: readonly Edit[]): string {
  return table(
    ['a lamp recoloured over another connection', 'ms'],
    [
      ['from the acknowledgement to its first tile in the page', spread(edits.map((edit) => edit.ackToTile))],
      ['from that tile to the frame that shows it', spread(edits.map((edit) => edit.tileToFrame))],
      ['from asking to the frame that shows it', spread(edits.map((edit) => edit.askToFrame))],
    ],
  );
}

async function main(): Promise<void> {
  const { values } = parseArgs({
    args: process.argv.slice(2),
    options: {
      runs: { type: 'string', default: '7' },
      edits: { type: 'string', default: '20' },
      gpu: { type: 'boolean', default: false },
      help: { type: 'boolean', default: false },
    },
  });
  if (values.help) return void process.stdout.write(USAGE);
  const [runs, edits] = [Number(values.runs), Number(values.edits)];
  if (!(runs >= 1 && edits >= 1)) throw new Error('--runs and --edits are numbers of at least 1');
  const load = loadavg()[0]!;

  const pages = new Pages();
  await pages.launch(values.gpu);
  try {
    const rows: Row[] = [];
    for (const { file, label } of SCENES)
      for (const [how, open] of [
        ['solved', openSolved],
        ['being loaded', openLoading],
      ] as const) {
        const row = (openings: Opening[]): Row => ({ label: `${label}, ${how}`, openings });
        const told = (openings: Opening[]) => [openingsTable, framesTable].map((of) => of([row(openings)])).join('\n');
        rows.push(row(await stage(`${label}, ${how}`, () => open(pages, file, runs), told)));
      }
    const seen = await stage('edits', () => watchEdits(pages, SCENES[0]!.file, edits), editsTable);
    const size = await scriptSize(pages, SCENES[0]!.file);
    const renderer = await pages.renderer();
    const text = [
      '# The live viewer',
      '',
      `${cpus().length} cores, load ${load.toFixed(1)} when it began; Chromium draws with ${renderer}. ${runs} openings of each, ${edits} edits; median (largest).`,
      `JavaScript: ${ms(size.packed / 1000)} kB packed, ${ms(size.unpacked / 1000)} kB unpacked.`,
      '',
      'All in milliseconds. Geometry, light and converged: from navigation to the frame after the one that was drawn with it.',
      "The main thread and its longest tasks: processor time. Tasks > 50 ms: by the page's clock, other programs included.",
      '',
      openingsTable(rows),
      '',
      framesTable(rows),
      '',
      editsTable(seen),
      '',
    ].join('\n');
    const folder = process.env['RADIOSITY_BENCH_OUTPUT'] ?? '.';
    mkdirSync(folder, { recursive: true });
    writeFileSync(join(folder, 'viewer.md'), text);
    writeFileSync(join(folder, 'viewer.json'), JSON.stringify({ renderer, load, size, rows, edits: seen }, null, 1));
    process.stdout.write(text);
    if (pages.complaints.length > 0) throw new Error(`the pages complained: ${pages.complaints.join('; ')}`);
  } finally {
    await pages.quit();
  }
}

main().catch((error: Error) => {
  say(`bench viewer: ${error.message}`);
  process.exitCode = 1;
});
