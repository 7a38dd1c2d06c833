// The light meter: reads where the pointer is, and in the middle of the picture for those who have none. Part of the App.

import type { Vector3 } from 'three';
import type { App } from '../app/app';
import { TexelErrors } from './texel_errors';
import { nodeName } from '../document/gltf';
import { measured } from '../page/numbers';
import { type Reading } from '../view/rays/picker';
import { luminance } from '../page/colours';

export class MeterSession {
  isOn = false;
  private pointer: { x: number; y: number; isSeen: boolean } | undefined;
  /** The pointer was on the picture and is elsewhere: nothing is pointed at, until keys aim. */
  private isAway = false;
  private waits = false;
  private readonly errors: TexelErrors;

  constructor(private readonly app: App) {
    this.errors = new TexelErrors({
      ask: (place) => app.connection.call('texel', place),
      version: () => {
        const { progress, bookmark, connection } = app;
        if (!progress || !connection.has('texel')) return undefined;
        const tileVersion = Math.max(progress.tileVersion, bookmark?.tileVersion ?? 0);
        return { revision: progress.revision, tileVersion };
      },
      changed: () => this.onDrawn(),
    });
  }

  toggle(): void {
    const { frame } = this.app;
    this.isOn = !this.isOn;
    frame.setMeter(this.isOn);
    frame.canvas.classList.toggle('metering', this.isOn);
    if (this.isOn) this.read();
    else frame.meter.hide();
  }

  /** There is another session. */
  forget(): void {
    this.errors.forget();
  }

  /** After each picture: light may have changed, and what is under the pointer. */
  onDrawn(): void {
    if (this.isOn) this.read();
  }

  /** At most one reading a frame, however often the pointer tells of itself. */
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
    this.app.frame.meter.hide();
  }

  /** Who turns the picture by keys reads its middle, wherever the pointer lies. */
  aimByKeys(): void {
    if (!this.isAway) return;
    this.isAway = false;
    this.onDrawn();
  }

  private read(): void {
    const { viewer, frame } = this.app;
    if (this.isAway) return frame.meter.hide();
    const box = frame.canvas.getBoundingClientRect();
    const middle = { x: box.left + box.width / 2, y: box.top + box.height / 2, isSeen: false };
    const { x, y, isSeen } = this.pointer ?? middle;
    const reading = viewer.readAt(...frame.toDevice(x, y));
    if (!reading) return frame.meter.hide();
    const lux = reading.irradiance && luminance(reading.irradiance);
    const light = lux ?? (reading.isGap ? 'no surface here' : 'no light yet');
    const error = reading.error ?? this.askedError(reading);
    const details = [
      reading.irradiance ? reading.irradiance.map((c, i) => `${'RGB'[i]} ${measured(c)}`).join('  ') : '',
      this.app.view.mode.id === 'radiosity' && reading.radiosity !== undefined
        ? `radiosity ${measured(reading.radiosity)} lm/m²`
        : '',
      reading.node === undefined ? '' : nodeName(this.app.edit.document.gltf, reading.node),
      reading.texel ? `page ${reading.page}, texel ${reading.texel.join(', ')}` : '',
      reading.point ? position(reading.point) : '',
    ];
    frame.meter.show(x, y, light, error, details.filter((text) => text !== '').join('\n'), !isSeen);
  }

  /** Where errors are not streamed, and the texel is one of the server's and not a mean of several. */
  private askedError({ irradiance, page, texel }: Reading): number | undefined {
    if (!irradiance || page === undefined || !texel || this.app.viewer.set?.baseMip !== 0) return undefined;
    return this.errors.errorAt({ page, x: texel[0], y: texel[1] });
  }
}

function position(point: Vector3): string {
  return `at ${point
    .toArray()
    .map((v) => measured(v))
    .join(', ')} m`;
}
