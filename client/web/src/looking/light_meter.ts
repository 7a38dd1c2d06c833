// The light meter. It reads the place under the pointer, or the middle of the picture for users without a pointer.

import type { Vector3 } from 'three';
import { nodeName, type Gltf } from '../document/gltf';
import { luminance } from '../page/colours';
import { measured } from '../page/numbers';
import type { Server } from '../protocol/connection';
import type { Bookmark, Progress } from '../protocol/messages';
import type { Frame } from '../ui/frame';
import type { ViewMode } from '../view/looks/view_modes';
import type { Reading } from '../view/rays/picker';
import type { Viewer } from '../view/viewer';
import { TexelErrors } from './texel_errors';

export interface LightMeterHost {
  server: Pick<Server, 'has' | 'call'>;
  told: Readonly<{ progress: Progress | undefined; bookmark: Bookmark | undefined }>;
  picture: Pick<Viewer, 'readAt' | 'set'>;
  frame: Pick<Frame, 'canvas' | 'meter' | 'setMeter' | 'toDevice'>;
  mode(): ViewMode;
  gltf(): Gltf;
}

export class LightMeter {
  isOn = false;
  private pointer: { x: number; y: number; isSeen: boolean } | undefined;
  /** The pointer has left the picture, so the meter reads nothing until the user aims with the keys. */
  private isAway = false;
  private waits = false;
  private readonly errors: TexelErrors;

  constructor(private readonly host: LightMeterHost) {
    const { server, told } = host;
    this.errors = new TexelErrors({
      ask: (place) => server.call('texel', place),
      version: () => {
        const { progress, bookmark } = told;
        if (!progress || !server.has('texel')) return undefined;
        const tileVersion = Math.max(progress.tileVersion, bookmark?.tileVersion ?? 0);
        return { revision: progress.revision, tileVersion };
      },
      changed: () => this.onDrawn(),
    });
  }

  toggle(): void {
    const { frame } = this.host;
    this.isOn = !this.isOn;
    frame.setMeter(this.isOn);
    frame.canvas.classList.toggle('metering', this.isOn);
    if (this.isOn) this.read();
    else frame.meter.hide();
  }

  /** The session is another. */
  forget(): void {
    this.errors.forget();
  }

  /** After each picture: the light, or the surface under the pointer, may have changed. */
  onDrawn(): void {
    if (this.isOn) this.read();
  }

  /** Reads at most once a frame, however often the pointer moves. */
  pointTo({ clientX, clientY, pointerType }: PointerEvent): void {
    this.pointer = { x: clientX, y: clientY, isSeen: pointerType !== 'touch' };
    this.isAway = false;
    if (!this.isOn || this.waits) return;
    this.waits = true;
    requestAnimationFrame(() => {
      this.waits = false;
      this.onDrawn();
    });
  }

  leave(): void {
    this.pointer = undefined;
    this.isAway = true;
    this.host.frame.meter.hide();
  }

  /** A user who turns the picture with the keys reads its middle, wherever the pointer is. */
  aimByKeys(): void {
    if (!this.isAway) return;
    this.isAway = false;
    this.onDrawn();
  }

  private read(): void {
    const { picture, frame } = this.host;
    if (this.isAway) return frame.meter.hide();
    const box = frame.canvas.getBoundingClientRect();
    const middle = { x: box.left + box.width / 2, y: box.top + box.height / 2, isSeen: false };
    const { x, y, isSeen } = this.pointer ?? middle;
    const reading = picture.readAt(...frame.toDevice(x, y));
    if (!reading) return frame.meter.hide();
    const lux = reading.irradiance && luminance(reading.irradiance);
    const light = lux ?? (reading.isGap ? 'no surface here' : 'no light yet');
    const error = reading.error ?? this.askedError(reading);
    frame.meter.show(x, y, light, error, this.detailsOf(reading), !isSeen);
  }

  private detailsOf(reading: Reading): string {
    const details = [
      reading.irradiance ? reading.irradiance.map((c, i) => `${'RGB'[i]} ${measured(c)}`).join('  ') : '',
      this.host.mode().id === 'radiosity' && reading.radiosity !== undefined
        ? `radiosity ${measured(reading.radiosity)} lm/m²`
        : '',
      reading.node === undefined ? '' : nodeName(this.host.gltf(), reading.node),
      reading.texel ? `page ${reading.page}, texel ${reading.texel.join(', ')}` : '',
      reading.point ? position(reading.point) : '',
    ];
    return details.filter((text) => text !== '').join('\n');
  }

  /** Asks where the server does not stream errors and the texel is one of the server's, not a mean of several. */
  private askedError({ irradiance, page, texel }: Reading): number | undefined {
    if (!irradiance || page === undefined || !texel || this.host.picture.set?.baseMip !== 0) return undefined;
    return this.errors.errorAt({ page, x: texel[0], y: texel[1] });
  }
}

function position(point: Vector3): string {
  return `at ${point
    .toArray()
    .map((v) => measured(v))
    .join(', ')} m`;
}
