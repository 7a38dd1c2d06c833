// Short notes that disappear by themselves. Screen readers read them out. A note about a failure is not pushed out by
// notes about what others do.

import { plainText } from '../protocol/page_name';
import { button, h } from '../page/dom';

export type Tone = 'info' | 'good' | 'bad';

/** What the parts of the viewer tell the user. */
export interface Notes {
  show(text: string, tone?: Tone): void;
  showOnce(text: string): void;
}

const SHOWN_MS: Record<Tone, number> = { info: 4000, good: 3000, bad: 9000 };
const MOST = 4;
const MOST_LETTERS = 400;

export class Toasts implements Notes {
  readonly element = h('div', { class: 'toasts', role: 'status', 'aria-live': 'polite' });
  private readonly timers = new WeakMap<Element, ReturnType<typeof setTimeout>>();

  show(whole: string, tone: Tone = 'info'): void {
    const text = shortened(whole);
    this.find(text)?.remove(); // a new element is read out again, as the user has acted again
    const toast = h('div', { class: `toast ${tone}` }, h('span', {}, text));
    toast.append(button('×', () => toast.remove(), { 'aria-label': 'Dismiss' }));
    this.element.append(toast);
    while (this.element.children.length > MOST) this.leastOfAll().remove();
    this.goLater(toast, tone);
  }

  /**
   * For actions of others. A note that is there already stays, as screen readers would otherwise read it thirty times a
   * second while somebody drags.
   */
  showOnce(whole: string): void {
    const same = this.find(shortened(whole));
    if (same) this.goLater(same, 'info');
    else this.show(whole);
  }

  private find(text: string): Element | undefined {
    return [...this.element.children].find((note) => note.firstChild?.textContent === text);
  }

  /** The oldest note that is about no failure; the newest of all does not count. */
  private leastOfAll(): Element {
    const notes = [...this.element.children];
    return notes.slice(0, -1).find((note) => !note.classList.contains('bad')) ?? notes[0]!;
  }

  private goLater(note: Element, tone: Tone): void {
    clearTimeout(this.timers.get(note));
    this.timers.set(
      note,
      setTimeout(() => note.remove(), SHOWN_MS[tone]),
    );
  }
}

/** A scene may contain names of any length. */
function shortened(text: string): string {
  return plainText(text.length > MOST_LETTERS ? `${text.slice(0, MOST_LETTERS)}…` : text);
}
