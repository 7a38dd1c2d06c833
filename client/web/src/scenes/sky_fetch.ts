// Fetches the picture of the sky whenever the document says that it is another one.

import type { Gltf } from '../document/gltf';
import { pictureKey } from '../document/skies';

/** An edit is shown here before the server has it; a picture that is turned changes many times a second. */
const WAIT_MS = 400;
/** Before a picture is asked for again that did not come. */
const RETRY_MS = 5000;

export interface SkyHost {
  fetch(path: string, init?: RequestInit): Promise<Response>;
  /** Radiance HDR; undefined: there is none. */
  show(bytes: Uint8Array | undefined): void;
}

export class SkyFetch {
  private key: string | undefined;
  private timer: ReturnType<typeof setTimeout> | undefined;
  private abort: AbortController | undefined;

  constructor(private readonly host: SkyHost) {}

  /** The document has come as a whole, or changed: in another one the same words may mean another picture. */
  onDocument(gltf: Gltf, isWhole: boolean): void {
    const key = pictureKey(gltf);
    if (key === this.key && !(isWhole && key !== undefined)) return;
    this.key = key;
    clearTimeout(this.timer);
    this.abort?.abort();
    if (key === undefined) this.host.show(undefined);
    else this.ask(WAIT_MS);
  }

  private ask(waitMs: number): void {
    this.timer = setTimeout(() => void this.fetch(), waitMs);
  }

  private async fetch(): Promise<void> {
    const abort = (this.abort = new AbortController());
    try {
      const response = await this.host.fetch('/sky.hdr', { signal: abort.signal });
      const bytes = new Uint8Array(await response.arrayBuffer());
      if (!abort.signal.aborted) this.host.show(bytes);
    } catch {
      // Until it comes the sky stays as it is.
      if (!abort.signal.aborted) this.ask(RETRY_MS);
    }
  }
}
