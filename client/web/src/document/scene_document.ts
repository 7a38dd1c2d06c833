// The viewer's copy of the scene, and the edits on their way to the server. What the user does shows at once; what the
// server refuses is taken back with its reason. One edit is on the way at a time: while somebody drags, later positions
// replace the one that waits. Main thread; knows no pictures.

import { STALE_REVISION, type Json, type Patch, type ScenePatchReply } from '../protocol/messages';
import { ConnectionLost, RpcError } from '../protocol/rpc';
import { redoOnServer, undoOnServer } from './edits';
import type { Gltf } from './gltf';
import { applyPatch, PatchError, sameJson } from './json_patch';

export interface EditEntry {
  label: string;
  forward: Patch;
  inverse: Patch;
}

/** What an edit is to the history: a step of it, one of them taken back or made again, or the end of one that shall not be. */
type Role = 'step' | 'undo' | 'redo' | 'cancel';

interface PendingEdit extends EditEntry {
  /** Edits with the same key replace each other while they wait, and are one step of undo. */
  key: string | undefined;
  requestId: string;
  /** Of the copy when it was made. */
  revision: number;
  /** Puts the copy back; empty while the edit is not shown. */
  shown: Patch;
  role: Role;
  confirmed: boolean;
  /** Its scene is gone, which was told. */
  left: boolean;
  done: (error?: Error) => void;
}

export interface DocumentEvents {
  /** Members below these pointers have other values now; empty: everything. */
  changed(pointers: string[]): void;
  refused(label: string, reason: string): void;
  historyChanged(): void;
}

/** An edit as the server hears of it, in the same words each time that it is sent. */
export interface SentEdit {
  patch: Patch;
  requestId: string;
  /** The revision that it was made at: the server refuses it where another scene was loaded since. */
  sameSceneAs: number;
}

/** `isMeant`: false once the scene that the edit was made for is known to be gone: it must not be sent (again). */
export type SendEdit = (edit: SentEdit, isMeant: () => boolean) => Promise<ScenePatchReply>;

const MAX_HISTORY = 200;

export class SceneDocument {
  gltf: Gltf = { asset: { version: '2.0' } };
  revision = 0;
  readonly undoStack: EditEntry[] = [];
  readonly redoStack: EditEntry[] = [];
  /** Revisions that took back what this page had done; to the server they are edits like others. */
  readonly takenBack = new Set<number>();
  private readonly waiting: (() => void)[] = [];
  lastEdit: Patch | undefined;
  private pending: PendingEdit[] = [];
  private gesture = 0;
  /** On its way to the server; no more of the list where that was taken away. */
  private sending: PendingEdit | undefined;
  private openKey: string | undefined;

  private generation = 0;
  /** Another scene is on the server: numbers of the copy's objects mean others there. */
  private isGone = false;

  /** `isMine`: whether the server tells of our patches under that name; nobody else's does. */
  constructor(
    private readonly isMine: (by: string) => boolean,
    private readonly send: SendEdit,
    private readonly events: DocumentEvents,
  ) {}

  /**
   * The document as the server has it. What waits to be sent is laid upon it; of what is on its way it is not known
   * whether the document has it already, which the notification will tell.
   */
  reset(gltf: Gltf, revision: number): void {
    this.gltf = gltf;
    this.revision = revision;
    this.isGone = false;
    this.pending = this.pending.filter((edit) => edit !== this.sending);
    for (const edit of this.pending) edit.shown = [];
    this.showPending();
    if (this.pending.length === 0) for (const done of this.waiting.splice(0)) done();
    this.undoStack.length = 0;
    this.redoStack.length = 0;
    this.takenBack.clear();
    this.openKey = undefined;
    ++this.generation;
    this.events.changed([]);
    this.events.historyChanged();
  }

  /**
   * Another scene is on the server, and its document follows: what has not been made was meant for objects of this one,
   * and would change whatever has their numbers there. Until then nothing is edited.
   */
  leave(reason: string): void {
    this.isGone = true;
    const left = this.pending.filter((edit) => !edit.confirmed);
    this.takeBackPending();
    this.pending = [];
    for (const done of this.waiting.splice(0)) done();
    for (const edit of left) {
      edit.left = true;
      edit.done(new Error(reason));
    }
    const last = left.at(-1);
    if (last) this.events.refused(last.label, reason);
  }

