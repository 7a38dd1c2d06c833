// What can be undone and redone: what was done in this page first, a whole drag at once; then what the server remembers,
// whoever did it. Part of the App.

import type { App } from '../app/app';
import type { SceneDocument } from '../document/scene_document';
import type { SceneHistory } from '../protocol/messages';

/** Between two questions: while somebody drags there are thirty revisions a second. */
const ASK_EVERY_MS = 500;
/** The newest edit that is not taken back is among so many revisions, or undo is offered without knowing it. */
const REVISIONS = 32;

interface Offer {
  undo: boolean;
  redo: boolean;
}

const NOTHING: Offer = { undo: false, redo: false };

/** What the server would do, given the revisions that took back what this page had done: undoing one would do it again. */
export function offerOf(history: SceneHistory, takenBack: ReadonlySet<number>): Offer {
  const newest = history.revisions.filter(({ kind, undone }) => kind === 'patch' && !undone).at(-1);
  const isOwnUndo = newest !== undefined && takenBack.has(newest.revision);
  return { undo: history.undoable > 0 && !isOwnUndo, redo: history.redoable > 0 };
}

export class EditHistory {
  private server = NOTHING;
  private timer: ReturnType<typeof setTimeout> | undefined;
  private lastAsked = -Infinity;
  private questions = 0;

  constructor(
    private readonly app: App,
    private readonly document: SceneDocument,
  ) {}

  /** The connection is new, or the scene has another revision. */
  askSoon(): void {
    const wait = Math.max(0, this.lastAsked + ASK_EVERY_MS - performance.now());
    this.timer ??= setTimeout(() => void this.ask(), wait);
  }

  /** What an earlier connection said of its server holds no more. */
  forget(): void {
    ++this.questions;
    this.server = NOTHING;
    this.show();
  }

  show(): void {
    const { undoStack, redoStack } = this.document;
    this.app.frame?.setHistory(this.server.undo || undoStack.length > 0, this.server.redo || redoStack.length > 0);
  }

  async undo(): Promise<void> {
    if (this.document.undoStack.length > 0) return this.document.undo();
    await this.onServer('undo');
  }

  async redo(): Promise<void> {
    if (this.document.redoStack.length > 0) return this.document.redo();
    await this.onServer('redo');
  }

  /**
   * Asks anew once all that this page has sent is answered: what is known is of before, and its newest edit may be one
   * that has just been taken back here.
   */
  private async onServer(step: keyof Offer): Promise<void> {
    await this.document.settled();
    const offer = await this.ask();
    if (offer[step]) await this.app.ask(`scene.${step}`);
    else if (this.app.connection.isOpen) this.app.frame.toasts.show(`Nothing to ${step}`);
  }

  private async ask(): Promise<Offer> {
    clearTimeout(this.timer);
    this.timer = undefined;
    const { connection } = this.app;
    if (!connection.has('scene.history')) {
      this.forget();
      return NOTHING;
    }
    const question = ++this.questions;
    this.lastAsked = performance.now();
    const answer = await connection.call<SceneHistory>('scene.history', { limit: REVISIONS }).catch(() => undefined);
    const offer = answer ? offerOf(answer, this.document.takenBack) : NOTHING;
    if (question === this.questions) {
      this.server = offer;
      this.show();
    }
    return offer;
  }
}
