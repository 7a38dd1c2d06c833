// Which light the server streams to this page, and how often: less often on a slow network and for a hidden page.

import type { Connection } from '../protocol/connection';
import type { SubscribeParams } from '../protocol/messages';
import type { Notes } from '../ui/toast';

/** Below this rate, bytes a second, the network is slow. */
const SLOW_RATE = 400_000;
const SLOW_HZ = 2;
const HIDDEN_HZ = 0.5;

/** The light that the page can use now. */
export interface Streamed {
  quantity: string;
  /** The finest and the coarsest mip that it keeps. */
  minMip: number;
  maxMip: number;
}

export class LightStream {
  private slow = false;

  constructor(
    private readonly connection: Pick<Connection, 'isOpen' | 'credit' | 'subscribe'>,
    private readonly streamed: () => Streamed,
    private readonly notes: Pick<Notes, 'show'>,
  ) {}

  get subscription(): SubscribeParams {
    return { ...this.streamed(), maxHz: document.hidden ? HIDDEN_HZ : this.slow ? SLOW_HZ : 0 };
  }

  /** Tells the server that the page now wants other light. */
  async renew(): Promise<void> {
    if (this.connection.isOpen) await this.connection.subscribe().catch(() => undefined);
  }

  /** Leaves out intermediate versions of the light on a slow network. */
  adapt(): void {
    const { rate } = this.connection.credit;
    const slow = rate > 0 && rate < (this.slow ? 1.5 : 1) * SLOW_RATE;
    if (slow === this.slow) return;
    this.slow = slow;
    void this.renew();
    if (slow) this.notes.show('Slow network: light is updated less often');
  }
}
