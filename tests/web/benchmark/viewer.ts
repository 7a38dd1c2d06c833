// `./dev bench viewer`: how soon the live viewer shows what, and how smoothly. Writes viewer.md and viewer.json.

import { mkdirSync, writeFileSync } from 'node:fs';
import { cpus, loadavg } from 'node:os';
import { join } from 'node:path';
import { parseArgs } from 'node:util';
import { Pages } from '../browser/harness';
import { ms, spread } from './figures';
import { browsersRate, openLoading, openSolved, scriptSize, watchEdits, watchSolve, type Opening } from './measure';
import { editsTable, framesTable, openingsTable, targetsTable, type Figures, type Row } from './report';

const USAGE = `Usage: ./dev bench viewer [OPTION...]

Opens radiosityd in Chromium and measures what a visitor waits for. Figures are medians, with the largest in brackets.

  --runs N    openings of each scene (3)
  --edits N   edits of the lamp (10)
  --size WxH  pixels of the page (1280x800)
  --gpu       let Chromium use the graphics card; otherwise it renders in software, on the same cores as the server
  --help
`;

const SCENES = [
  { file: 'cornell.glb', label: 'Cornell box' },
  { file: 'room_small.glb', label: 'room of 402 polygons' },
];

/** What a Chromium without a screen needs to draw with a card; CHROMIUM_CARD in the environment holds others. */
const CARD = (process.env['CHROMIUM_CARD'] ?? '--use-angle=vulkan --enable-features=Vulkan --disable-vulkan-surface')
  .split(' ')
  .filter(Boolean);

const say = (text: string) => process.stderr.write(`${text}\n`);

/** Says what is measured, then what came of it, so that whoever waits sees at once which part takes how long. */
async function stage<T>(name: string, measure: () => Promise<T>, told: (result: T) => string): Promise<T> {
  say(`${name} ...`);
  const begin = performance.now();
  const result = await measure();
  say(`${name}, ${((performance.now() - begin) / 1000).toFixed(0)} s:\n${told(result)}\n`);
  return result;
}

async function measureAll(pages: Pages, runs: number, edits: number): Promise<Figures> {
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
  const solve = await stage('a solve', () => watchSolve(pages, SCENES[0]!.file), (tiles) => `${tiles.length} tiles: ${spread(tiles)} ms`); // prettier-ignore
  const browser = await browsersRate(pages);
  return { rows, edits: seen, solve, browser, size: await scriptSize(pages, SCENES[0]!.file) };
}

async function main(): Promise<void> {
  const { values } = parseArgs({
    args: process.argv.slice(2),
    options: {
      runs: { type: 'string', default: '3' },
      edits: { type: 'string', default: '10' },
      size: { type: 'string', default: '1280x800' },
      gpu: { type: 'boolean', default: false },
      help: { type: 'boolean', default: false },
    },
  });
  if (values.help) return void process.stdout.write(USAGE);
  const [runs, edits] = [Number(values.runs), Number(values.edits)];
  if (!(runs >= 1 && edits >= 1)) throw new Error('--runs and --edits are numbers of at least 1');
  const size = /^([1-9]\d{1,3})x([1-9]\d{1,3})$/.exec(values.size)?.slice(1).map(Number);
  if (!size) throw new Error('--size is WIDTHxHEIGHT, pixels, e.g. 1920x1080');
  const load = loadavg()[0]!;

  const pages = new Pages([size[0]!, size[1]!]);
  await pages.launch(values.gpu ? CARD : undefined);
  try {
    const figures = await measureAll(pages, runs, edits);
    const renderer = await pages.renderer();
    const { rows, size: scripts } = figures;
    const text = [
      '# The live viewer',
      '',
      `${cpus().length} cores, load ${load.toFixed(1)} when it began; Chromium draws ${values.size} pixels with ${renderer}. ${runs} openings of each, ${edits} edits; median (largest).`,
      `JavaScript: ${ms(scripts.packed / 1000)} kB packed, ${ms(scripts.unpacked / 1000)} kB unpacked.`,
      '',
      targetsTable(figures),
      '',
      'All in milliseconds. Geometry, light and converged: from navigation to the picture with it, when the card has drawn it.',
      "The main thread and its longest tasks: processor time. Tasks > 50 ms: by the page's clock, other programs included.",
      '',
      openingsTable(rows),
      '',
      framesTable(rows),
      '',
      editsTable(figures.edits),
      '',
    ].join('\n');
    const folder = process.env['RADIOSITY_BENCH_OUTPUT'] ?? '.';
    mkdirSync(folder, { recursive: true });
    writeFileSync(join(folder, 'viewer.md'), text);
    writeFileSync(join(folder, 'viewer.json'), JSON.stringify({ renderer, load, ...figures }, null, 1));
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
