// Which scene there is: its document from the server, files that this page sends, and who has loaded another. Part of the
// App.

import type { App } from '../app/app';
import type { Placed } from '../looking/view_session';
import { DocumentFetch } from '../document/document_fetch';
import type { Gltf } from '../document/gltf';
import { NOT_FOUND, type PastRevision, type SceneHistory } from '../protocol/messages';
import { shownName } from '../protocol/page_name';
import { ConnectionLost, RpcError } from '../protocol/rpc';

/** The scene that a server begins with, where nobody is known to have loaded it: nobody's work is replaced by it. */
const FIRST = 1;

/** What the server calls a scene that was sent to it without a name. */
const UNNAMED = 'unnamed scene';

/** What people are told of another scene, given the newest revisions; undefined: this revision is no load by anyone. */
export function loadNote(revisions: readonly PastRevision[], revision: number): string | undefined {
  const load = revisions.find((past) => past.revision === revision && past.kind === 'load');
  if (!load || (!load.by && revision === FIRST)) return undefined;
  return `${shownName(load.by ?? '') || 'Someone'} loaded ${sceneName(load.summary)}`;
}

/** Whether the scene of a revision was replaced; it counts as such where too much was done since for the history to tell. */
export function wasReplaced({ revisions }: SceneHistory, revision: number): boolean {
  const load = revisions.filter(({ kind }) => kind === 'load').at(-1);
  return load ? load.revision > revision : (revisions[0]?.revision ?? 0) > revision + 1;
}

function sceneName(summary: string | undefined): string {
  if (!summary) return 'another scene';
  return summary === UNNAMED ? 'a scene without a name' : summary;
}

/** A file that is on its way, where one looked from before it, and whether the server was asked to load it. */
interface Upload {
  abort: AbortController;
  placed: Placed;
  asked: boolean;
}

export class SceneSession {
  readonly document = new DocumentFetch({
    ask: (signal) => this.ask(signal),
    failed: (error) => this.onNone(error),
  });
  private upload: Upload | undefined;
  /** Revision of the newest scene that was told to be there: its first light may come before it, and all of it again. */
  private newest = 0;
  /** Revision of the newest load that was told of, or was this page's own. */
  private told = 0;
  /** Of a load that came while this page's own was asked for, and may be that; 0: none. */
  private untold = 0;

  constructor(private readonly app: App) {}

  /** Files that are dropped on the page. */
  takeDrops(): void {
    const setDropping = (on: boolean) => document.body.classList.toggle('dropping', on);
    window.addEventListener('dragover', (event) => {
      if (!event.dataTransfer?.types.includes('Files')) return; // a text or a picture of the page is no scene
      event.preventDefault();
      setDropping(true);
    });
    // Whatever is dragged leaves each part of the page for the next; of the page itself there is no next.
    window.addEventListener('dragleave', (event) => {
      if (!event.relatedTarget) setDropping(false);
    });
    window.addEventListener('drop', (event) => {
      setDropping(false);
      const file = event.dataTransfer?.files[0];
      if (!file) return;
      event.preventDefault();
      void this.loadFile(file);
    });
  }

  /** Its revisions count anew. */
  onServerAnew(): void {
    this.told = this.newest = 0;
    this.app.edit.document.leave('the server has restarted and no longer has this scene');
  }

  /** Over a connection that knows nothing of what was there before it. */
  async onUnresumed(): Promise<void> {
    const { document } = this.app.edit;
    const { revision } = document;
    const history = await this.app.connection.call<SceneHistory>('scene.history').catch(() => undefined);
    if (!history || !wasReplaced(history, revision)) return;
    this.app.edit.select(undefined);
    document.leave('another scene was loaded meanwhile');
  }

  /** Another one is there. Who has sent it from here is told by what sends it. */
  onLoaded(revision: number): void {
    const { app } = this;
    app.resume = undefined;
    if (revision !== this.newest && revision !== app.edit.document.revision) {
      app.edit.select(undefined); // numbers of nodes mean others now
      app.edit.document.leave('another scene was loaded');
    }
    this.newest = revision;
    app.view.sceneComes();
    app.edit.history.askSoon();
    this.document.want();
    void app.fetchStatus();
    if (this.upload?.asked) this.untold = revision;
    else void this.tellOfLoad(revision);
  }

