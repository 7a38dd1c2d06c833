// What is shown and from where: views, exposure, cameras, the light meter, links to all of it. Part of the App.

import { type Box3, Vector3 } from 'three';
import type { App } from '../app/app';
import { MeterSession } from './light_meter';
import { type Gltf, isSameScene } from '../document/gltf';
import { ViewPanel } from '../ui/view_panel';
import { insideView } from '../view/rays/first_view';
import { fromLink, MOST_STOPS, toLink, type ShownAs } from '../view/looks/link';
import type { LitScene } from '../view/scene/lit_scene';
import { shining, skyOf } from '../view/scene/sky';
import { TONE_CURVES, viewMode, type ViewMode } from '../view/looks/view_modes';

/** Whether one has found a place in the scene to look from, and the number of its camera. */
export interface Placed {
  placed: boolean;
  camera: number;
}

export class ViewSession {
  readonly panel: ViewPanel;
  readonly meter: MeterSession;
  mode: ViewMode = viewMode('lit');
  private falseColour = false;
  private camera = -1;
  private placed = false;
  private sharpMarked = false;
  private bounds: Box3 | undefined;
  private source: Gltf | undefined;
  private sceneIsNew = false;
  /** A view that the page's address asks for, and that was not shown yet. */
  private linked: string | undefined;

  constructor(private readonly app: App) {
    this.meter = new MeterSession(app);
    this.panel = new ViewPanel({
      setMode: (id) => void this.setMode(id),
      setFalseColour: (on) => this.setFalseColour(on),
      setRange: (range) => this.setRange(range),
      setAutoExposure: (on) => this.setAutoExposure(on),
      setStops: (stops) => this.setStops(stops),
      setToneCurve: (id) => this.setToneCurve(id),
      setBackground: (id) => (document.documentElement.dataset['background'] = id),
      useCamera: (index) => this.useCamera(index),
      notAccepted: (text, wanted) => app.notAccepted(text, wanted),
    });
  }

  /** When the page is there. */
  start(): void {
    void this.setMode('lit');
    this.followAddress();
    if (addressed().get('ui') === '0') this.app.frame.toggleChrome();
    // Somebody follows another link in the same tab, or goes back: only what stands behind the # has changed.
    window.addEventListener('hashchange', () => this.followAddress());
  }

  /** The hash of a link to this very view. */
  linkHash(): string {
    const hash = new URLSearchParams({ camera: this.app.viewer.rig.toText() });
    if (this.mode.id !== 'lit') hash.set('view', this.mode.id);
    if (this.mode.falseColour === 'choice' && this.falseColour) hash.set('colours', 'false');
    for (const [name, text] of Object.entries(toLink(this.shownAs()))) hash.set(name, text);
    return hash.toString();
  }

  /** To where the page's address says that one looks from, and to the view that it names. */
  private followAddress(): void {
    const link = addressed();
    const { rig } = this.app.viewer;
    if (rig.fromText(link.get('camera') ?? '')) {
      this.placed = true;
      this.linked = 'lit'; // which links do not name
    }
    this.app.frame.setWalk(rig.mode === 'walk');
    this.linked = link.get('view') ?? this.linked;
    if (this.linked !== undefined) this.setFalseColour(link.get('colours') === 'false');
    this.showAs(fromLink(link), this.linked !== undefined);
    this.followLink();
  }

  private shownAs(): ShownAs {
    const { exposure, brightness, uniforms } = this.app.viewer;
    const { falseRange } = uniforms.all;
    return {
      stops: exposure.stops,
      exposure: exposure.automatic ? undefined : exposure.base,
      tone: TONE_CURVES.find(({ number }) => number === uniforms.defines.TONE_CURVE)?.id,
      scale: brightness.autoRange ? undefined : [falseRange.value.x, falseRange.value.y],
    };
  }

