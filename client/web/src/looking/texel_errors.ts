// The standard error of the texel that the light meter reads. The server is asked for one texel at a time.

import { NOT_FOUND, type TexelReply } from '../protocol/messages';
import { RpcError } from '../protocol/rpc';
import { luminance } from '../page/colours';

/** Least time between two calls: the pointer moves on, and during a solve each answer is soon out of date. */
const APART_MS = 200;
/** Least time after a call that the server refused. */
const REFUSED_MS = 1000;

export interface TexelPlace {
  page: number;
  x: number;
  y: number;
}

/** The newest light that the server has told of. */
export interface LightVersion {
  revision: number;
  tileVersion: number;
}

export interface TexelSource {
  /** Rejects with the server's refusal, or when the connection is lost. */
  ask(place: TexelPlace): Promise<TexelReply>;
  /** Undefined: there is no server to ask. */
  version(): LightVersion | undefined;
  /** An error may have become known. */
  changed(): void;
}

export class TexelErrors {
  /** `error` is undefined where the server has no such texel. */
  private answer: (TexelPlace & LightVersion & { error: number | undefined }) | undefined;
  private isAsking = false;
  private lastMs = -Infinity;
  private apartMs = APART_MS;
  private session = 0;
  private timer: ReturnType<typeof setTimeout> | undefined;

  constructor(private readonly source: TexelSource) {}

  /** The session is another, and its server may count revisions from the start. */
  forget(): void {
    this.answer = undefined;
    ++this.session;
  }

  /**
   * Standard error of the texel's irradiance (lux, luminance); undefined: not known yet, or there is none. Asks the
   * server when the error is unknown or older than the newest light: one call at a time, five a second at most. An
   * answer counts only for its own texel and its own revision of the scene, until the next answer is here.
   */
  errorAt(place: TexelPlace): number | undefined {
    const version = this.source.version();
    if (!version) return undefined;
    const { answer } = this;
    const known = answer && isSame(answer, place) && answer.revision === version.revision ? answer : undefined;
    if (!known || known.tileVersion < version.tileVersion) this.askSoon(place, version);
    return known?.error;
  }

  /** Too soon after the last call, the meter reads again later, as the pointer may be elsewhere by then. */
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
      if (!isNone) this.apartMs = REFUSED_MS; // the server is busy or shutting down
    }
    this.isAsking = false;
    this.source.changed();
  }
}

function isSame(a: TexelPlace, b: TexelPlace): boolean {
  return a.page === b.page && a.x === b.x && a.y === b.y;
}