  /** A patch that the server has made, ours or someone else's. False: the copy does not fit; fetch the scene anew. */
  patched(revision: number, patch: Patch, by: string): boolean {
    if (revision <= this.revision) return true;
    if (revision !== this.revision + 1) return false; // one was lost on the way
    const first = this.pending[0];
    if (this.isMine(by) && first && sameJson(first.forward as unknown as Json, patch as unknown as Json)) {
      this.confirm(first, revision);
      return true;
    }
    // A server that was started again tells what it had made of ours in its own words.
    if (this.isMine(by) && first) return false;
    this.takeBackPending();
    try {
      applyPatch(this.json, patch);
    } catch (error) {
      if (error instanceof PatchError) return false;
      throw error;
    }
    this.revision = revision;
    this.showPending();
    this.events.changed(patch.map((operation) => operation.path));
    return true;
  }

  /**
   * Shows the edit and sends it. `key` marks the edits of one gesture. The promise ends with the server's answer, or
   * when a later edit of the gesture took this one's place.
   */
  edit(label: string, patch: Patch, key?: string): Promise<void> {
    return this.enqueue(label, patch, 'step', key);
  }

  /** Until every edit that was made here so far is answered. */
  async settled(): Promise<void> {
    while (this.pending.length > 0) await new Promise<void>((done) => this.waiting.push(done));
  }

  /** The gesture is over: the next edit with its key is a new step. Those on their way still belong to this one. */
  endGesture(): void {
    ++this.gesture;
  }

  /**
   * The gesture `kind` that is under way shall not have been: `patch` puts back what was there before it. Where the server
   * has heard of none of it, nor does it hear of this; no step of undo stays.
   */
  async cancelGesture(label: string, kind: string, patch: Patch): Promise<void> {
    const key = `${kind} #${this.gesture}`;
    this.endGesture();
    const dropped = this.dropWaiting(key);
    if (this.openKey === key || this.pending.some((edit) => edit.key === key))
      return this.enqueue(`Cancel ${label}`, patch, 'cancel', undefined, key);
    if (dropped) this.events.changed(patch.map((operation) => operation.path));
  }

  async undo(): Promise<void> {
    const entry = this.undoStack.pop();
    if (entry) await this.step('undo', entry, entry.inverse, this.undoStack, this.redoStack);
  }

  async redo(): Promise<void> {
    const entry = this.redoStack.pop();
    if (!entry) return;
    await this.step('redo', entry, redoOnServer(entry.forward), this.redoStack, this.undoStack);
  }

  private async step(role: Role, entry: EditEntry, patch: Patch, from: EditEntry[], to: EditEntry[]): Promise<void> {
    const label = `${role === 'undo' ? 'Undo' : 'Redo'} ${entry.label}`;
    this.openKey = undefined;
    const generation = this.generation;
    try {
      await this.enqueue(label, patch, role, undefined);
      if (generation === this.generation) to.push(entry);
    } catch (error) {
      // The reason was shown. What the server refuses it will refuse again, as where somebody else has undone it already:
      // that must not stand before the steps below.
      if (generation === this.generation && !(error instanceof RpcError)) from.push(entry);
    }
    this.events.historyChanged();
  }

  private get json(): Json {
    return this.gltf as unknown as Json;
  }

  /** The newest of a gesture's edits, where it is not on its way yet. */
  private dropWaiting(key: string): boolean {
    const waiting = this.pending.at(-1);
    if (!waiting || waiting === this.sending || waiting.key !== key) return false;
    this.takeBack(waiting);
    this.pending.pop();
    waiting.done();
    return true;
  }

  private enqueue(
    label: string,
    forward: Patch,
    role: Role,
    kind: string | undefined,
    key = kind === undefined ? undefined : `${kind} #${this.gesture}`,
  ): Promise<void> {
    return new Promise((resolve, reject) => {
      if (this.isGone) {
        const error = new Error('the server has another scene, which is still on its way');
        this.events.changed(forward.map((operation) => operation.path)); // what was dragged goes back
        this.events.refused(label, error.message);
        return reject(error);
      }
      if (key !== undefined) this.dropWaiting(key);
      const edit: PendingEdit = {
        label,
        forward,
        inverse: [],
        role,
        key,
        requestId: newRequestId(),
        revision: this.revision,
        shown: [],
        confirmed: false,
        left: false,
        done: (error) => (error ? reject(error) : resolve()),
      };
      this.pending.push(edit);
      this.show(edit);
      this.events.changed(forward.map((operation) => operation.path));
      void this.pump();
    });
  }

