// The exposure of the picture. Automatic exposure makes the logarithmic mean of the lit part middle grey, as the server
// does in its own pictures. It measures a small picture, which it reads back without waiting.

import {
  FloatType,
  HalfFloatType,
  WebGLRenderTarget,
  type PerspectiveCamera,
  type Scene,
  type WebGLRenderer,
} from 'three';
import { luminance } from '../../page/colours';
import { decodeHalf } from '../../protocol/rgb9e5';
import type { ViewUniforms } from '../scene/lit_material';
import { Readback } from './readback';
import type { SkyBackground } from '../scene/sky';
import type { ShownLight } from '../looks/view_modes';

const WIDTH = 64;
const HEIGHT = 48;
const GREY = 0.18;
/** Pixels so many times darker or brighter than the typical one are a dark outside, or lamps, and do not count. */
const RANGE = 24;
/**
 * Pixels count by this power of their luminance. Lamps 2,000 times as bright as walls count 6.7 times as much, and are
 * taken for the subject only if they cover an eighth of the picture; a dark outside with a thousandth of a room's light
 * counts a sixth, and is the subject only if it covers 85 %. With the square root, a fiftieth of the picture was enough
 * for lamps.
 */
const WEIGHT = 0.25;

/** The factor for a picture with these luminances; undefined: nothing is lit. */
export function exposureOf(luminances: readonly number[]): number | undefined {
  const lit = luminances.filter((v) => v > 0 && Number.isFinite(v)).sort((a, b) => a - b);
  const half = lit.reduce((sum, v) => sum + v ** WEIGHT, 0) / 2;
  let below = 0;
  const typical = lit.find((v) => (below += v ** WEIGHT) >= half);
  if (typical === undefined) return undefined;
  const kept = lit.filter((v) => v >= typical / RANGE && v <= typical * RANGE);
  return GREY / Math.exp(kept.reduce((sum, v) => sum + Math.log(v), 0) / kept.length);
}

export class ExposureMeter {
  automatic = true;
  /** Stops (steps of two) that the user adds to the measured or manual exposure. */
  stops = 0;
  /** The manual exposure, before `stops`. */
  base = 1;
  /** How long the last measurement took. */
  tookMs = 0;
  /** The last exposure of either kind of light, for a return to its view. */
  private readonly known = new Map<ShownLight, number>();
  private light: ShownLight = 'leaving';
  private measured = 1;
  private shown = 1;
  /** The next value is shown at once, without a transition. */
  private fresh = true;
  /** No measurement has come back yet. */
  private waits = true;
  /** Counts scenes and kinds of light: a measurement of an earlier one does not count. */
  private scene = 0;
  private running: Promise<void> | undefined;
  private readonly target: WebGLRenderTarget;
  private readonly half: boolean;
  private readonly readback: Readback;

  constructor(
    private readonly renderer: WebGLRenderer,
    private readonly view: ViewUniforms,
    isCardQuiet: () => boolean,
  ) {
    this.half = !renderer.extensions.has('EXT_color_buffer_float');
    this.target = new WebGLRenderTarget(WIDTH, HEIGHT, { type: this.half ? HalfFloatType : FloatType });
    const gl = renderer.getContext() as WebGL2RenderingContext;
    this.readback = new Readback(gl, this.half ? gl.HALF_FLOAT : gl.FLOAT, WIDTH, HEIGHT, isCardQuiet);
  }

  /** The scene or the place in it is another, and earlier measurements do not count. */
  forget(): void {
    this.known.clear();
    this.renew();
  }

  /** Light that leaves surfaces and light that reaches them have different exposures. */
  setLight(light: ShownLight): void {
    if (light === this.light) return;
    this.light = light;
    this.renew();
    const known = this.known.get(light);
    if (known !== undefined) this.guess(known);
  }

  private renew(): void {
    this.fresh = this.waits = true;
    this.running = undefined;
    ++this.scene;
  }

  /** Shows a guess at once. The measurement that follows differs little, so it needs no transition either. */
  guess(value: number): void {
    this.take(value);
    this.waits = false;
    this.fresh = true;
  }

