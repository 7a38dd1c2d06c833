// The standard error of single texels, asked of the server one at a time: of the one that the light meter reads.

import { NOT_FOUND, type TexelReply } from '../protocol/messages';
import { RpcError } from '../protocol/rpc';
import { luminance } from '../page/colours';

/** From one call to the next, at least: the pointer wanders, and while a solve goes on every answer is soon old. */
const APART_MS = 200;
/** And after a call that was refused. */
const REFUSED_MS = 1000;

export interface TexelPlace {
  page: number;
  x: number;
  y: number;
}

/** What the newest light is of, as far as the server has told. */
export interface LightVersion {
  revision: number;
  tileVersion: number;
}

export interface TexelSource {
  /** Rejects with what the server refuses, or where the connection was lost. */
  ask(place: TexelPlace): Promise<TexelReply>;
  /** Undefined where nobody can be asked. */
  version(): LightVersion | undefined;
  /** There may be more to read now than before. */
  changed(): void;
}

export class TexelErrors {
  /** Without an error: there is no such texel. */
  private answer: (TexelPlace & LightVersion & { error: number | undefined }) | undefined;
  private isAsking = false;
  private lastMs = -Infinity;
  private apartMs = APART_MS;
  private session = 0;
  private timer: ReturnType<typeof setTimeout> | undefined;

  constructor(private readonly source: TexelSource) {}

  /** There is another session: its server may count revisions anew. */
  forget(): void {
    this.answer = undefined;
    ++this.session;
  }

  /**
   * Standard error of the texel's irradiance, lux, luminance; undefined: not known, or not yet. What is not known, or is
   * older than the newest light, is asked for: one call at a time, five a second at most. An answer is of its own texel
   * and its own revision of the scene, and within these it stands until the next is here.
   */
  errorAt(place: TexelPlace): number | undefined {
    const version = this.source.version();
    if (!version) return undefined;
    const { answer } = this;
    const known = answer && isSame(answer, place) && answer.revision === version.revision ? answer : undefined;
    if (!known || known.tileVersion < version.tileVersion) this.askSoon(place, version);
    return known?.error;
  }

  /** Too soon after the last call it is read once more when it is time: the pointer may be elsewhere by then. */
  private askSoon(place: TexelPlace, version: LightVersion): void {
    if (this.isAsking || this.timer !== undefined) return;
    const wait = this.lastMs + this.apartMs - performance.now();
    if (wait <= 0) return void this.ask(place, version);
    this.timer = setTimeout(() => {
      this.timer = undefined;
      this.source.changed();
    }, wait);
  }

  private async ask({ page, x, y }: TexelPlace, version: LightVersion): Promise<void> {
    this.isAsking = true;
    this.lastMs = performance.now();
    this.apartMs = APART_MS;
    const { session } = this;
    try {
      const { revision, tileVersion, error } = await this.source.ask({ page, x, y });
      if (session === this.session) this.answer = { page, x, y, revision, tileVersion, error: luminance(error) };
    } catch (refusal) {
      const isNone = refusal instanceof RpcError && refusal.code === NOT_FOUND;
      if (session === this.session) this.answer = isNone ? { page, x, y, ...version, error: undefined } : undefined;
      if (!isNone) this.apartMs = REFUSED_MS; // it is busy, or on its way out
    }
    this.isAsking = false;
    this.source.changed();
  }
}

function isSame(a: TexelPlace, b: TexelPlace): boolean {
  return a.page === b.page && a.x === b.x && a.y === b.y;
}
