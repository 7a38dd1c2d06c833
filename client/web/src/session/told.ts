// What the server has told of itself, of its solve and of its light. The session writes it; the other parts read it.

import type { Bookmark, Progress, Resume } from '../protocol/messages';

export interface Told {
  /** Of the server's run; empty until the first connection. */
  epoch: string;
  /** Of this connection. */
  progress: Progress | undefined;
  /** The version up to which all light has come over this connection and was decoded. */
  bookmark: Bookmark | undefined;
  /** The version up to which the page is known to hold all light; the next connection resumes from it. */
  resume: Resume | undefined;
}