  /** The exposure is still to be measured. */
  get unknown(): boolean {
    return this.automatic && this.waits;
  }

  /** A measurement waits to be fetched from a slow card, which must have nothing to draw for that. */
  get wantsQuiet(): boolean {
    return this.readback.arrived;
  }

  /** The context is lost, and running measurements with it. */
  forgetCard(): void {
    this.readback.forget();
  }

  /** Moves the shown exposure towards the measured one. True: it is not there yet. */
  step(seconds: number): boolean {
    const goal = (this.automatic ? this.measured : this.base) * 2 ** this.stops;
    const ratio = goal / this.shown;
    const close = Math.abs(Math.log2(ratio)) < 0.004;
    this.shown = close ? goal : this.shown * ratio ** Math.min(1, seconds * 7);
    this.view.all.toneMappingExposure.value = this.shown;
    // Surfaces without light are a bright grey.
    this.view.all.previewLight.value = (Math.PI * 0.6) / this.shown;
    return !close;
  }

  /** Ends the transition. */
  settle(): void {
    this.shown = (this.automatic ? this.measured : this.base) * 2 ** this.stops;
  }

  get value(): number {
    return this.shown;
  }

  /** The exposure of light that leaves surfaces, whichever light is shown. */
  get ofLeaving(): number {
    const known = this.automatic ? this.known.get('leaving') : undefined;
    return known === undefined ? this.shown : known * 2 ** this.stops;
  }

  /** The exposure was computed without a picture. */
  found(value: number): void {
    this.take(value);
    this.waits = false;
  }

  /** Ends when there is a new value; a running measurement counts. */
  measure(scene: Scene, camera: PerspectiveCamera, sky: SkyBackground): Promise<void> {
    if (this.running) return this.running;
    const running = this.read(scene, camera, sky).finally(() => {
      if (this.running === running) this.running = undefined;
    });
    return (this.running = running);
  }

  private async read(scene: Scene, camera: PerspectiveCamera, sky: SkyBackground): Promise<void> {
    const { renderer, target, view } = this;
    const of = this.scene;
    const pixels = this.half ? new Uint16Array(4 * WIDTH * HEIGHT) : new Float32Array(4 * WIDTH * HEIGHT);
    view.all.measuring.value = true;
    renderer.setRenderTarget(target);
    renderer.clear();
    renderer.render(scene, camera);
    const begin = performance.now();
    const reading = this.readback.read(pixels);
    renderer.setRenderTarget(null);
    view.all.measuring.value = false;
    const from = camera.clone();
    try {
      await reading;
      this.tookMs = performance.now() - begin;
      if (of !== this.scene) return;
      // The sky counts only if nothing else is lit: behind a small window it is brighter than all of the room.
      const value = exposureOf(this.luminances(pixels)) ?? (this.light === 'leaving' ? ofSky(sky, from) : undefined);
      if (value !== undefined) this.take(value);
    } catch {
      return; // the context was lost; the exposure is measured again when it is back
    }
    if (of === this.scene) this.waits = false;
  }

  private take(value: number): void {
    this.measured = value;
    this.known.set(this.light, value);
    if (this.fresh) this.settle();
    this.fresh = false;
  }

  private luminances(pixels: Uint16Array | Float32Array): number[] {
    const read = this.half ? (i: number) => decodeHalf(pixels[i]!) : (i: number) => pixels[i]!;
    const out: number[] = [];
    for (let i = 0; i < pixels.length; i += 4) {
      // Alpha 0 is the background, which is no light.
      if (read(i + 3) > 0) out.push(luminance([read(i), read(i + 1), read(i + 2)]));
    }
    return out;
  }
}

/** The exposure of a picture in which only the sky has light. */
function ofSky(sky: SkyBackground, camera: PerspectiveCamera): number | undefined {
  return exposureOf(
    Array.from({ length: WIDTH * HEIGHT }, (_, i) => {
      const [x, y] = [((i % WIDTH) + 0.5) / WIDTH, (Math.floor(i / WIDTH) + 0.5) / HEIGHT];
      return sky.luminanceAt(camera, 2 * x - 1, 2 * y - 1);
    }),
  );
}