  /** `whole`: what is not said is as it is without a link. */
  private showAs({ stops, exposure, tone, scale }: ShownAs, whole: boolean): void {
    if (whole || stops !== undefined) this.setStops(stops ?? 0);
    if (whole || exposure !== undefined) this.setAutoExposure(exposure === undefined, exposure);
    if (whole || tone !== undefined) this.setToneCurve(tone ?? TONE_CURVES[0].id);
    if (!whole && scale === undefined) return;
    this.setRange(scale);
    this.panel.setRange(scale);
  }

  onCapabilities(): void {
    this.panel.setAvailable((mode) => this.available(mode));
    if (!this.available(this.mode)) void this.setMode('lit');
    this.followLink();
  }

  /**
   * To the view that a link names, once the server is known to stream it. What is no light comes after the first light,
   * which tells how bright the scene is.
   */
  private followLink(): void {
    const mode = this.linked === undefined ? undefined : viewMode(this.linked);
    if (!mode || !this.available(mode)) return;
    if (mode.quantity !== 'irradiance' && !this.app.viewer.shown?.set.covered) return;
    void this.setMode(mode.id);
  }

  onSceneShown(scene: LitScene): void {
    this.panel.setCameras(scene.cameras.map((camera) => camera.name));
    const elsewhere = this.bounds !== undefined && !alike(this.bounds, scene.bounds);
    // A server that comes back may have another, and tells of no load.
    this.sceneIsNew ||= this.source !== undefined && !isSameScene(this.source, scene.source);
    this.source = scene.source;
    this.bounds = scene.bounds;
    if (this.sceneIsNew && elsewhere) this.forgetCamera();
    if (this.sceneIsNew || !this.placed) this.app.viewer.exposure.forget();
    this.sceneIsNew = false;
    if (this.placed) return;
    this.placed = true;
    if (scene.cameras.length > 0) this.useCamera(0);
    else this.lookAtAll(scene);
  }

  private lookAtAll(scene: LitScene): void {
    const { background, rig } = this.app.viewer;
    rig.overview(scene.bounds);
    const sky = shining(skyOf(scene.source) ?? background.ofSettings); // its document may be still on its way
    const inside = insideView(scene, rig.camera, sky !== undefined);
    if (inside) rig.stand(inside.eye, inside.target);
  }

  /** Somebody has loaded one; its geometry follows. The same scene, laid out anew, is looked at from where one was. */
  sceneComes(): void {
    this.sceneIsNew = true;
  }

  /** Another scene wants another place to look from. Returns what keepCamera() takes it back with. */
  forgetCamera(): Placed {
    const before = { placed: this.placed, camera: this.camera };
    this.placed = false;
    this.camera = -1;
    return before;
  }

  /** The other scene did not come. */
  keepCamera(before: Placed): void {
    this.placed = before.placed;
    this.camera = before.camera;
  }

  onDrawn(): void {
    const set = this.app.viewer.shown?.set;
    if (set) this.app.mark('geometry');
    if (set?.showsLight && set.tilesTaken > 0) this.app.mark('light');
    if (set?.complete && set.waiting === 0 && !this.sharpMarked) {
      this.sharpMarked = true;
      this.app.mark('sharp');
    }
    this.followLink();
    this.showLegend();
    this.meter.onDrawn();
  }

  /** Pages have a new layout: what is looked at besides light has new ones too. False: nothing is. */
  renewData(): boolean {
    if (this.mode.quantity === 'irradiance') return false;
    this.app.viewer.setDataQuantity(this.mode.quantity);
    return true;
  }

  async setMode(id: string): Promise<void> {
    const mode = viewMode(id);
    if (!this.available(mode)) return;
    const before = this.app.viewer.dataSet?.quantity;
    this.mode = mode;
    const data = mode.quantity === 'irradiance' ? undefined : mode.quantity;
    this.linked = undefined;
    this.app.viewer.setDataQuantity(data);
    this.app.viewer.setMode(mode);
    this.applyFalseColour();
    if (before !== data) await this.app.resubscribe();
  }

  toggleWalk(): void {
    const { rig } = this.app.viewer;
    rig.setMode(rig.mode === 'walk' ? 'orbit' : 'walk');
    this.app.frame.setWalk(rig.mode === 'walk');
  }

