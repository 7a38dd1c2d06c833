// What the page says of its connection, and how the user mends it.

import type { Connection, LinkState } from '../protocol/connection';
import type { Frame } from '../ui/frame';
import { addressedToken, type Access } from './access';

export class LinkNotice {
  private everOpen = false;
  private isRenaming = false;

  constructor(
    private readonly connection: Pick<Connection, 'isOpen' | 'open' | 'renew'>,
    private readonly access: Pick<Access, 'giveToken' | 'rename'>,
    private readonly frame: Pick<Frame, 'toasts' | 'setState' | 'setBanner' | 'askToken'>,
  ) {}

  start(): void {
    window.addEventListener('online', () => this.connection.open());
    window.addEventListener('hashchange', () => {
      const token = addressedToken();
      if (token) this.giveToken(token);
    });
  }

  show(state: LinkState, detail: string): void {
    const { frame } = this;
    if (state === 'open') {
      frame.setBanner('link', undefined);
      if (this.everOpen && !this.isRenaming) frame.toasts.show('Reconnected', 'good');
      this.everOpen = true;
      this.isRenaming = false;
    } else if (state === 'waiting') {
      frame.setState('Not connected', 'bad');
      frame.setBanner('link', `No connection: ${detail}.`, 'Try now', () => this.connection.open());
    } else if (state === 'refused') {
      frame.setState('Not connected', 'bad');
      frame.askToken(detail, (token) => this.giveToken(token));
    } else if (!this.everOpen) {
      frame.setState('Connecting', 'busy');
    }
  }

  /** A session cannot change its name: a new session resumes where this one is. */
  rename(person: string): void {
    this.access.rename(person);
    this.isRenaming = this.connection.isOpen;
    this.connection.renew();
  }

  private giveToken(token: string): void {
    this.access.giveToken(token);
    this.connection.open();
  }
}
