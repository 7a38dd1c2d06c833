// Scene files as the server reads them: without KTX2 pictures.
import { mayHaveKtx2 } from './scene_textures';
import type { Told } from './transcode_worker';

/** Of a GLB only its JSON is looked through. */
async function speaksOfKtx2(file: File): Promise<boolean> {
  const head = new DataView(await file.slice(0, 20).arrayBuffer());
  const isGlb = head.byteLength === 20 && head.getUint32(0, true) === 0x46546c67;
  const part = isGlb ? file.slice(0, 20 + head.getUint32(12, true)) : file;
  return mayHaveKtx2(new Uint8Array(await part.arrayBuffer()));
}

/**
 * The file itself, or one with PNGs in place of its KTX2 pictures; `onWork` is called before that is made, which takes
 * about a second for ten megapixels. Rejects with the picture and what is wrong with it, and where it is aborted.
 */
export async function sendable(file: File, onWork: () => void, signal: AbortSignal): Promise<File> {
  if (!(await speaksOfKtx2(file))) return file;
  onWork();
  const bytes = await file.arrayBuffer();
  signal.throwIfAborted();
  const worker = new Worker(new URL('./transcode_worker.ts', import.meta.url), { type: 'module' });
  try {
    const told = await new Promise<Told>((resolve, reject) => {
      worker.onmessage = ({ data }: MessageEvent<Told>) => resolve(data);
      worker.onerror = (event) => reject(new Error(`KTX2 textures cannot be unpacked here: ${event.message}`));
      signal.addEventListener('abort', () => reject(signal.reason as Error));
      worker.postMessage(bytes, [bytes]);
    });
    if ('error' in told) throw new Error(told.error);
    return new File([told.file], file.name);
  } finally {
    worker.terminate();
  }
}
