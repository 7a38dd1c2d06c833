// Short notes that go by themselves; the same note twice is one note. Read out by screen readers.

import { button, h } from './dom';

export type Tone = 'info' | 'good' | 'bad';

const SHOWN_MS: Record<Tone, number> = { info: 4000, good: 3000, bad: 9000 };
const MOST = 4;
const MOST_LETTERS = 400;

export class Toasts {
  readonly element = h('div', { class: 'toasts', role: 'status', 'aria-live': 'polite' });

  show(whole: string, tone: Tone = 'info'): void {
    // Names of a scene may be as long as they like.
    const text = whole.length > MOST_LETTERS ? `${whole.slice(0, MOST_LETTERS)}…` : whole;
    for (const old of this.element.children) if (old.firstChild?.textContent === text) old.remove();
    const toast = h('div', { class: `toast ${tone}` }, h('span', {}, text));
    toast.append(button('×', () => toast.remove(), { 'aria-label': 'Dismiss' }));
    this.element.append(toast);
    while (this.element.children.length > MOST) this.element.firstElementChild?.remove();
    setTimeout(() => toast.remove(), SHOWN_MS[tone]);
  }
}
