// Which scene there is: the server's document of it, files that this page sends, and who has loaded another.

import { DocumentFetch } from '../document/document_fetch';
import type { Gltf } from '../document/gltf';
import type { SceneDocument } from '../document/scene_document';
import type { Server } from '../protocol/connection';
import { NOT_FOUND, type PastRevision, type Resume, type SceneHistory } from '../protocol/messages';
import { ConnectionLost, RpcError } from '../protocol/rpc';
import { sendable } from '../textures/sendable';
import type { Notes } from '../ui/toast';
import { loadNote, wasReplaced } from './load_note';

/**
 * A file that is on its way, the place that the user looked from before it, and whether the server was asked to load
 * it.
 */
interface Upload<Placed> {
  abort: AbortController;
  placed: Placed;
  asked: boolean;
}

/** `Placed`: the place that the user looks from, as the camera keeps it. */
export interface SceneHost<Placed> {
  server: Pick<Server, 'info' | 'has' | 'call'>;
  fetch(path: string, init?: RequestInit): Promise<Response>;
  notes: Pick<Notes, 'show'>;
  document: Pick<SceneDocument, 'revision' | 'leave' | 'reset'>;
  told: { resume: Resume | undefined };
  camera: { sceneComes(): void; forgetCamera(): Placed; keepCamera(before: Placed): void };
  picture: { readonly set: unknown; readonly shown: unknown; clear(): void };
  isMine(by: string): boolean;
  deselect(): void;
  /** Another scene is there: what was known of the solve and of the history is out of date. */
  loaded(): void;
}

export class SceneSession<Placed> {
  readonly document = new DocumentFetch({
    ask: (signal) => this.ask(signal),
    failed: (error) => this.onNone(error),
  });
  private upload: Upload<Placed> | undefined;
  /**
   * Revision of the newest scene. The server tells of a scene twice: with its first light, and when all of it is there.
   */
  private newest = 0;
  /** Revision of the newest load that the user was told of, or that this page asked for. */
  private told = 0;
  /** Revision of a load that came while this page waited for its own, and that may be its own; 0: none. */
  private untold = 0;

  constructor(private readonly host: SceneHost<Placed>) {}

  /** The server has restarted and counts revisions from the start. */
  onServerAnew(): void {
    this.told = this.newest = 0;
    this.host.document.leave('the server has restarted and no longer has this scene');
  }

  /** The new connection could not resume, so another scene may have been loaded meanwhile. */
  async onUnresumed(): Promise<void> {
    const { document, server } = this.host;
    const { revision } = document;
    const history = await server.call<SceneHistory>('scene.history').catch(() => undefined);
    if (!history || !wasReplaced(history, revision)) return;
    this.host.deselect();
    document.leave('another scene was loaded meanwhile');
  }

  /** Another scene is there. When this page has sent it, loadFile() tells the user. */
  onLoaded(revision: number): void {
    const { host } = this;
    host.told.resume = undefined;
    if (revision !== this.newest && revision !== host.document.revision) {
      host.deselect(); // the number of the selected node means another object now
      host.document.leave('another scene was loaded');
    }
    this.newest = revision;
    host.camera.sceneComes();
    this.document.want();
    host.loaded();
    if (this.upload?.asked) this.untold = revision;
    else void this.tellOfLoad(revision);
  }

  /** The server has no scene: it has restarted without one, or has lost the one that it had. */
  forget(revision: number): void {
    const { host } = this;
    if (!host.picture.set) return;
    host.told.resume = undefined;
    host.picture.clear();
    host.document.reset({ asset: { version: '2.0' } }, revision);
  }

  async loadFile(file: File): Promise<void> {
    const { notes, server, camera, picture } = this.host;
    const limit = server.info?.limits['uploadBytes'] ?? Infinity;
    if (file.size > limit) return notes.show(`${file.name} is larger than the server accepts`, 'bad');
    notes.show(`Loading ${file.name}…`);
    this.upload?.abort.abort(); // the user means the last file, however long an earlier one takes
    const placed = this.upload?.placed ?? camera.forgetCamera();
    const upload: Upload<Placed> = (this.upload = { abort: new AbortController(), placed, asked: false });
    try {
      const { signal } = upload.abort;
      const sent = await sendable(file, () => notes.show(`Unpacking the textures of ${file.name}…`), signal);
      if (sent.size > limit) throw new Error('its unpacked textures make it larger than the server accepts');
      const url = await this.send(sent, signal);
      // The calls go over one connection, so scenes are loaded in the order in which the user chose them.
      if (upload !== this.upload) return;
      upload.asked = true;
      const loaded = await server.call<{ revision: number; warnings: string[] }>('scene.load', { url });
      this.told = Math.max(this.told, loaded.revision);
      if (upload === this.upload) notes.show(loadedText(file.name, loaded.warnings.length), 'good');
    } catch (error) {
      if (upload !== this.upload) return;
      if (picture.shown) camera.keepCamera(placed);
      notes.show(`${file.name}: ${(error as Error).message}`, 'bad');
      if (this.untold > 0) void this.tellOfLoad(this.untold); // somebody else has loaded that scene
    } finally {
      if (upload === this.upload) {
        this.upload = undefined;
        this.untold = 0;
      }
    }
  }

  /** Keeps the file on the server and returns its URL there. Rejects with the reason that the server gives. */
  async send(file: File, signal?: AbortSignal): Promise<string> {
    const response = await this.host.fetch(`/uploads?name=${encodeURIComponent(file.name)}`, {
      method: 'PUT',
      body: file,
      headers: { 'Content-Type': 'application/octet-stream' },
      signal,
    });
    return ((await response.json()) as { url: string }).url;
  }

  private async tellOfLoad(revision: number): Promise<void> {
    const { server, notes } = this.host;
    if (revision <= this.told || !server.has('scene.history')) return;
    const history = await server.call<SceneHistory>('scene.history').catch(() => undefined);
    const note = loadNote(history?.revisions ?? [], revision);
    // The first message of a scene comes before the history knows of it: then the second one tells.
    if (!note || revision <= this.told || this.isMine(history!.revisions, revision)) return;
    this.told = revision;
    notes.show(note);
  }

  /** Also true of a file of this page that another of its files has followed since. */
  private isMine(revisions: readonly PastRevision[], revision: number): boolean {
    return revisions.some((past) => past.revision === revision && this.host.isMine(past.by ?? ''));
  }

  private async ask(signal: AbortSignal): Promise<{ revision: number; take: () => void }> {
    const { server, fetch, document } = this.host;
    const reply = await server.call<{ revision: number; gltf?: Gltf; url?: string }>('scene.get');
    let { gltf, revision } = reply;
    if (!gltf) {
      const file = await fetch(reply.url!, { signal });
      revision = Number(file.headers.get('X-Revision') ?? revision); // the file may be newer than the reply
      gltf = (await file.json()) as Gltf;
    }
    const whole = gltf;
    return { revision, take: () => document.reset(whole, revision) };
  }

  private onNone(error: Error): void {
    if (error instanceof RpcError && error.code === NOT_FOUND) return; // the state of the server says so, too
    if (!(error instanceof ConnectionLost))
      this.host.notes.show(`The scene could not be fetched: ${error.message}`, 'bad');
  }
}

function loadedText(name: string, warnings: number): string {
  return warnings > 0 ? `${name} loaded; ${warnings} warning${warnings > 1 ? 's' : ''}, see Solve` : `${name} loaded`;
}
