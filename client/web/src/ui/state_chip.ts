// The state of the solve, in a few words, at the top of the page.

import { h } from '../page/dom';
import { Spaced } from '../page/spaced';

export type StateTone = 'busy' | 'good' | 'short' | 'bad' | 'idle';

interface State {
  text: string;
  tone: StateTone;
  error: string;
  rate: string;
}

export class StateChip {
  private readonly state = h('span', { class: 'state', role: 'status' }, 'Connecting');
  private readonly dot = h('span', { class: 'dot' });
  private readonly error = h('span', { class: 'error-now' });
  private readonly rate = h('span', { class: 'rate' });
  readonly element = h('span', { class: 'chip' }, this.dot, this.state, this.error, this.rate);
  private told: State | undefined;
  private readonly spaced = new Spaced(() => this.show());

  /** Shows the state a little later, but a failure at once. */
  set(state: State): void {
    this.told = state;
    if (state.tone === 'bad') this.spaced.now();
    else this.spaced.soon();
  }

  private show(): void {
    if (!this.told) return;
    const { text, tone, error, rate } = this.told;
    // Screen readers read a text again when it is written again, even if it is the same.
    for (const [element, wanted] of [
      [this.state, text],
      [this.error, error],
      [this.rate, rate],
    ] as const)
      if (element.textContent !== wanted) element.textContent = wanted;
    this.dot.className = `dot ${tone}`;
  }
}
