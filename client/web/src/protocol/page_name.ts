// The name by which the server tells others of this page: the user's name and a mark. Two pages of one user have
// different marks, so that each page recognises its own edits. Pure.

/** Characters of a user's name. With the mark the name keeps within the protocol's limit. */
export const LONGEST_NAME = 48;

const MARKED = /^(.+) \([a-z0-9]{4}\)$/s;

/** Characters of a name that is shown; other programs may have longer names. */
const LONGEST_SHOWN = 60;

/** Control characters, and characters that change the direction of the text after them. */
const TURNING = /[\u0000-\u001f\u007f-\u009f\u200e\u200f\u202a-\u202e\u2066-\u2069]/g;

/** A text by somebody else, without characters that would change how the text around it reads. */
export function plainText(text: string): string {
  return text.replace(TURNING, ' ').trim();
}

/** "Ann" for "Ann (x3fa)"; the names of other programs as they are. Empty: nothing of the name can be read. */
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

  /** The user's name; empty: the user has given none. */
  get person(): string {
    return this.called;
  }

  set person(called: string) {
    this.called = [...plainText(called)].slice(0, LONGEST_NAME).join('').trim();
  }

  /** The page's name while its user has none. */
  get unnamed(): string {
    return `viewer ${this.mark}`;
  }

  get client(): string {
    return this.called ? `${this.called} (${this.mark})` : this.unnamed;
  }

  /** Also true of an earlier name of this page. */
  isMine(client: string): boolean {
    return client === this.unnamed || client.endsWith(` (${this.mark})`);
  }
}
