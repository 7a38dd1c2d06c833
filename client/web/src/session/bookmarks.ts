// Takes bookmarks, by which the server says that it has sent all the light of a version.

import type { Bookmark, ServerInfo } from '../protocol/messages';
import type { Told } from './told';

export interface BookmarkHost {
  /** The session; another object after each handshake. */
  info(): ServerInfo | undefined;
  /** Pages that hold tiles of a quantity now. */
  setOf(quantity: string): { close(): void } | undefined;
  /** Calls once all tiles that came so far are decoded. */
  afterTiles(act: () => void): void;
  taken(): void;
}

export class Bookmarks {
  constructor(
    private readonly told: Pick<Told, 'epoch' | 'bookmark' | 'resume'>,
    private readonly host: BookmarkHost,
  ) {}

  /** Tiles that are still being decoded belong to the bookmark, too. */
  take(bookmark: Bookmark): void {
    const { host, told } = this;
    const { quantity, revision, tileVersion } = bookmark;
    const [info, set] = [host.info(), host.setOf(quantity)];
    host.afterTiles(() => {
      // The bookmark says nothing of a new layout, of another quantity, or of another session.
      if (!set || set !== host.setOf(quantity) || info !== host.info()) return;
      set.close();
      told.bookmark = bookmark;
      if (quantity === 'irradiance') told.resume = { epoch: told.epoch, revision, tileVersion };
      host.taken();
    });
  }
}
