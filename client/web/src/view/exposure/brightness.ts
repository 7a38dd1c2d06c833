// How brightly the picture is shown: when its exposure, and the range of its false colours, are found anew, and of what.
// Rests between measurements, as the card is needed for the picture itself.

import type { PerspectiveCamera, Scene, WebGLRenderer } from 'three';
import { ExposureMeter, exposureOf } from './exposure';
import type { Layouts } from '../scene/layouts';
import { LightGate } from './light_gate';
import type { ViewUniforms } from '../scene/lit_material';
import { exposureByRays } from './ray_exposure';
import type { SkyBackground } from '../scene/sky';
import { shownLight, type ViewMode } from '../looks/view_modes';

const MEASURE_EVERY_MS = 250;
/** Reading back waits for all that the card has still to draw, which a slow one makes long: rest so many times that. */
const MEASURE_SHARE = 8;
/** A card that is busy with the first light takes long: what it told of half of that is not to stay for ten times as long. */
const MOST_PAUSE_MS = 1500;

/** What leaves a surface is this much less than what arrives, at the dark end of the scale. */
const DARKEST = 0.1;
/** What is left to shoot counts for nothing where it is less than this of what arrives at the bright end. */
const LEAST_UNSHOT = 0.01;

/** What is measured. */
export interface Picture {
  readonly renderer: WebGLRenderer;
  readonly uniforms: ViewUniforms;
  readonly layouts: Layouts;
  readonly world: Scene;
  readonly camera: PerspectiveCamera;
  readonly background: SkyBackground;
  mode(): ViewMode | undefined;
  /** Signs and handles are no part of the scene's light. */
  withoutSigns<T>(draw: () => T): T;
  /** To fetch something from it does not hold the page up for long: it is idle, or quick. */
  isCardQuiet(): boolean;
  /** It is to be drawn as it is to be shown now. */
  redraw(): void;
}

export class Brightness {
  readonly exposure: ExposureMeter;
  /** The range of false colours follows the light. */
  autoRange = true;
  /** There is a value to be measured by that range; else none that is known is more than nothing. */
  hasRange = true;
  private readonly gate = new LightGate();
  /** Something has changed that the range, and the exposure, may depend on. */
  private rangeDue = true;
  private exposureDue = true;
  private lastRange = 0;
  private lastMeasure = 0;
  /** The turn in which the exposure of the first light was found without a picture. */
  private guessedAt = -1;
  /** Irradiance at the dark and bright end of what was last known, lux. */
  private lightRange: [number, number] | undefined;

  constructor(private readonly picture: Picture) {
    this.exposure = new ExposureMeter(picture.renderer, picture.uniforms, () => picture.isCardQuiet());
  }

  /** The picture is another one. */
  changed(): void {
    this.rangeDue = true;
    this.exposureDue = true;
  }

  /** Another view: the light that it shows has an exposure of its own. */
  setMode(mode: ViewMode): void {
    this.exposure.setLight(shownLight(mode));
    if (this.exposure.unknown) this.guessOfPages();
    this.updateRange();
    this.changed();
  }

  /** Once for every turn of the page. `replaces`: what is shown took the place of another scene's light. */
  turn(now: number, replaces: boolean): void {
    this.gate.turn(now, this.picture.layouts.shown?.set.lit === true && this.exposure.unknown, replaces);
    this.measureRange(now);
    this.measureExposure(now);
  }

  /** It is not known yet how brightly to show the light there is. */
  holdsLightBack(now: number): boolean {
    return this.gate.isClosed(now);
  }

  /** The card shall have nothing else to do than to find that out; or the page had enough to do with that in this turn. */
  standsStill(now: number): boolean {
    return this.gate.standsStill(now) || this.guessedAt === now;
  }

  /** Ends when the exposure is the one that the light there is now asks for. */
  async settle(): Promise<void> {
    // The first may have been on its way.
    for (let again = 0; again < 2 && this.picture.layouts.shown; ++again) await this.measureNow();
    this.exposure.settle();
    this.exposure.step(0);
  }

  /**
   * Unshot light is shown by how bright the scene is: by a scale of its own the little that is left at the end would look
   * like much. As long as it is streamed no irradiance comes, and a layout that comes meanwhile has none: the last stays.
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
    this.hasRange = range !== undefined || mode?.id === 'radiosity'; // of which lamps have some that nothing is lit by
    if (!range) return;
    if (isOfLight) this.lightRange = range;
    const [low, high] = range;
    const darkest = isUnshot ? LEAST_UNSHOT * high : mode?.id === 'radiosity' ? DARKEST * low : low;
    uniforms.all.falseRange.value.set(darkest, high);
  }

  /** What changes during a pause is measured after it: the last tiles of a solve, too. */
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
    if (unknown && this.guessExposure(now)) return; // and the card has the first light itself to draw
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

  /** Of light that arrives, what all pages hold tells nearly as much as what is seen of them. */
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
