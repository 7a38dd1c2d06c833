// The whole document, asked for whenever the copy may not fit: once at a time, however often that is found. While somebody
// drags there are thirty revisions a second, and the document of a large scene takes longer than one of them. Pure.

export interface DocumentSource {
  /** What the server has now, and what makes it the copy. Rejects where it is not to be had, and may when aborted. */
  ask(signal: AbortSignal): Promise<{ revision: number; take: () => void }>;
  failed(error: Error): void;
}

export class DocumentFetch {
  /** The copy is not known to fit: what was asked for has not come yet, or did not come. */
  isOwed = false;
  private running: AbortController | undefined;
  /** Found while something is on its way: it has to be of this revision, or is asked for again. */
  private due: number | undefined;

  constructor(private readonly source: DocumentSource) {}

  /** `revision`: one that is at least as new will do; without it only one that is asked for from now on. */
  want(revision = Infinity): void {
    this.isOwed = true;
    if (this.running) this.due = Math.max(this.due ?? 0, revision);
    else void this.run((this.running = new AbortController()));
  }

  /** The connection is gone: what is on its way may be of a server that is not there any more. */
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
