// Shares where this page looks from, and shows where the others look from.

import type { Vector3 } from 'three';
import { store, stored } from '../page/stored';
import type { Server } from '../protocol/connection';
import type { SharedCamera } from '../protocol/messages';
import { RpcError } from '../protocol/rpc';
import { People } from '../view/controls/people';
import type { CameraRig } from '../view/controls/camera_rig';

/** Between two places that the page tells the server. */
const TELL_EVERY_MS = 200;
/** The server refuses a camera while many others are shared; that lasts for a while. */
const REFUSED_MS = 5000;
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

  /** `changed`: other cameras are to be drawn. */
  constructor(
    private readonly server: Pick<Server, 'has' | 'call'>,
    private readonly rig: Pick<CameraRig, 'place' | 'lookFrom'>,
    private readonly changed: () => void,
  ) {
    this.people = new People((eye: Vector3, target: Vector3) => rig.lookFrom(eye, target));
  }

  setSharing(on: boolean): void {
    this.sharing = on;
    store(STORED, on ? 'on' : 'off');
    if (on) return this.tellSoon();
    this.forget();
    if (this.server.has('cameras')) this.server.call('camera').catch(() => undefined);
  }

  /** The session is new, and its server does not know this page's camera. */
  onReady(): void {
    this.forget();
    this.tellSoon();
  }

  onViewers(count: number): void {
    this.others = count - 1;
    this.tellSoon();
  }

  onCameras(cameras: readonly SharedCamera[]): void {
    if (!this.sharing) return; // the message was on its way when sharing ended
    this.cameras = cameras;
    this.show();
  }

  /** After each picture. The first place of a move is told at once, and the last is never left out. */
  tellSoon(): void {
    if (!this.sharing || this.others < 1 || this.timer !== undefined || this.asking) return;
    if (!this.server.has('cameras') || this.place() === this.told) return;
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
      const { viewer } = await this.server.call<{ viewer?: number }>('camera', JSON.parse(place) as object);
      this.told = place;
      this.me = viewer;
      this.show();
    } catch (error) {
      // Any other error means that the connection is gone.
      if (error instanceof RpcError) this.lastTold = performance.now() + REFUSED_MS;
    } finally {
      this.asking = false;
    }
    if (this.sharing) this.tellSoon();
    else this.setSharing(false); // sharing ended during the call
  }

  private place(): string {
    return JSON.stringify(this.rig.place);
  }

  private forget(): void {
    this.me = undefined;
    this.told = '';
    this.cameras = [];
    this.show();
  }

  /** The cameras may come before the answer that tells which of them is this page's. */
  private show(): void {
    this.people.show(this.me === undefined ? [] : this.cameras.filter((camera) => camera.viewer !== this.me));
    this.changed();
  }
}