  /** The server has none: it was started again without, could not have the one whose first light it showed, or lost it. */
  forget(): void {
    const { app } = this;
    if (!app.viewer.set) return;
    app.resume = undefined;
    app.viewer.clear();
    app.edit.document.reset({ asset: { version: '2.0' } }, app.progress!.revision);
    app.frame.sceneShown = false;
  }

  async loadFile(file: File): Promise<void> {
    const { toasts } = this.app.frame;
    const limit = this.app.connection.info?.limits['uploadBytes'] ?? Infinity;
    if (file.size > limit) return toasts.show(`${file.name} is larger than the server accepts`, 'bad');
    toasts.show(`Loading ${file.name}…`);
    this.upload?.abort.abort(); // the last one is meant, however long an earlier one takes
    const placed = this.upload?.placed ?? this.app.view.forgetCamera();
    const upload: Upload = (this.upload = { abort: new AbortController(), placed, asked: false });
    try {
      const url = await this.send(file, upload.abort.signal);
      // On the one connection: what is asked for later is loaded later, even if an upload that was given up arrives.
      if (upload !== this.upload) return;
      upload.asked = true;
      const loaded = await this.app.connection.call<{ revision: number; warnings: string[] }>('scene.load', { url });
      this.told = Math.max(this.told, loaded.revision);
      if (upload !== this.upload) return;
      const count = loaded.warnings.length;
      toasts.show(
        count ? `${file.name} loaded; ${count} warning${count > 1 ? 's' : ''}, see Solve` : `${file.name} loaded`,
        'good',
      );
    } catch (error) {
      if (upload !== this.upload) return;
      if (this.app.viewer.shown) this.app.view.keepCamera(placed);
      toasts.show(`${file.name}: ${(error as Error).message}`, 'bad');
      if (this.untold > 0) void this.tellOfLoad(this.untold); // it was somebody else's
    } finally {
      if (upload === this.upload) {
        this.upload = undefined;
        this.untold = 0;
      }
    }
  }

  /** Keeps the file on the server. Returns its URL there; rejects with what the server says against it. */
  private async send(file: File, signal: AbortSignal): Promise<string> {
    const response = await this.app.fetch(`/uploads?name=${encodeURIComponent(file.name)}`, {
      method: 'PUT',
      body: file,
      headers: { 'Content-Type': 'application/octet-stream' },
      signal,
    });
    return ((await response.json()) as { url: string }).url;
  }

  private async tellOfLoad(revision: number): Promise<void> {
    const { connection, frame } = this.app;
    if (revision <= this.told || !connection.has('scene.history')) return;
    const history = await connection.call<SceneHistory>('scene.history').catch(() => undefined);
    const note = loadNote(history?.revisions ?? [], revision);
    // The same scene may come twice: with its first light, which is not in the history yet, and whole.
    if (!note || revision <= this.told || this.isMine(history!.revisions, revision)) return;
    this.told = revision;
    frame.toasts.show(note);
  }

  /** Of a file that another one has followed since. */
  private isMine(revisions: readonly PastRevision[], revision: number): boolean {
    return revisions.some((past) => past.revision === revision && this.app.isMine(past.by ?? ''));
  }

  private async ask(signal: AbortSignal): Promise<{ revision: number; take: () => void }> {
    const { app } = this;
    const reply = await app.connection.call<{ revision: number; gltf?: Gltf; url?: string }>('scene.get');
    let { gltf, revision } = reply;
    if (!gltf) {
      const file = await app.fetch(reply.url!, { signal });
      revision = Number(file.headers.get('X-Revision') ?? revision); // it may be newer than the answer
      gltf = (await file.json()) as Gltf;
    }
    const whole = gltf;
    return { revision, take: () => app.edit.document.reset(whole, revision) };
  }

  private onNone(error: Error): void {
    if (error instanceof RpcError && error.code === NOT_FOUND) return; // there is none: the server's state says so
    if (!(error instanceof ConnectionLost))
      this.app.frame.toasts.show(`The scene could not be fetched: ${error.message}`, 'bad');
  }
}
