// Sends edits to the server. An edit waits while there is no connection, and after a new connection until it is known
// whether the scene that the edit was made for is still there.

import type { SendEdit } from '../document/scene_document';
import type { Server } from '../protocol/connection';
import type { ScenePatchReply } from '../protocol/messages';
import { ConnectionLost } from '../protocol/rpc';

export class EditSender {
  /** Ends when it is known whether edits that wait are still meant. */
  sceneKnown = Promise.resolve();
  private awaited: (() => void)[] = [];

  constructor(private readonly server: Pick<Server, 'isOpen' | 'call'>) {}

  /** The connection is open: edits that waited for it go on. */
  opened(): void {
    for (const resolve of this.awaited.splice(0)) resolve();
  }

  /** When the answer is lost, the edit is sent again with the same id, and the server makes it only once. */
  readonly send: SendEdit = async (edit, isMeant) => {
    for (;;) {
      if (!this.server.isOpen) await new Promise<void>((resolve) => this.awaited.push(resolve));
      await this.sceneKnown;
      if (!isMeant()) throw new Error('its scene is gone');
      try {
        return await this.server.call<ScenePatchReply>('scene.patch', edit);
      } catch (error) {
        if (!(error instanceof ConnectionLost) && this.server.isOpen) throw error;
      }
    }
  };
}
