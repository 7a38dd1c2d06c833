// Short notes that go by themselves; the same note twice is one note. Read out by screen readers. What failed stays
// however much others do meanwhile.

import { plainText } from '../protocol/page_name';
import { button, h } from './dom';

export type Tone = 'info' | 'good' | 'bad';

const SHOWN_MS: Record<Tone, number> = { info: 4000, good: 3000, bad: 9000 };
const MOST = 4;
const MOST_LETTERS = 400;

export class Toasts {
  readonly element = h('div', { class: 'toasts', role: 'status', 'aria-live': 'polite' });
  private readonly timers = new WeakMap<Element, ReturnType<typeof setTimeout>>();

  show(whole: string, tone: Tone = 'info'): void {
    // Names of a scene may be as long as they like.
    const text = plainText(whole.length > MOST_LETTERS ? `${whole.slice(0, MOST_LETTERS)}…` : whole);
    const notes = [...this.element.children];
    const same = notes.find((note) => note.firstChild?.textContent === text);
    // What two people drag is told of thirty times a second each: put there anew, it would be read out as often.
    if (same?.classList.contains(tone)) return this.goLater(same, tone);
    same?.remove();
    const toast = h('div', { class: `toast ${tone}` }, h('span', {}, text));
    toast.append(button('×', () => toast.remove(), { 'aria-label': 'Dismiss' }));
    this.element.append(toast);
    while (this.element.children.length > MOST) this.leastOfAll().remove();
    this.goLater(toast, tone);
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
