// Shares where this page looks from, and shows where the others do. Part of the App.

import type { Vector3 } from 'three';
import type { App } from '../app/app';
import type { SharedCamera } from '../protocol/messages';
import { RpcError } from '../protocol/rpc';
import { store, stored } from '../page/stored';
import { People } from '../view/controls/people';

/** Between two places told to the server. */
const TELL_EVERY_MS = 200;
const STORED = 'share-camera';

export class PeopleSession {
  readonly people: People;
  /** The user's choice; kept for the next visit. */
  sharing = stored(STORED) !== 'off';
  private me: number | undefined;
  private cameras: readonly SharedCamera[] = [];
  private others = 0;
  private told = '';
  private lastTold = -Infinity;
  private timer: ReturnType<typeof setTimeout> | undefined;
  private asking = false;

  constructor(private readonly app: App) {
    this.people = new People((eye, target) => this.visit(eye, target));
  }

  setSharing(on: boolean): void {
    this.sharing = on;
    store(STORED, on ? 'on' : 'off');
    if (on) return this.tellSoon();
    this.forget();
    if (this.app.connection.has('cameras')) this.app.connection.call('camera').catch(() => undefined);
  }

  /** A new session: the server knows nothing of this page's camera. */
  onReady(): void {
    this.forget();
    this.tellSoon();
  }

  onViewers(count: number): void {
    this.others = count - 1;
    this.tellSoon();
  }

  onCameras(cameras: readonly SharedCamera[]): void {
    if (!this.sharing) return; // was on its way when sharing ended
    this.cameras = cameras;
    this.show();
  }

  /** After each picture; the first of a move tells at once, and the last place is never left out. */
  tellSoon(): void {
    if (!this.sharing || this.others < 1 || this.timer !== undefined || this.asking) return;
    if (!this.app.connection.has('cameras') || this.place() === this.told) return;
    const wait = Math.max(0, this.lastTold + TELL_EVERY_MS - performance.now());
    this.timer = setTimeout(() => {
      this.timer = undefined;
      void this.tell();
    }, wait);
  }

  private async tell(): Promise<void> {
    const place = this.place();
    this.lastTold = performance.now();
    this.asking = true;
    try {
      const params = JSON.parse(place) as object;
      const { viewer } = await this.app.connection.call<{ viewer?: number }>('camera', params);
      this.told = place;
      this.me = viewer;
      this.show();
    } catch (error) {
      // A full board stays full for a while; anything else is over with the connection.
      if (error instanceof RpcError) this.lastTold = performance.now() + 5000;
    } finally {
      this.asking = false;
    }
    if (this.sharing) this.tellSoon();
    else this.setSharing(false); // ended while this was on its way
  }

  private place(): string {
    return JSON.stringify(this.app.viewer.rig.place);
  }

  private visit(eye: Vector3, target: Vector3): void {
    this.app.viewer.rig.lookFrom(eye, target);
  }

  private forget(): void {
    this.me = undefined;
    this.told = '';
    this.cameras = [];
    this.show();
  }

  /** Cameras may come before the answer that says which is this page's. */
  private show(): void {
    this.people.show(this.me === undefined ? [] : this.cameras.filter((camera) => camera.viewer !== this.me));
    this.app.viewer.invalidate();
  }
}
