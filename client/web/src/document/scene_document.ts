// The viewer's copy of the scene, and the edits that wait for the server. An edit shows at once; if the server refuses
// it, it is taken back and the reason is shown. One edit is sent at a time: during a drag, later positions replace the
// one that waits. Main thread; knows nothing of pictures.

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

/** What an edit is to the history: a new step, an undone or a redone step, or the cancellation of one. */
type Role = 'step' | 'undo' | 'redo' | 'cancel';

interface PendingEdit extends EditEntry {
  /** Edits with the same key replace each other while they wait, and make one step of undo. */
  key: string | undefined;
  requestId: string;
  /** Revision of the copy when the edit was made. */
  revision: number;
  /** Takes the edit out of the copy again; empty while the copy does not show the edit. */
  shown: Patch;
  role: Role;
  confirmed: boolean;
  /** The edit's scene is gone, and the user was told so. */
  left: boolean;
  done: (error?: Error) => void;
}

export interface DocumentEvents {
  /** Members below these pointers have changed; no pointers: everything has. */
  changed(pointers: string[]): void;
  refused(label: string, reason: string): void;
  historyChanged(): void;
}

/** An edit as it is sent to the server; the same each time that it is sent. */
export interface SentEdit {
  patch: Patch;
  requestId: string;
  /** Revision that the edit was made at: the server refuses the edit if another scene was loaded since. */
  sameSceneAs: number;
}

/** `isMeant`: false once the edit's scene is known to be gone; then the edit must not be sent, or sent again. */
export type SendEdit = (edit: SentEdit, isMeant: () => boolean) => Promise<ScenePatchReply>;

const MAX_HISTORY = 200;

export class SceneDocument {
  gltf: Gltf = { asset: { version: '2.0' } };
  revision = 0;
  readonly undoStack: EditEntry[] = [];
  readonly redoStack: EditEntry[] = [];
  /** Revisions by which this page took back its own edits; to the server they are edits like others. */
  readonly takenBack = new Set<number>();
  private readonly waiting: (() => void)[] = [];
  lastEdit: Patch | undefined;
  private pending: PendingEdit[] = [];
  private gesture = 0;
  /** The edit on its way to the server. It is no longer in `pending` after a reset. */
  private sending: PendingEdit | undefined;
  private openKey: string | undefined;

  private generation = 0;
  /** The server has another scene, in which the numbers of the copy's objects mean other objects. */
  private isGone = false;

  /** `isMine`: whether a patch by that name is this page's own. */
  constructor(
    private readonly isMine: (by: string) => boolean,
    private readonly send: SendEdit,
    private readonly events: DocumentEvents,
  ) {}

  /**
   * Takes the server's document as the copy, and shows the waiting edits in it. The document may or may not contain the
   * edit that is on its way: the notification will tell.
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
   * The server has another scene, and its document follows. Edits that wait were meant for this scene and would change
   * the wrong objects, so they are dropped. Until the document is here nothing can be edited.
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

  /** The server has applied a patch, ours or someone else's. False: the copy is wrong and must be fetched again. */
  patched(revision: number, patch: Patch, by: string): boolean {
    if (revision <= this.revision) return true;
    if (revision !== this.revision + 1) return false; // one was lost on the way
    const first = this.pending[0];
    if (this.isMine(by) && first && sameJson(first.forward as unknown as Json, patch as unknown as Json)) {
      this.confirm(first, revision);
      return true;
    }
    // A server that has restarted repeats our patch in its own words.
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
   * when a later edit of the gesture takes the place of this one.
   */
  edit(label: string, patch: Patch, key?: string): Promise<void> {
    return this.enqueue(label, patch, 'step', key);
  }

  /** Ends when the server has answered all edits that were made here. */
  async settled(): Promise<void> {
    while (this.pending.length > 0) await new Promise<void>((done) => this.waiting.push(done));
  }

  /**
   * The gesture is over, and the next edit with its key is a new step. Edits on their way still belong to the gesture.
   */
  endGesture(): void {
    ++this.gesture;
  }

  /**
   * Cancels the gesture `kind`, without leaving a step of undo. `patch` restores the state before the gesture; it is
   * sent only if the server knows of the gesture.
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
      // The reason was shown. The server would refuse the step again (somebody else may have undone it), so the step is
      // dropped: otherwise the user could not reach the steps below it.
      if (generation === this.generation && !(error instanceof RpcError)) from.push(entry);
    }
    this.events.historyChanged();
  }

  private get json(): Json {
    return this.gltf as unknown as Json;
  }

  /** Drops the newest edit of a gesture, unless it is on its way already. */
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
        this.events.changed(forward.map((operation) => operation.path)); // a dragged object returns
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

  /** An edit that does not fit the copy is sent all the same, as it may fit the server's scene. */
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
        // The edit, and all that wait, were made for another scene than the server has; a message about it follows.
        if (error instanceof RpcError && error.code === STALE_REVISION) this.leave('another scene was loaded');
        else this.refuse(edit, error as Error);
      }
      // A new scene may have replaced the list meanwhile, or the edit may have been refused.
      if (this.pending[0] === edit) this.pending.shift();
    }
    this.sending = undefined;
    for (const done of this.waiting.splice(0)) done();
  }

  /**
   * The server has made this edit. As the oldest pending edit it lies directly on the server's last state, so the patch
   * that takes it out of the copy also undoes it on the server. As a rule the notification comes before the answer;
   * until then the edit stays in the list.
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
    if (edit.confirmed) return edit.done(); // only the answer was lost; the notification has come
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

/** Pages without TLS have no crypto.randomUUID. Nobody gains by guessing these. */
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
