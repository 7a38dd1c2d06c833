// What the picture shows and from where: views, exposure, cameras, and links to them.

import { type Box3, Vector3 } from 'three';
import { type Gltf, isSameScene } from '../document/gltf';
import type { Server } from '../protocol/connection';
import type { Frame } from '../ui/frame';
import { ViewPanel } from '../ui/view_panel';
import { fromLink, MOST_STOPS, toLink, type ShownAs } from '../view/looks/link';
import { TONE_CURVES, viewMode, type ViewMode } from '../view/looks/view_modes';
import { insideView } from '../view/rays/first_view';
import type { LitScene } from '../view/scene/lit_scene';
import { pictureKey } from '../document/skies';
import { shining, skyOf } from '../view/scene/sky';
import type { Viewer } from '../view/viewer';

/** Whether a place to look from was chosen in this scene, and the index of the scene's camera that was taken. */
export interface Placed {
  placed: boolean;
  camera: number;
}

export interface ViewHost {
  picture: Viewer;
  server: Pick<Server, 'has'>;
  frame: Pick<Frame, 'legend' | 'setWalk' | 'toggleChrome'>;
  /** The view needs another quantity from the server. */
  resubscribe(): Promise<void>;
  /** Notes when something happened for the first time. */
  mark(name: string): void;
  notAccepted(text: string, wanted: string): void;
}

export class ViewSession {
  readonly panel: ViewPanel;
  mode: ViewMode = viewMode('lit');
  private falseColour = false;
  private camera = -1;
  private placed = false;
  private sharpMarked = false;
  private bounds: Box3 | undefined;
  private source: Gltf | undefined;
  private sceneIsNew = false;
  /** The view that the page's address asks for, until it is shown. */
  private linked: string | undefined;

  constructor(private readonly host: ViewHost) {
    this.panel = new ViewPanel({
      setMode: (id) => void this.setMode(id),
      setFalseColour: (on) => this.setFalseColour(on),
      setRange: (range) => this.setRange(range),
      setAutoExposure: (on) => this.setAutoExposure(on),
      setStops: (stops) => this.setStops(stops),
      setToneCurve: (id) => this.setToneCurve(id),
      setBackground: (id) => (document.documentElement.dataset['background'] = id),
      useCamera: (index) => this.useCamera(index),
      notAccepted: (text, wanted) => host.notAccepted(text, wanted),
    });
  }

  /** When the page is built. */
  start(): void {
    void this.setMode('lit');
    this.followAddress();
    if (addressed().get('ui') === '0') this.host.frame.toggleChrome();
    // A link that the user follows in the same tab, or the way back, changes only the part behind the #.
    window.addEventListener('hashchange', () => this.followAddress());
  }

  /** The hash of a link to this view. */
  linkHash(): string {
    const hash = new URLSearchParams({ camera: this.host.picture.rig.toText() });
    if (this.mode.id !== 'lit') hash.set('view', this.mode.id);
    if (this.mode.falseColour === 'choice' && this.falseColour) hash.set('colours', 'false');
    for (const [name, text] of Object.entries(toLink(this.shownAs()))) hash.set(name, text);
    return hash.toString();
  }

  /** Goes to the camera and the view that the page's address names. */
  private followAddress(): void {
    const link = addressed();
    const { rig } = this.host.picture;
    if (rig.fromText(link.get('camera') ?? '')) {
      this.placed = true;
      this.linked = 'lit'; // links name every view but this one
    }
    this.host.frame.setWalk(rig.mode === 'walk');
    this.linked = link.get('view') ?? this.linked;
    if (this.linked !== undefined) this.setFalseColour(link.get('colours') === 'false');
    this.showAs(fromLink(link), this.linked !== undefined);
    this.followLink();
  }

  private shownAs(): ShownAs {
    const { exposure, brightness, uniforms } = this.host.picture;
    const { falseRange } = uniforms.all;
    return {
      stops: exposure.stops,
      exposure: exposure.automatic ? undefined : exposure.base,
      tone: TONE_CURVES.find(({ number }) => number === uniforms.defines.TONE_CURVE)?.id,
      scale: brightness.autoRange ? undefined : [falseRange.value.x, falseRange.value.y],
    };
  }

  /** `whole`: values that the link leaves out return to their defaults. */
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
   * Goes to the view that a link names, once the server is known to stream it. Quantities other than light wait for the
   * first light, which tells how bright the scene is.
   */
  private followLink(): void {
    const mode = this.linked === undefined ? undefined : viewMode(this.linked);
    if (!mode || !this.available(mode)) return;
    if (mode.quantity !== 'irradiance' && !this.host.picture.shown?.set.covered) return;
    void this.setMode(mode.id);
  }

  onSceneShown(scene: LitScene): void {
    this.panel.setCameras(scene.cameras.map((camera) => camera.name));
    const elsewhere = this.bounds !== undefined && !alike(this.bounds, scene.bounds);
    // A server that restarted may have another scene, of which it sends no message.
    this.sceneIsNew ||= this.source !== undefined && !isSameScene(this.source, scene.source);
    this.source = scene.source;
    this.bounds = scene.bounds;
    if (this.sceneIsNew && elsewhere) this.forgetCamera();
    if (this.sceneIsNew || !this.placed) this.host.picture.exposure.forget();
    this.sceneIsNew = false;
    if (this.placed) return;
    this.placed = true;
    if (scene.cameras.length > 0) this.useCamera(0);
    else this.lookAtAll(scene);
  }

  private lookAtAll(scene: LitScene): void {
    const { background, rig } = this.host.picture;
    rig.overview(scene.bounds);
    const sky = shining(skyOf(scene.source) ?? background.ofSettings); // the document may still be on its way
    const hasSky = sky !== undefined || pictureKey(scene.source) !== undefined;
    const inside = insideView(scene, rig.camera, hasSky);
    if (inside) rig.stand(inside.eye, inside.target);
  }

