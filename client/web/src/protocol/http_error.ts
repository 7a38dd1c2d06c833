// What the server refuses a request of HTTP with.

/** Of another state than the one that was asked for. */
export const CONFLICT = 409;

export class HttpError extends Error {
  constructor(
    message: string,
    readonly status: number,
  ) {
    super(message);
  }
}
