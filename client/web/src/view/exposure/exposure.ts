// How bright the picture is shown. Automatic: the lit part's logarithmic mean becomes middle grey, as the server does it
// for its own pictures, from a small picture read back without waiting.

import {
  FloatType,
  HalfFloatType,
  WebGLRenderTarget,
  type PerspectiveCamera,
  type Scene,
  type WebGLRenderer,
} from 'three';
import { decodeHalf } from '../../protocol/rgb9e5';
import type { ViewUniforms } from '../scene/lit_material';
import { Readback } from './readback';
import type { SkyBackground } from '../scene/sky';
import type { ShownLight } from '../looks/view_modes';

const WIDTH = 64;
const HEIGHT = 48;
const GREY = 0.18;
/** Of what is typical: what is further off is a dark outside, or a lamp. */
const RANGE = 24;
/**
 * Pixels count by this power of their luminance. Lamps of 2,000 times the light of walls count 6.7 times as much, and are
 * not taken for what one looks at before they cover an eighth of the picture; a dark outside of a thousandth of a room's
 * light counts a sixth, and is not before it covers 85 %. By the square root lamps were from a fiftieth on.
 */
const WEIGHT = 0.25;

/** The factor for a picture's luminances; undefined when nothing is lit. */
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
  /** Steps of two, added to what is measured, or to 1 where exposure is manual. */
  stops = 0;
  /** What a manual exposure starts from. */
  base = 1;
  /** How long the last measurement was on its way. */
  tookMs = 0;
  /** What was measured last of either light: who goes back to a view finds it as bright as it was. */
  private readonly known = new Map<ShownLight, number>();
  private light: ShownLight = 'leaving';
  private measured = 1;
  private shown = 1;
  /** The next value is taken at once: the eye need not get used to it. */
  private fresh = true;
  /** Nothing has come back yet, be it that nothing is lit. */
  private waits = true;
  /** Raised when what is measured at the moment is of no interest any more. */
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

  /** Another scene, or another part of it: what was measured says nothing about it. */
  forget(): void {
    this.known.clear();
    this.renew();
  }

  /** Light that leaves surfaces and light that reaches them differ by how dark the surfaces are: each has its own. */
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

  /** Shown at once, until there is a measurement, which differs little: to go over to that takes frames for nothing. */
  guess(value: number): void {
    this.take(value);
    this.waits = false;
    this.fresh = true;
  }

  /** How brightly to show light is still to be found out. */
  get unknown(): boolean {
    return this.automatic && this.waits;
  }

  /** A measurement is to be fetched as soon as the card has nothing to draw: not where it is quick. */
  get wantsQuiet(): boolean {
    return this.readback.arrived;
  }

  /** The context is lost: what was on its way never comes. */
  forgetCard(): void {
    this.readback.forget();
  }

  /** Moves what is shown towards what was measured. True: not there yet. */
  step(seconds: number): boolean {
    const goal = (this.automatic ? this.measured : this.base) * 2 ** this.stops;
    const ratio = goal / this.shown;
    const close = Math.abs(Math.log2(ratio)) < 0.004;
    this.shown = close ? goal : this.shown * ratio ** Math.min(1, seconds * 7);
    this.view.all.toneMappingExposure.value = this.shown;
    // Surfaces of which nothing is known yet show as a bright grey.
    this.view.all.previewLight.value = (Math.PI * 0.6) / this.shown;
    return !close;
  }

  /** The next step goes all the way. */
  settle(): void {
    this.shown = (this.automatic ? this.measured : this.base) * 2 ** this.stops;
  }

  get value(): number {
    return this.shown;
  }

  /** Of light that leaves surfaces, whatever is shown. */
  get ofLeaving(): number {
    const known = this.automatic ? this.known.get('leaving') : undefined;
    return known === undefined ? this.shown : known * 2 ** this.stops;
  }

  /** Was found out without a picture. */
  found(value: number): void {
    this.take(value);
    this.waits = false;
  }

  /** Ends when there is a new value; the one that is on its way counts. */
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
      // A sky behind a small window is brighter than all of the room: it counts where nothing else has light.
      const value = exposureOf(this.luminances(pixels)) ?? (this.light === 'leaving' ? ofSky(sky, from) : undefined);
      if (value !== undefined) this.take(value);
    } catch {
      return; // The context was lost on the way; it is measured again when it is back.
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
      // Only what was drawn upon: the background is no light.
      if (read(i + 3) > 0) out.push(0.2126 * read(i) + 0.7152 * read(i + 1) + 0.0722 * read(i + 2));
    }
    return out;
  }
}

/** Of a picture that shows nothing else which has light. */
function ofSky(sky: SkyBackground, camera: PerspectiveCamera): number | undefined {
  return exposureOf(
    Array.from({ length: WIDTH * HEIGHT }, (_, i) => {
      const [x, y] = [((i % WIDTH) + 0.5) / WIDTH, (Math.floor(i / WIDTH) + 0.5) / HEIGHT];
      return sky.luminanceAt(camera, 2 * x - 1, 2 * y - 1);
    }),
  );
}
