// The light meter: reads where the pointer is, and in the middle of the picture for those who have none. Part of the App.

import type { Vector3 } from 'three';
import type { App } from './app';
import { nodeName } from './document/gltf';
import { measured } from './ui/dom';
import { luminance } from './view/picker';

export class MeterSession {
  isOn = false;
  private pointer: { x: number; y: number; isSeen: boolean } | undefined;
  /** The pointer was on the picture and is elsewhere: nothing is pointed at, until keys aim. */
  private isAway = false;
  private waits = false;

  constructor(private readonly app: App) {}

  toggle(): void {
    const { frame } = this.app;
    this.isOn = !this.isOn;
    frame.setMeter(this.isOn);
    frame.canvas.classList.toggle('metering', this.isOn);
    if (this.isOn) this.read();
    else frame.meter.hide();
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
    // Where errors of single texels are not streamed, the scene's own stands for them.
    const error = reading.error ?? (lux === undefined ? undefined : lux * (this.app.progress?.error.total ?? NaN));
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
}

function position(point: Vector3): string {
  return `at ${point
    .toArray()
    .map((v) => measured(v))
    .join(', ')} m`;
}
