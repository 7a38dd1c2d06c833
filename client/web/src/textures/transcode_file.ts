// node transcode.mjs BASIS.js BASIS.wasm IN OUT: a scene file with its KTX 2.0 pictures as PNGs. What `radiosity` runs
// before it sends a file. What is wrong goes to standard error, and the exit code is 1.
import { readFileSync, writeFileSync } from 'node:fs';
import { nodeDecoder } from './basis_node';
import { withoutKtx2 } from './scene_textures';

async function run(basisScript: string, basisWasm: string, from: string, to: string): Promise<void> {
  const decode = await nodeDecoder(basisScript, basisWasm);
  writeFileSync(to, await withoutKtx2(new Uint8Array(readFileSync(from)), decode));
}

const [basisScript, basisWasm, from, to] = process.argv.slice(2);
run(basisScript!, basisWasm!, from!, to!).catch((error: unknown) => {
  process.stderr.write(`${error instanceof Error ? error.message : String(error)}\n`);
  process.exit(1);
});
