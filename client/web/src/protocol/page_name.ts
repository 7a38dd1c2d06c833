// The name under which the server tells others of this page: what its user is called, and a mark. Two pages of one user
// have different ones, so that each knows its own edits when it is told of them. Pure.

/** Characters of what a user is called; with the mark it stays within what the protocol allows. */
export const LONGEST_NAME = 48;

const MARKED = /^(.+) \([a-z0-9]{4}\)$/s;

/** Characters of names that are shown, of which programs may have longer ones. */
const LONGEST_SHOWN = 60;

/** Control characters, and those that turn the direction of all the text that follows them. */
const TURNING = /[\u0000-\u001f\u007f-\u009f\u200e\u200f\u202a-\u202e\u2066-\u2069]/g;

/** Of a text that others have written: nothing of it changes how the text around it reads. */
export function plainText(text: string): string {
  return text.replace(TURNING, ' ').trim();
}

/** "Ann" of "Ann (x3fa)"; names of other programs as they are. Empty where there is nothing to be read. */
export function shownName(client: string): string {
  const plain = plainText(MARKED.exec(client)?.[1] ?? client);
  const letters = [...plain];
  return letters.length > LONGEST_SHOWN ? `${letters.slice(0, LONGEST_SHOWN).join('')}…` : plain;
}

export class PageName {
  private readonly mark = Math.random().toString(36).slice(2, 6).padEnd(4, '0');
  private called = '';

  constructor(called: string) {
    this.person = called;
  }

  /** What the user is called; empty: not said. */
  get person(): string {
    return this.called;
  }

  set person(called: string) {
    this.called = [...plainText(called)].slice(0, LONGEST_NAME).join('').trim();
  }

  /** How the page is called where its user is not. */
  get unnamed(): string {
    return `viewer ${this.mark}`;
  }

  get client(): string {
    return this.called ? `${this.called} (${this.mark})` : this.unnamed;
  }

  /** Also by an earlier name of this page. */
  isMine(client: string): boolean {
    return client === this.unnamed || client.endsWith(` (${this.mark})`);
  }
}