  /** An edit that does not fit the copy may fit the server's scene: it is sent all the same. */
  private show(edit: PendingEdit): void {
    if (edit.confirmed) return;
    try {
      edit.shown = applyPatch(this.json, edit.forward);
    } catch {
      edit.shown = [];
    }
  }

  private takeBack(edit: PendingEdit): void {
    if (edit.shown.length > 0) applyPatch(this.json, edit.shown);
    edit.shown = [];
  }

  private takeBackPending(): void {
    for (const edit of [...this.pending].reverse()) this.takeBack(edit);
  }

  private showPending(): void {
    for (const edit of this.pending) this.show(edit);
  }

  private async pump(): Promise<void> {
    if (this.sending) return;
    while (this.pending.length > 0) {
      const edit = (this.sending = this.pending[0]!);
      try {
        const { forward: patch, requestId, revision: sameSceneAs } = edit;
        const reply = await this.send({ patch, requestId, sameSceneAs }, () => !edit.left);
        this.confirm(edit, reply.revision);
        edit.done();
      } catch (error) {
        // It was made for another scene than the server has, of which news is on its way; so was all that waits.
        if (error instanceof RpcError && error.code === STALE_REVISION) this.leave('another scene was loaded');
        else this.refuse(edit, error as Error);
      }
      // A scene that came meanwhile has taken the list away, or the notification has taken the edit off it.
      if (this.pending[0] === edit) this.pending.shift();
    }
    this.sending = undefined;
    for (const done of this.waiting.splice(0)) done();
  }

  /**
   * The server has made this edit. It is the oldest of those on their way, so it lies right on top of what the server
   * had before: what was shown stays, and what puts it back is what undoes it. The notification comes first, as a rule;
   * the edit stays in the list, as nothing but a reminder, until the answer is there.
   */
  private confirm(edit: PendingEdit, revision: number): void {
    if (edit.confirmed || this.pending[0] !== edit) return;
    edit.confirmed = true;
    this.revision = Math.max(this.revision, revision);
    const inverse = edit.shown;
    edit.shown = [];
    this.lastEdit = edit.forward;
    if (edit.role === 'step') this.remember(edit, undoOnServer(edit.forward, inverse));
    if (edit.role === 'cancel') this.forgetStep(edit.key);
    if (edit.role === 'undo' || edit.role === 'cancel') this.takenBack.add(revision);
    this.events.historyChanged();
  }

  private remember(edit: PendingEdit, inverse: Patch): void {
    this.redoStack.length = 0;
    const last = this.undoStack.at(-1);
    if (last && edit.key !== undefined && edit.key === this.openKey) {
      last.forward = edit.forward;
    } else {
      this.undoStack.push({ label: edit.label, forward: edit.forward, inverse });
      if (this.undoStack.length > MAX_HISTORY) this.undoStack.shift();
    }
    this.openKey = edit.key;
  }

  private forgetStep(key: string | undefined): void {
    if (this.openKey === key) this.undoStack.pop();
    this.openKey = undefined;
  }

  private refuse(edit: PendingEdit, error: Error): void {
    if (edit.left) return;
    if (edit.confirmed) return edit.done(); // the answer was lost on its way, the notification was not
    if (this.pending[0] === edit) {
      this.takeBackPending();
      this.pending.shift();
      this.showPending();
    }
    this.events.changed(edit.forward.map((operation) => operation.path));
    this.events.refused(edit.label, reasonOf(error));
    edit.done(error);
  }
}

/** Pages without TLS have no crypto.randomUUID; nobody gains by guessing these. */
function newRequestId(): string {
  return `edit-${Date.now().toString(36)}-${Math.random().toString(36).slice(2)}`;
}

function reasonOf(error: Error): string {
  if (error instanceof RpcError) {
    const pointer = error.data.pointer;
    return pointer && !error.message.includes(pointer) ? `${error.message} (${pointer})` : error.message;
  }
  if (error instanceof ConnectionLost) return 'the connection was lost before the server answered';
  return error.message;
}