  frameAll(): void {
    const { viewer } = this.app;
    if (this.mode.flat) viewer.pagesView.frame();
    else if (viewer.shown) viewer.rig.frame(viewer.shown.bounds);
    viewer.invalidate();
  }

  frameSelection(): void {
    const { viewer, edit } = this.app;
    const node = edit.selection?.node;
    const box = node === undefined ? undefined : viewer.boxOf(node);
    if (box) viewer.rig.frame(box);
    else this.frameAll();
  }

  private available(mode: ViewMode): boolean {
    return mode.quantity === 'irradiance' || this.app.connection?.has(`quantity.${mode.quantity}`) === true;
  }

  private useCamera(index: number): void {
    const { shown, rig } = this.app.viewer;
    const chosen = shown?.cameras[index];
    if (!chosen) return;
    this.camera = index;
    rig.take(chosen.camera, shown!.bounds);
  }

  nextCamera(): void {
    const count = this.app.viewer.shown?.cameras.length ?? 0;
    if (count > 0) this.useCamera((this.camera + 1) % count);
  }

  toggleFalseColour(): void {
    if (this.mode.falseColour === 'choice') this.setFalseColour(!this.falseColour);
  }

  private setFalseColour(on: boolean): void {
    this.falseColour = on;
    this.applyFalseColour();
  }

  private applyFalseColour(): void {
    const { viewer } = this.app;
    const on = this.mode.falseColour === 'always' || (this.mode.falseColour === 'choice' && this.falseColour);
    viewer.uniforms.choose({ FALSE_COLOUR: Number(on) });
    this.panel.setMode(this.mode, on);
    viewer.invalidate();
  }

  private setRange(range: [number, number] | undefined): void {
    const { viewer } = this.app;
    viewer.brightness.autoRange = range === undefined;
    if (range) viewer.uniforms.all.falseRange.value.set(...range);
    viewer.setMode(this.mode);
  }

  /** Where it is manual it stays what it is, or becomes `base`. */
  private setAutoExposure(on: boolean, base?: number): void {
    const { exposure } = this.app.viewer;
    if (!on) exposure.base = base ?? exposure.value / 2 ** exposure.stops;
    exposure.automatic = on;
    this.panel.setAuto(on);
    this.app.viewer.invalidate();
  }

  setStops(stops: number): void {
    const clamped = Math.min(MOST_STOPS, Math.max(-MOST_STOPS, stops));
    this.app.viewer.exposure.stops = clamped;
    this.panel.setStops(clamped);
    this.app.viewer.moved();
  }

  private setToneCurve(id: string): void {
    const curve = TONE_CURVES.find((one) => one.id === id) ?? TONE_CURVES[0];
    this.app.viewer.uniforms.choose({ TONE_CURVE: curve.number });
    this.panel.setTone(curve.id);
    this.app.viewer.invalidate();
  }

  private showLegend(): void {
    const { frame, viewer } = this.app;
    if (this.mode.id === 'mips') return frame.legend.showMips();
    if (!viewer.uniforms.defines.FALSE_COLOUR || !this.mode.unit || !viewer.shown) return frame.legend.hide();
    const { x: low, y: high } = viewer.uniforms.all.falseRange.value;
    const title = this.mode.legend ?? this.mode.label;
    if (!viewer.brightness.hasRange) return frame.legend.showNothing(title, this.mode.unit, this.whyNothing());
    frame.legend.show(title, this.mode.unit, low, high);
    this.panel.showRange(low, high);
  }

  private whyNothing(): string {
    const { shown, shownData } = this.app.viewer.layouts;
    const set = this.mode.quantity === 'irradiance' ? shown?.set : shownData;
    return set?.complete && set.waiting === 0 ? '0 everywhere: nothing to measure' : 'Nothing has come yet';
  }
}

/** Two boxes that one looks at from the same place. */
function alike(a: Box3, b: Box3): boolean {
  const size = a.getSize(new Vector3()).length();
  return a.min.distanceTo(b.min) + a.max.distanceTo(b.max) < 0.25 * size;
}

function addressed(): URLSearchParams {
  return new URLSearchParams(location.hash.slice(1));
}
