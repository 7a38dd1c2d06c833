// Who this page is to the server: its token, and the name that others see. Both are kept for the next visit.

import { store, stored } from '../page/stored';
import { PageName } from '../protocol/page_name';

/** HTTP with the page's token. Rejects with the reason that the server gives. */
export type Fetch = (path: string, init?: RequestInit) => Promise<Response>;

export class Access {
  readonly name = new PageName(stored('name') ?? '');
  private given = addressedToken() ?? stored('token', 'session');

  get token(): string | undefined {
    return this.given;
  }

  giveToken(token: string): void {
    this.given = token;
    store('token', token, 'session');
  }

  rename(person: string): void {
    this.name.person = person;
    store('name', this.name.person);
  }

  readonly fetch: Fetch = async (path, init = {}) => {
    const headers = new Headers(init.headers);
    if (this.given) headers.set('Authorization', `Bearer ${this.given}`);
    const response = await fetch(path, { ...init, headers, cache: 'no-store' });
    if (response.ok) return response;
    const body = (await response.json().catch(() => undefined)) as
      | { error?: { message: string; where?: string } }
      | undefined;
    const { message, where } = body?.error ?? { message: `HTTP ${response.status}` };
    throw new Error(where ? `${where}: ${message}` : message);
  };
}

/** The token of a link (#token=...). It is removed from the address so that nobody reads it there. */
export function addressedToken(): string | undefined {
  const hash = new URLSearchParams(location.hash.slice(1));
  const token = hash.get('token') ?? undefined;
  if (token) {
    store('token', token, 'session');
    hash.delete('token');
    history.replaceState(null, '', `#${hash}`);
  }
  return token;
}
