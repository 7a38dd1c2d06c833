// The connection to the server. It opens, says hello and subscribes; a lost connection opens again after growing pauses
// and resumes where it was. One for a page; main thread.

import { CreditWindow, FIRST_WINDOW } from './credit';
import {
  CLOSE_OVERLOAD,
  CLOSE_UNAUTHENTICATED,
  SUBPROTOCOL,
  UNAUTHENTICATED,
  type HelloReply,
  type Notifications,
  type Resume,
  type ServerInfo,
  type SubscribeParams,
} from './messages';
import { Rpc, RpcError } from './rpc';

const FIRST_PAUSE_MS = 250;
const MAX_PAUSE_MS = 10_000;
/** A page cannot see the server's pings, so it asks the server now and then, and gives up when no answer comes. */
const PROBE_MS = 15_000;
const PROBE_PATIENCE_MS = 8_000;

export type LinkState = 'connecting' | 'open' | 'waiting' | 'refused';

export interface ConnectionEvents {
  state(state: LinkState, detail: string): void;
  /** The handshake is done, and calls may be made. */
  ready(info: ServerInfo, hello: HelloReply): void;
  notification<K extends keyof Notifications>(method: K, params: Notifications[K]): void;
  tile(frame: ArrayBuffer): void;
}

export interface ConnectionOptions {
  url: string;
  client: string;
  token: () => string | undefined;
  /** The light that the page holds, by its last bookmark. */
  resume: () => Resume | undefined;
  subscription: () => SubscribeParams;
  makeSocket?: (url: string, protocol: string) => WebSocket;
  random?: () => number;
}

/** Grows by 1.7 each time, with a random part of a quarter, so that a roomful of pages does not return at once. */
export function pauseMs(attempt: number, random: number): number {
  const base = Math.min(MAX_PAUSE_MS, FIRST_PAUSE_MS * 1.7 ** attempt);
  return Math.round(base * (0.75 + 0.5 * random));
}

/** What the parts of the viewer ask of the connection. */
export interface Server {
  /** Undefined while there is no connection. */
  readonly info: ServerInfo | undefined;
  readonly isOpen: boolean;
  has(capability: string): boolean;
  /** Rejects with RpcError (the server's refusal) or ConnectionLost. */
  call<T>(method: string, params?: object): Promise<T>;
}

export class Connection implements Server {
  info: ServerInfo | undefined;
  credit = new CreditWindow();
  private socket: WebSocket | undefined;
  private rpc: Rpc | undefined;
  private attempt = 0;
  private timer: ReturnType<typeof setTimeout> | undefined;
  private probe: ReturnType<typeof setInterval> | undefined;
  private stopped = false;
  private isBehind = false; // the page missed too much to resume: it starts afresh
  private isRefused = false; // the server has refused the token of this socket's hello

  constructor(
    private readonly options: ConnectionOptions,
    private readonly events: ConnectionEvents,
  ) {}

  /** Opens now, without waiting for the end of a pause. */
  open(): void {
    clearTimeout(this.timer);
    if (this.socket || this.stopped) return;
    this.events.state('connecting', '');
    const make = this.options.makeSocket ?? ((url, protocol) => new WebSocket(url, protocol));
    const socket = make(this.options.url, SUBPROTOCOL);
    socket.binaryType = 'arraybuffer';
    this.socket = socket;
    const rpc = new Rpc(socket, (method, params) => this.onNotification(rpc, method, params));
    this.rpc = rpc;
    socket.onmessage = ({ data }) => {
      if (typeof data === 'string') return rpc.receive(data);
      this.credit.received((data as ArrayBuffer).byteLength, performance.now());
      this.events.tile(data as ArrayBuffer);
    };
    socket.onclose = ({ code, reason }) => this.onClose(socket, code, reason);
  }

  /** Says hello again with the present options, and resumes. Without a connection, the next one does so anyway. */
  renew(): void {
    const { socket } = this;
    if (!socket || !this.isOpen) return;
    this.forget();
    socket.onclose = socket.onmessage = null;
    socket.close(1000);
    this.open();
  }

  /** Closes for good; no more events follow. */
  close(): void {
    this.stopped = true;
    clearTimeout(this.timer);
    if (!this.socket) return;
    const { socket } = this;
    this.forget();
    socket.onclose = socket.onmessage = null;
    socket.close(1000);
  }