  /** Somebody has loaded a scene, and its geometry follows. A new layout of the same scene keeps the camera. */
  sceneComes(): void {
    this.sceneIsNew = true;
  }

  /** Another scene needs another place to look from. Returns what keepCamera() restores. */
  forgetCamera(): Placed {
    const before = { placed: this.placed, camera: this.camera };
    this.placed = false;
    this.camera = -1;
    return before;
  }

  /** The other scene has not come. */
  keepCamera(before: Placed): void {
    this.placed = before.placed;
    this.camera = before.camera;
  }

  onDrawn(): void {
    const set = this.host.picture.shown?.set;
    if (set) this.host.mark('geometry');
    if (set?.showsLight && set.tilesTaken > 0) this.host.mark('light');
    if (set?.complete && set.waiting === 0 && !this.sharpMarked) {
      this.sharpMarked = true;
      this.host.mark('sharp');
    }
    this.followLink();
    this.showLegend();
  }

  /** A new layout needs new pages for the quantity that is shown, too. False: the view shows light only. */
  renewData(): boolean {
    if (this.mode.quantity === 'irradiance') return false;
    this.host.picture.setDataQuantity(this.mode.quantity);
    return true;
  }

  async setMode(id: string): Promise<void> {
    const mode = viewMode(id);
    if (!this.available(mode)) return;
    const before = this.host.picture.dataSet?.quantity;
    this.mode = mode;
    const data = mode.quantity === 'irradiance' ? undefined : mode.quantity;
    this.linked = undefined;
    this.host.picture.setDataQuantity(data);
    this.host.picture.setMode(mode);
    this.applyFalseColour();
    if (before !== data) await this.host.resubscribe();
  }

  toggleWalk(): void {
    const { rig } = this.host.picture;
    rig.setMode(rig.mode === 'walk' ? 'orbit' : 'walk');
    this.host.frame.setWalk(rig.mode === 'walk');
  }

  frameAll(): void {
    const { picture } = this.host;
    if (this.mode.flat) picture.pagesView.frame();
    else if (picture.shown) picture.rig.frame(picture.shown.bounds);
    picture.invalidate();
  }

  /** Frames everything where there is no such node. */
  frameNode(node: number | undefined): void {
    const { picture } = this.host;
    const box = node === undefined ? undefined : picture.boxOf(node);
    if (box) picture.rig.frame(box);
    else this.frameAll();
  }

  private available(mode: ViewMode): boolean {
    return mode.quantity === 'irradiance' || this.host.server.has(`quantity.${mode.quantity}`);
  }

  private useCamera(index: number): void {
    const { shown, rig } = this.host.picture;
    const chosen = shown?.cameras[index];
    if (!chosen) return;
    this.camera = index;
    rig.take(chosen.camera, shown!.bounds);
  }

  nextCamera(): void {
    const count = this.host.picture.shown?.cameras.length ?? 0;
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
    const { picture } = this.host;
    const on = this.mode.falseColour === 'always' || (this.mode.falseColour === 'choice' && this.falseColour);
    picture.uniforms.choose({ FALSE_COLOUR: Number(on) });
    this.panel.setMode(this.mode, on);
    picture.invalidate();
  }

  private setRange(range: [number, number] | undefined): void {
    const { picture } = this.host;
    picture.brightness.autoRange = range === undefined;
    if (range) picture.uniforms.all.falseRange.value.set(...range);
    picture.setMode(this.mode);
  }

  /** A manual exposure starts at `base`, or stays as bright as it is. */
  private setAutoExposure(on: boolean, base?: number): void {
    const { exposure } = this.host.picture;
    if (!on) exposure.base = base ?? exposure.value / 2 ** exposure.stops;
    exposure.automatic = on;
    this.panel.setAuto(on);
    this.host.picture.invalidate();
  }

  setStops(stops: number): void {
    const clamped = Math.min(MOST_STOPS, Math.max(-MOST_STOPS, stops));
    this.host.picture.exposure.stops = clamped;
    this.panel.setStops(clamped);
    this.host.picture.moved();
  }

  private setToneCurve(id: string): void {
    const curve = TONE_CURVES.find((one) => one.id === id) ?? TONE_CURVES[0];
    this.host.picture.uniforms.choose({ TONE_CURVE: curve.number });
    this.panel.setTone(curve.id);
    this.host.picture.invalidate();
  }

  private showLegend(): void {
    const { frame, picture } = this.host;
    if (this.mode.id === 'mips') return frame.legend.showMips();
    if (!picture.uniforms.defines.FALSE_COLOUR || !this.mode.unit || !picture.shown) return frame.legend.hide();
    const { x: low, y: high } = picture.uniforms.all.falseRange.value;
    const title = this.mode.legend ?? this.mode.label;
    if (!picture.brightness.hasRange) return frame.legend.showNothing(title, this.mode.unit, this.whyNothing());
    frame.legend.show(title, this.mode.unit, low, high);
    this.panel.showRange(low, high);
  }

  private whyNothing(): string {
    const { shown, shownData } = this.host.picture.layouts;
    const set = this.mode.quantity === 'irradiance' ? shown?.set : shownData;
    return set?.complete && set.waiting === 0 ? '0 everywhere: nothing to measure' : 'No data yet';
  }
}

/** Whether a view of one box also suits the other. */
function alike(a: Box3, b: Box3): boolean {
  const size = a.getSize(new Vector3()).length();
  return a.min.distanceTo(b.min) + a.max.distanceTo(b.max) < 0.25 * size;
}

function addressed(): URLSearchParams {
  return new URLSearchParams(location.hash.slice(1));
}
