// Decodes tiles off the main thread, one after the other, so that they keep their order.

import { decodeTile, type Tile } from '../protocol/tile_frame';

export interface DecodeRequest {
  ticket: number;
  frame: ArrayBuffer;
}

export interface DecodeReply {
  ticket: number;
  bytes: number;
  tile?: Tile;
  reason?: string;
}

/** The part of a worker's scope that is used here; the compiler knows only the page's scope. */
interface WorkerScope {
  onmessage: (event: MessageEvent<DecodeRequest>) => void;
  postMessage(reply: DecodeReply, transfer?: Transferable[]): void;
}

const scope = self as unknown as WorkerScope;
let last: Promise<void> = Promise.resolve();

scope.onmessage = ({ data }) => {
  last = last.then(() => decode(data));
};

async function decode({ ticket, frame }: DecodeRequest): Promise<void> {
  const bytes = frame.byteLength;
  try {
    const tile = await decodeTile(frame);
    scope.postMessage({ ticket, bytes, tile }, [tile.texels.buffer as ArrayBuffer]);
  } catch (error) {
    scope.postMessage({ ticket, bytes, reason: (error as Error).message });
  }
}
