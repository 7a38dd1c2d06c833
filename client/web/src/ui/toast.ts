// Short notes that go by themselves; the same note twice is one note. Read out by screen readers. What failed stays
// however much others do meanwhile.

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
    this.find(text)?.remove(); // what one does again is answered, and read out, again
    const toast = h('div', { class: `toast ${tone}` }, h('span', {}, text));
    toast.append(button('×', () => toast.remove(), { 'aria-label': 'Dismiss' }));
    this.element.append(toast);
    while (this.element.children.length > MOST) this.leastOfAll().remove();
    this.goLater(toast, tone);
  }

  /**
   * Of what others do: what they drag is told of thirty times a second, and would be read out as often if it were put
   * there anew each time.
   */
  showOnce(whole: string): void {
    const same = this.find(shortened(whole));
    if (same) this.goLater(same, 'info');
    else this.show(whole);
  }

  private find(text: string): Element | undefined {
    return [...this.element.children].find((note) => note.firstChild?.textContent === text);
  }

  /** The oldest of those that tell of nothing wrong, but for the newest of all. */
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

/** Names of a scene may be as long as they like. */
function shortened(text: string): string {
  return plainText(text.length > MOST_LETTERS ? `${text.slice(0, MOST_LETTERS)}…` : text);
}
