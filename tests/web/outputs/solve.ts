// What `radiosity solve` writes for a scene, in a folder of the test's own.

import { execFile } from 'node:child_process';
import { existsSync, mkdtempSync, readdirSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { promisify } from 'node:util';

function named(variable: string): string {
  const value = process.env[variable];
  if (!value) throw new Error(`${variable} must be set (ctest sets it)`);
  return value;
}

export const SCENES = named('RADIOSITY_SCENES');
/** Scenes of others, beside the checkout; '' where there are none. */
export const SHARED = existsSync(process.env['RADIOSITY_SHARED'] ?? '') ? process.env['RADIOSITY_SHARED']! : '';

const run = promisify(execFile);

/** A folder that goes with the test file. */
export function folder(): string {
  const path = mkdtempSync(join(tmpdir(), 'radiosity-outputs-'));
  afterAll(() => rmSync(path, { recursive: true, force: true }));
  return path;
}

/** Texels are of one size. Status 3, ended above the asked error, is as good as 0: output was written. Returns what was said. */
export async function solve(scene: string, output: string, ...options: string[]): Promise<string> {
  const args = ['solve', scene, '-o', output, '--uniform', ...options];
  return run(named('RADIOSITY'), args, { maxBuffer: 1 << 24 }).then(
    ({ stderr }) => stderr,
    (failure: { code?: number; stderr?: string; message: string }) => {
      if (failure.code === 3) return failure.stderr ?? '';
      throw new Error(`${failure.message} ${failure.stderr}`);
    },
  );
}

/** The radiance that a camera sees by path tracing: R, G, B of each pixel, rows from the top. */
export async function trace(scene: string, output: string, ...options: (string | number)[]): Promise<void> {
  await run(named('TRACE_PICTURE'), [scene, output, ...options.map(String)]);
}

/** Every file below a folder, of these endings. */
export function filesBelow(path: string, ending: RegExp): string[] {
  if (!existsSync(path)) return [];
  const names = readdirSync(path, { recursive: true, encoding: 'utf8' });
  return names.filter((name) => ending.test(name)).map((name) => join(path, name)).sort(); // prettier-ignore
}

/** All of them, so many at a time. */
export async function inTurns<T>(all: readonly T[], atOnce: number, what: (one: T) => Promise<void>): Promise<void> {
  const left = [...all];
  const worker = async () => {
    for (let next = left.shift(); next !== undefined; next = left.shift()) await what(next);
  };
  await Promise.all(Array.from({ length: atOnce }, worker));
}
