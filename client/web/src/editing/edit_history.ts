// What can be undone and redone. Edits of this page come first, each drag as one step; then follow the edits that the
// server remembers, whoever made them.

import type { SceneDocument } from '../document/scene_document';
import type { Server } from '../protocol/connection';
import type { SceneHistory } from '../protocol/messages';
import type { Notes } from '../ui/toast';

/** Between two questions: a drag makes thirty revisions a second. */
const ASK_EVERY_MS = 500;
/**
 * So many revisions are searched for the newest edit that is not taken back; where it is older, undo is offered unseen.
 */
const REVISIONS = 32;

interface Offer {
  undo: boolean;
  redo: boolean;
}

const NOTHING: Offer = { undo: false, redo: false };

/**
 * What the server would do. `takenBack`: revisions by which this page took back its own edits. To undo such a revision
 * would make the edit again.
 */
export function offerOf(history: SceneHistory, takenBack: ReadonlySet<number>): Offer {
  const newest = history.revisions.filter(({ kind, undone }) => kind === 'patch' && !undone).at(-1);
  const isOwnUndo = newest !== undefined && takenBack.has(newest.revision);
  return { undo: history.undoable > 0 && !isOwnUndo, redo: history.redoable > 0 };
}

export interface EditHistoryHost {
  document: Pick<SceneDocument, 'undoStack' | 'redoStack' | 'takenBack' | 'undo' | 'redo' | 'settled'>;
  server: Pick<Server, 'isOpen' | 'has' | 'call'>;
  /** A refusal is shown to the user. */
  ask(method: string): Promise<unknown>;
  show(undo: boolean, redo: boolean): void;
  notes: Pick<Notes, 'show'>;
}

export class EditHistory {
  private server = NOTHING;
  private timer: ReturnType<typeof setTimeout> | undefined;
  private lastAsked = -Infinity;
  private questions = 0;

  constructor(private readonly host: EditHistoryHost) {}

  /** The connection is new, or the scene has a new revision. */
  askSoon(): void {
    const wait = Math.max(0, this.lastAsked + ASK_EVERY_MS - performance.now());
    this.timer ??= setTimeout(() => void this.ask(), wait);
  }

  /** The connection is gone, and with it what its server had offered. */
  forget(): void {
    ++this.questions;
    this.server = NOTHING;
    this.show();
  }

  show(): void {
    const { undoStack, redoStack } = this.host.document;
    this.host.show(this.server.undo || undoStack.length > 0, this.server.redo || redoStack.length > 0);
  }

  async undo(): Promise<void> {
    if (this.host.document.undoStack.length > 0) return this.host.document.undo();
    await this.onServer('undo');
  }

  async redo(): Promise<void> {
    if (this.host.document.redoStack.length > 0) return this.host.document.redo();
    await this.onServer('redo');
  }

  /**
   * Asks the server anew, once it has answered everything that this page has sent: the last answer is older than that,
   * and the newest edit may be one that this page has just taken back.
   */
  private async onServer(step: keyof Offer): Promise<void> {
    await this.host.document.settled();
    const offer = await this.ask();
    if (offer[step]) await this.host.ask(`scene.${step}`);
    else if (this.host.server.isOpen) this.host.notes.show(`Nothing to ${step}`);
  }

  private async ask(): Promise<Offer> {
    clearTimeout(this.timer);
    this.timer = undefined;
    const { server, document } = this.host;
    if (!server.has('scene.history')) {
      this.forget();
      return NOTHING;
    }
    const question = ++this.questions;
    this.lastAsked = performance.now();
    const answer = await server.call<SceneHistory>('scene.history', { limit: REVISIONS }).catch(() => undefined);
    const offer = answer ? offerOf(answer, document.takenBack) : NOTHING;
    if (question === this.questions) {
      this.server = offer;
      this.show();
    }
    return offer;
  }
}
