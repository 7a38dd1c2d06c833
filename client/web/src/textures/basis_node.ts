// The transcoder's files under Node.js.
import { readFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import { makeDecoder, type BasisFactory, type Decode } from './basis';

export function nodeDecoder(basisScript: string, basisWasm: string): Promise<Decode> {
  // The script is written for pages and CommonJS, and names its function BASIS.
  const text = `${readFileSync(basisScript, 'utf8')}\nreturn BASIS;`;
  const make = new Function('require', '__filename', '__dirname', text) as (...of: unknown[]) => BasisFactory;
  const wasm = new Uint8Array(readFileSync(basisWasm));
  return makeDecoder(make(createRequire(import.meta.url), basisScript, '.'), wasm.buffer);
}
