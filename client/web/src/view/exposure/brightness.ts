// Decides when the exposure of the picture and the range of its false colours are measured, and from what. Rests
// between measurements, as the picture itself needs the card.

import type { PerspectiveCamera, Scene, WebGLRenderer } from 'three';
import { ExposureMeter, exposureOf } from './exposure';
import type { Layouts } from '../scene/layouts';
import { LightGate } from './light_gate';
import type { ViewUniforms } from '../scene/lit_material';
import { exposureByRays } from './ray_exposure';
import type { SkyBackground } from '../scene/sky';
import { shownLight, type ViewMode } from '../looks/view_modes';

const MEASURE_EVERY_MS = 250;
/** A measurement waits for all that the card has to draw. The rest after it is so many times as long. */
const MEASURE_SHARE = 8;
/** Longest rest: a measurement of the first light takes long on a slow card, and is soon out of date. */
const MOST_PAUSE_MS = 1500;

/** The dark end of the radiosity scale, as a part of the dark end of the irradiance scale. */
const DARKEST = 0.1;
/** The dark end of the scale of unshot light, as a part of the bright end of the irradiance scale. */
const LEAST_UNSHOT = 0.01;

/** The picture that is measured. */
export interface Picture {
  readonly renderer: WebGLRenderer;
  readonly uniforms: ViewUniforms;
  readonly layouts: Layouts;
  readonly world: Scene;
  readonly camera: PerspectiveCamera;
  readonly background: SkyBackground;
  mode(): ViewMode | undefined;
  /** Draws without signs and handles, which are no part of the scene's light. */
  withoutSigns<T>(draw: () => T): T;
  /** The card is idle or quick, so that fetching a result from it does not hold the page up. */
  isCardQuiet(): boolean;
  /** The exposure or the range has changed. */
  redraw(): void;
}

export class Brightness {
  readonly exposure: ExposureMeter;
  /** The range of false colours follows the light. */
  autoRange = true;
  /** False: no known value is above 0, so there is no range. */
  hasRange = true;
  /** The scene that is shown took the place of another scene's light. */
  replacesLight = false;
  private readonly gate = new LightGate();
  /** The picture has changed since the range, or the exposure, was measured. */
  private rangeDue = true;
  private exposureDue = true;
  private lastRange = 0;
  private lastMeasure = 0;
  /** The turn in which the exposure of the first light was computed without a picture. */
  private guessedAt = -1;
  /** The last known range of irradiance, lux. */
  private lightRange: [number, number] | undefined;

  constructor(private readonly picture: Picture) {
    this.exposure = new ExposureMeter(picture.renderer, picture.uniforms, () => picture.isCardQuiet());
  }

  /** The picture has changed. */
  changed(): void {
    this.rangeDue = true;
    this.exposureDue = true;
  }

  /** Another view, whose light may have another exposure. */
  setMode(mode: ViewMode): void {
    this.exposure.setLight(shownLight(mode));
    if (this.exposure.unknown) this.guessOfPages();
    this.updateRange();
    this.changed();
  }

  /** Once a turn of the page. */
  turn(now: number): void {
    this.gate.turn(now, this.picture.layouts.shown?.set.lit === true && this.exposure.unknown, this.replacesLight);
    this.measureRange(now);
    this.measureExposure(now);
  }

  /** Light must not be shown yet, as its exposure is unknown. */
  holdsLightBack(now: number): boolean {
    return this.gate.isClosed(now);
  }

  /** Nothing is to be drawn, so that the measurement is soon there; or because it took the whole turn. */
  standsStill(now: number): boolean {
    return this.gate.standsStill(now) || this.guessedAt === now;
  }

  /** Ends when the exposure fits the light that is there now. */
  async settle(): Promise<void> {
    // The first measurement may have begun before the light came.
    for (let again = 0; again < 2 && this.picture.layouts.shown; ++again) await this.measureNow();
    this.exposure.settle();
    this.exposure.step(0);
  }

  /**
   * The scale of unshot light is that of irradiance: on a scale of its own the little that is left at the end would
   * look like much. While unshot light is streamed, no irradiance comes, so the last known range stays.
   */
  updateRange(): void {
    this.hasRange = true;
    if (!this.autoRange) return;
    const { uniforms, layouts } = this.picture;
    const mode = this.picture.mode();
    const isUnshot = mode?.quantity === 'unshot';
    const isOfLight = isUnshot || mode?.quantity === 'irradiance';
    const set = isOfLight ? layouts.shown?.set : layouts.shownData;
    const range = set?.range() ?? (isUnshot ? this.lightRange : undefined);
    this.hasRange = range !== undefined || mode?.id === 'radiosity'; // lamps have radiosity even if they light nothing
    if (!range) return;
    if (isOfLight) this.lightRange = range;
    const [low, high] = range;
    const darkest = isUnshot ? LEAST_UNSHOT * high : mode?.id === 'radiosity' ? DARKEST * low : low;
    uniforms.all.falseRange.value.set(darkest, high);
  }

  /** Changes during a pause, as by the last tiles of a solve, are measured after it. */
  private measureRange(now: number): void {
    if (!this.rangeDue || now - this.lastRange < MEASURE_EVERY_MS) return;
    this.lastRange = now;
    this.rangeDue = false;
    if (!this.picture.uniforms.defines.FALSE_COLOUR) return;
    this.updateRange();
    this.picture.redraw();
  }

  private measureExposure(now: number): void {
    const { unknown, automatic } = this.exposure;
    const share = Math.min(MOST_PAUSE_MS, MEASURE_SHARE * this.exposure.tookMs);
    const pause = unknown ? 0 : Math.max(MEASURE_EVERY_MS, share);
    if (!this.exposureDue || now - this.lastMeasure < pause) return;
    const { covered, complete, waiting } = this.picture.layouts.shown?.set ?? {};
    if (!this.gate.mayMeasure(now, covered === true, complete === true && waiting === 0)) return;
    this.lastMeasure = now;
    if (unknown && this.guessExposure(now)) return; // so the card can draw the first light at once
    this.exposureDue = false;
    if (automatic) void this.measureNow().then(() => this.picture.redraw());
  }

  private guessExposure(now: number): boolean {
    const { shown } = this.picture.layouts;
    const mode = this.picture.mode();
    if (mode && shownLight(mode) === 'arriving') {
      if (!this.guessOfPages()) return false;
    } else {
      const guess = shown && exposureByRays(shown, this.picture.camera);
      if (guess === undefined) return false;
      this.exposure.guess(guess);
    }
    this.gate.turn(now, false);
    this.guessedAt = now;
    this.picture.redraw();
    return true;
  }

  /** For light that arrives at surfaces, all pages tell nearly as much as the picture does. */
  private guessOfPages(): boolean {
    const guess = this.exposureOfPages();
    if (guess !== undefined) this.exposure.guess(guess);
    return guess !== undefined;
  }

  private exposureOfPages(): number | undefined {
    const mode = this.picture.mode();
    if (!mode || shownLight(mode) !== 'arriving') return undefined;
    return exposureOf((this.picture.layouts.shown?.set.someValues() ?? []).map((lux) => lux / Math.PI));
  }

  private async measureNow(): Promise<void> {
    const { world, camera, background } = this.picture;
    if (this.picture.mode()?.flat) {
      const found = this.exposureOfPages();
      if (found !== undefined) this.exposure.found(found);
      return;
    }
    return this.picture.withoutSigns(() => this.exposure.measure(world, camera, background));
  }
}
