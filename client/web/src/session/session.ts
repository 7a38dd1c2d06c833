// The page's session with the server. It opens the connection before the page is built, so that both take place at
// once.

import { Connection, type ConnectionEvents, type Server } from '../protocol/connection';
import type { Notes } from '../ui/toast';
import { Access } from './access';
import { EditSender } from './edit_sender';
import { LightStream, type Streamed } from './light_stream';
import type { Told } from './told';

export class Session {
  readonly access = new Access();
  readonly told: Told = { epoch: '', progress: undefined, bookmark: undefined, resume: undefined };
  readonly connection: Connection;
  readonly stream: LightStream;
  readonly sender: EditSender;
  private listener: ConnectionEvents | undefined;

  constructor(
    streamed: () => Streamed,
    private readonly notes: Pick<Notes, 'show'>,
  ) {
    const { access, told } = this;
    const name = () => access.name.client;
    this.connection = new Connection(
      {
        url: `${location.protocol === 'https:' ? 'wss' : 'ws'}://${location.host}/ws`,
        get client() {
          return name();
        },
        token: () => access.token,
        resume: () => told.resume,
        subscription: () => this.stream.subscription,
      },
      {
        state: (state, detail) => this.listener?.state(state, detail),
        ready: (info, hello) => this.listener?.ready(info, hello),
        notification: (method, params) => this.listener?.notification(method, params),
        tile: (frame) => this.listener?.tile(frame),
      },
    );
    this.stream = new LightStream(this.connection, streamed, notes);
    this.sender = new EditSender(this.connection);
    this.connection.open();
  }

  /** To be called in the same turn as the constructor: no message of the server arrives before the turn ends. */
  listen(listener: ConnectionEvents): void {
    this.listener = listener;
  }

  /** The call of an `Ask`. */
  async ask<T>(...[method, params]: Parameters<Server['call']>): Promise<T | undefined> {
    try {
      return await this.connection.call<T>(method, params);
    } catch (error) {
      this.notes.show((error as Error).message, 'bad');
      return undefined;
    }
  }
}
