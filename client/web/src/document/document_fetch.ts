// Fetches the whole document when the page's copy may differ from the server's. Only one request runs at a time: a drag
// makes thirty revisions a second, and the document of a large scene takes longer than one of them. Pure.

export interface DocumentSource {
  /**
   * The server's document; `take` makes it the page's copy. Rejects when there is none, and may reject when aborted.
   */
  ask(signal: AbortSignal): Promise<{ revision: number; take: () => void }>;
  failed(error: Error): void;
}

export class DocumentFetch {
  /** The copy may differ from the server's document, which has not come yet, or failed to come. */
  isOwed = false;
  private running: AbortController | undefined;
  /** The running request must bring at least this revision; otherwise another request follows. */
  private due: number | undefined;

  constructor(private readonly source: DocumentSource) {}

  /** `revision`: the oldest that will do; without it, only a document that is asked for from now on will do. */
  want(revision = Infinity): void {
    this.isOwed = true;
    if (this.running) this.due = Math.max(this.due ?? 0, revision);
    else void this.run((this.running = new AbortController()));
  }

  /** The connection is gone: the running request may be to a server that no longer exists. */
  forget(): void {
    this.running?.abort();
    this.running = undefined;
    this.due = undefined;
  }

  private async run(running: AbortController): Promise<void> {
    let has = -Infinity;
    try {
      const { revision, take } = await this.source.ask(running.signal);
      if (running !== this.running) return;
      take();
      has = revision;
      this.isOwed = false;
    } catch (error) {
      if (running !== this.running) return;
      this.source.failed(error as Error);
    }
    const again = this.due !== undefined && this.due > has;
    this.running = this.due = undefined;
    if (again) this.want();
  }
}
