// JSON-RPC 2.0 over one open WebSocket: calls with answers by id, notifications by method.

import type { Json } from './messages';

/** The server has refused a call. */
export class RpcError extends Error {
  constructor(
    readonly code: number,
    message: string,
    readonly data: { pointer?: string; op?: number; revision?: number } = {},
  ) {
    super(message);
  }
}

/** The connection was lost before the answer came; the server may or may not have received the call. */
export class ConnectionLost extends Error {
  constructor() {
    super('the connection was lost before the answer came');
  }
}

export interface TextSocket {
  readonly readyState: number;
  send(text: string): void;
}

const OPEN = 1; // of a WebSocket

interface Waiting {
  resolve: (result: unknown) => void;
  reject: (error: Error) => void;
}

export class Rpc {
  private nextId = 1;
  private readonly waiting = new Map<number, Waiting>();

  constructor(
    private readonly socket: TextSocket,
    private readonly onNotification: (method: string, params: unknown) => void,
  ) {}

  call<T>(method: string, params: object = {}): Promise<T> {
    const id = this.nextId++;
    return new Promise<T>((resolve, reject) => {
      this.waiting.set(id, { resolve: resolve as (result: unknown) => void, reject });
      try {
        this.send({ jsonrpc: '2.0', id, method, params });
      } catch {
        this.waiting.delete(id);
        reject(new ConnectionLost());
      }
    });
  }

  notify(method: string, params: object): void {
    this.send({ jsonrpc: '2.0', method, params });
  }

  /** Sends nothing into a closing socket, as browsers complain of that; close() ends the calls that wait. */
  private send(message: object): void {
    if (this.socket.readyState === OPEN) this.socket.send(JSON.stringify(message));
  }

  /** Reads a text frame. Drops text that is no JSON-RPC message. */
  receive(text: string): void {
    let message: unknown;
    try {
      message = JSON.parse(text);
    } catch {
      return;
    }
    for (const one of Array.isArray(message) ? message : [message]) this.take(one);
  }

  /** No more answers will come. */
  close(): void {
    this.rejectAll(() => new ConnectionLost());
  }

  private take(message: unknown): void {
    if (typeof message !== 'object' || message === null) return;
    const { id, method, params, result, error } = message as Record<string, Json>;
    if (typeof method === 'string') return this.onNotification(method, params ?? {});
    const refusal = error && typeof error === 'object' && !Array.isArray(error) ? refusalOf(error) : undefined;
    // The server could not read a message, so it cannot tell which. None would wait for an answer that never comes.
    if (id === null && refusal) return this.rejectAll(() => refusal);
    const waiting = typeof id === 'number' ? this.waiting.get(id) : undefined;
    if (!waiting) return;
    this.waiting.delete(id as number);
    if (refusal) waiting.reject(refusal);
    else waiting.resolve(result);
  }

  private rejectAll(error: () => Error): void {
    const all = [...this.waiting.values()];
    this.waiting.clear();
    for (const { reject } of all) reject(error());
  }
}

function refusalOf({ code, message, data }: { [member: string]: Json }): RpcError {
  return new RpcError(Number(code), String(message), (data ?? {}) as RpcError['data']);
}