  get isOpen(): boolean {
    return this.info !== undefined;
  }

  has(capability: string): boolean {
    return this.info?.capabilities.includes(capability) ?? false;
  }

  call<T>(method: string, params: object = {}): Promise<T> {
    return this.rpc && this.info ? this.rpc.call<T>(method, params) : Promise.reject(new Error('not connected'));
  }

  /** Subscribes again with the present options. */
  async subscribe(): Promise<void> {
    await this.call('subscribe', this.options.subscription());
  }

  /** Tells the server that a frame was used, so that it may send more. */
  used(bytes: number): void {
    const credit = this.credit.used(bytes);
    if (credit > 0 && this.isOpen) this.rpc?.notify('credit', { bytes: credit });
  }

  private onNotification(rpc: Rpc, method: string, params: unknown): void {
    if (method === 'serverInfo') void this.handshake(rpc, params as ServerInfo);
    if (method === 'bookmark') {
      this.credit.idle();
      this.isBehind = false;
    }
    this.events.notification(method as keyof Notifications, params as never);
  }

  private async handshake(rpc: Rpc, info: ServerInfo): Promise<void> {
    const resume = this.isBehind ? undefined : this.options.resume();
    const token = this.options.token();
    this.credit = new CreditWindow();
    this.isRefused = false;
    try {
      const hello = await rpc.call<HelloReply>('hello', {
        client: this.options.client,
        tileFormats: ['rgb9e5', 'rgba16f'],
        codecs: ['deflate', 'none'],
        creditBytes: FIRST_WINDOW,
        ...(token ? { token } : {}),
        ...(resume && resume.epoch === info.epoch ? { resume } : {}),
      });
      this.info = info;
      if (!this.isBehind) this.attempt = 0;
      this.events.state('open', '');
      this.events.ready(info, hello);
      await this.subscribe();
      this.watch(rpc);
    } catch (error) {
      // After a refusal the server closes the connection; after any other error the page does.
      if (error instanceof RpcError) this.isRefused = error.code === UNAUTHENTICATED;
      else this.socket?.close();
    }
  }

  /** A sleeping machine or a dead route leaves a socket that looks open; only a call without an answer shows it. */
  private watch(rpc: Rpc): void {
    clearInterval(this.probe);
    this.probe = setInterval(() => void this.check(rpc), PROBE_MS);
  }

  /** Also called when the page wakes up. */
  async check(rpc: Rpc | undefined = this.rpc): Promise<void> {
    const socket = this.socket;
    if (!rpc || rpc !== this.rpc || !this.isOpen || !socket) return;
    const lost = setTimeout(() => {
      if (socket === this.socket) this.onClose(socket, 1006, 'no answer');
      socket.close();
    }, PROBE_PATIENCE_MS);
    await rpc.call('viewers').catch(() => undefined);
    clearTimeout(lost);
  }

  private forget(): void {
    this.socket = undefined;
    this.info = undefined;
    clearInterval(this.probe);
    this.rpc?.close();
    this.rpc = undefined;
  }

  private onClose(socket: WebSocket, code: number, reason: string): void {
    if (socket !== this.socket) return;
    this.forget();
    if (this.stopped) return;
    // The same code without a refusal means that hello came too late, on a busy machine.
    if (code === CLOSE_UNAUTHENTICATED && this.isRefused)
      return this.events.state('refused', reason || 'the token is missing or wrong');
    this.isBehind ||= code === CLOSE_OVERLOAD;
    const pause = pauseMs(this.attempt++, (this.options.random ?? Math.random)());
    this.events.state('waiting', describeClose(code, reason, pause));
    this.timer = setTimeout(() => this.open(), pause);
  }
}

function describeClose(code: number, reason: string, pause: number): string {
  const why =
    code === 1001
      ? 'the server has stopped'
      : code === CLOSE_OVERLOAD
        ? 'the server is overloaded'
        : code === 4408
          ? 'the network was too slow'
          : reason || 'the connection was lost';
  return `${why}; trying again in ${pause < 950 ? 'a moment' : `${Math.round(pause / 1000)} s`}`;
}
