// Passes frames from the socket to the decoding worker, and the decoded tiles to the pages that they were sent for.

import type { LightmapSet } from '../view/light/lightmap_set';
import { KINDS } from '../protocol/tile_frame';
import type { DecodeReply, DecodeRequest } from './tile_worker';

export interface TileFeedEvents {
  /** The pages that tiles of a kind belong to now. */
  set(kind: string): LightmapSet | undefined;
  /** A frame was not used. Without a `reason`, its pages are gone. */
  dropped(bytes: number, reason?: string): void;
  queued(): void;
}

export class TileFeed {
  private readonly worker = new Worker(new URL('./tile_worker.ts', import.meta.url), { type: 'module' });
  private readonly sets = new Map<number, LightmapSet>();
  private sent = 0;
  private done = 0;
  private waiting: { after: number; act: () => void }[] = [];

  constructor(private readonly events: TileFeedEvents) {
    this.worker.onmessage = ({ data }: MessageEvent<DecodeReply>) => this.take(data);
  }

  push(frame: ArrayBuffer): void {
    const kind = frame.byteLength > 5 ? KINDS[new Uint8Array(frame)[5]!] : undefined;
    const set = kind && this.events.set(kind);
    if (!set) return this.events.dropped(frame.byteLength);
    const request: DecodeRequest = { ticket: ++this.sent, frame };
    this.sets.set(this.sent, set);
    this.worker.postMessage(request, [frame]);
  }

  /** Calls `act` once all frames that were pushed so far are decoded. */
  afterAll(act: () => void): void {
    if (this.done === this.sent) act();
    else this.waiting.push({ after: this.sent, act });
  }

  private take({ ticket, bytes, tile, reason }: DecodeReply): void {
    const set = this.sets.get(ticket);
    this.sets.delete(ticket);
    this.done = ticket;
    const kind = tile?.header.kind;
    // There may be a new layout since the frame was pushed.
    if (tile && set && kind && this.events.set(kind) === set) {
      set.enqueue(tile, bytes);
      this.events.queued();
    } else {
      this.events.dropped(bytes, reason);
    }
    while (this.waiting[0] && this.waiting[0].after <= this.done) this.waiting.shift()!.act();
  }
}
