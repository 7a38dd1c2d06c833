// A message over the picture that stays until its cause is gone. Of several causes it names the most important.

import { button, h } from '../page/dom';

/** What may be wrong, the most important first: without a connection nothing else can be mended. */
const CAUSES = ['link', 'card', 'solve'] as const;
export type Cause = (typeof CAUSES)[number];

export class Banner {
  readonly element = h('div', { class: 'banner', role: 'alert', hidden: true });
  private readonly contents = new Map<Cause, HTMLElement[]>();

  /** `text`: undefined: the cause is gone. `label` and `act`: a button. */
  set(about: Cause, text: string | undefined, label = '', act?: () => void): void {
    if (text === undefined) this.contents.delete(about);
    else this.contents.set(about, [h('span', {}, text), ...(act ? [button(label, act)] : [])]);
    this.show();
  }

  askToken(reason: string, give: (token: string) => void): void {
    const input = h('input', { type: 'password', 'aria-label': 'Token', autocomplete: 'off' });
    const form = h(
      'form',
      { class: 'token' },
      h('span', {}, `This server requires a token: ${reason}.`),
      input,
      h('button', {}, 'Connect'),
    );
    form.onsubmit = (event) => {
      event.preventDefault();
      if (input.value) give(input.value.trim());
    };
    this.contents.set('link', [form]);
    this.show();
    input.focus();
  }

  private show(): void {
    const first = CAUSES.map((cause) => this.contents.get(cause)).find((one) => one !== undefined);
    this.element.hidden = first === undefined;
    if (first && first[0] !== this.element.firstChild) this.element.replaceChildren(...first);
  }
}
