// Turns the KTX2 pictures of one scene file into PNGs, away from the page, and ends with the page's word. It alone may
// run code made from text, which the transcoder's bindings are (server/net/viewer_response.cpp).
import BASIS from 'three/examples/jsm/libs/basis/basis_transcoder.js';
import wasmUrl from 'three/examples/jsm/libs/basis/basis_transcoder.wasm?url';
import { makeDecoder } from './basis';
import { withoutKtx2 } from './scene_textures';

export type Told = { file: Uint8Array<ArrayBuffer> } | { error: string };

async function run(file: ArrayBuffer): Promise<Told> {
  const wasm = await fetch(wasmUrl);
  if (!wasm.ok) return { error: `the KTX2 transcoder cannot be loaded (${wasm.status})` };
  const decode = await makeDecoder(BASIS, await wasm.arrayBuffer());
  return { file: (await withoutKtx2(new Uint8Array(file), decode)) as Uint8Array<ArrayBuffer> };
}

self.onmessage = ({ data }: MessageEvent<ArrayBuffer>) => {
  const failed = (error: unknown): Told => ({ error: error instanceof Error ? error.message : String(error) });
  void run(data)
    .catch(failed)
    .then((told) => self.postMessage(told, 'file' in told ? { transfer: [told.file.buffer] } : {}));
};
