// What is shown and from where: views, exposure, cameras, the light meter. Part of the App.

import { type Box3, Vector3 } from 'three';
import type { App } from './app';
import { MeterSession } from './app_meter';
import { listenToKeys } from './ui/keys';
import { ViewPanel } from './ui/view_panel';
import { insideView } from './view/first_view';
import type { LitScene } from './view/lit_scene';
import { TONE_CURVES, VIEW_MODES, viewMode, type ViewMode } from './view/view_modes';

/** A click that moves less is no drag, pixels. */
const CLICK_SLACK = 5;

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
    const { canvas } = this.app.frame;
    const { rig, pagesView } = this.app.viewer;
    void this.setMode('lit');
    this.followAddress();
    if (addressed().get('ui') === '0') this.app.frame.toggleChrome();
    // Somebody follows another link in the same tab, or goes back: only what stands behind the # has changed.
    window.addEventListener('hashchange', () => this.followAddress());
    this.listenToPointer(canvas);
    listenToKeys(canvas, {
      camera: (event, down) => this.aimed(rig.key(event, down)),
      turn: (right, up) => this.aimed(this.mode.flat ? pagesView.pan(right, up) : rig.turn(right, up)),
      zoom: (factor) => this.aimed(this.mode.flat ? pagesView.zoom(factor) : rig.zoom(factor)),
      press: (key, event) => this.press(key, event),
    });
  }

  /** The hash of a link to this very view. */
  linkHash(): string {
    const hash = new URLSearchParams({ camera: this.app.viewer.rig.toText() });
    if (this.mode.id !== 'lit') hash.set('view', this.mode.id);
    if (this.mode.falseColour === 'choice' && this.falseColour) hash.set('colours', 'false');
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
    this.followLink();
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
    const { rig } = this.app.viewer;
    rig.overview(scene.bounds);
    const inside = insideView(scene, rig.camera);
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

  private nextCamera(): void {
    const count = this.app.viewer.shown?.cameras.length ?? 0;
    if (count > 0) this.useCamera((this.camera + 1) % count);
  }

  private setFalseColour(on: boolean): void {
    this.falseColour = on;
    this.applyFalseColour();
  }

  private applyFalseColour(): void {
    const { viewer } = this.app;
    const on = this.mode.falseColour === 'always' || (this.mode.falseColour === 'choice' && this.falseColour);
    viewer.uniforms.all.falseColour.value = on;
    this.panel.setMode(this.mode, on);
    viewer.invalidate();
  }

  private setRange(range: [number, number] | undefined): void {
    const { viewer } = this.app;
    viewer.brightness.autoRange = range === undefined;
    if (range) viewer.uniforms.all.falseRange.value.set(...range);
    viewer.setMode(this.mode);
  }

  private setAutoExposure(on: boolean): void {
    const { exposure } = this.app.viewer;
    if (!on) exposure.base = exposure.value / 2 ** exposure.stops;
    exposure.automatic = on;
    this.panel.setAuto(on);
    this.app.viewer.invalidate();
  }

  private setStops(stops: number): void {
    const clamped = Math.min(8, Math.max(-8, stops));
    this.app.viewer.exposure.stops = clamped;
    this.panel.setStops(clamped);
    this.app.viewer.moved();
  }

  private setToneCurve(id: string): void {
    const curve = TONE_CURVES.find((one) => one.id === id);
    this.app.viewer.uniforms.all.toneCurve.value = curve?.number ?? 0;
    this.app.viewer.invalidate();
  }

  private showLegend(): void {
    const { frame, viewer } = this.app;
    if (this.mode.id === 'mips') return frame.legend.showMips();
    if (!viewer.uniforms.all.falseColour.value || !this.mode.unit || !viewer.shown) return frame.legend.hide();
    const { x: low, y: high } = viewer.uniforms.all.falseRange.value;
    frame.legend.show(this.mode.legend ?? this.mode.label, this.mode.unit, low, high);
    this.panel.showRange(low, high);
  }

  // ---- pointer ----

  private listenToPointer(canvas: HTMLCanvasElement): void {
    let down: { x: number; y: number } | undefined;
    canvas.addEventListener('pointerdown', (event) => {
      canvas.focus({ preventScroll: true });
      // Touch tells of its place only when it comes down, so the gizmo may not know yet that it is meant.
      down = this.app.viewer.gizmo.busy ? undefined : { x: event.clientX, y: event.clientY };
    });
    canvas.addEventListener('pointerup', (event) => {
      const moved = down && Math.hypot(event.clientX - down.x, event.clientY - down.y);
      down = undefined;
      if (moved !== undefined && moved <= CLICK_SLACK && event.button === 0) this.click(event);
    });
    canvas.addEventListener('pointermove', (event) => {
      this.meter.pointTo(event);
    });
    canvas.addEventListener('pointerleave', ({ pointerType }) => {
      if (pointerType === 'touch') return; // a finger that is lifted has left: what it pointed at is still meant
      this.meter.leave();
    });
  }

  private click(event: PointerEvent): void {
    if (this.meter.isOn) return this.meter.pointTo(event);
    const hit = this.app.viewer.pickAt(...this.app.frame.toDevice(event.clientX, event.clientY));
    this.app.edit.selectHit(hit?.object);
  }

  // ---- keys ----

  /** By keys, which aim the meter; `result` of what they did. */
  private aimed<T>(result: T): T {
    if (result !== false) this.meter.aimByKeys();
    return result;
  }

  private press(key: string, event: KeyboardEvent): boolean {
    const { app } = this;
    // Where [ and ] are written with AltGr, some systems tell of that as of Control and Alt.
    const isWritten = event.getModifierState('AltGraph');
    const command = !isWritten && (event.ctrlKey || event.metaKey);
    if (command && key.toLowerCase() === 'z')
      return done(event.shiftKey ? app.edit.history.redo() : app.edit.history.undo());
    if (command && key.toLowerCase() === 'y') return done(app.edit.history.redo());
    if (command || (event.altKey && !isWritten)) return false;
    if (key === 'Delete' || key === 'Backspace') return isAmongObjects(event.target) && done(app.edit.removeSelected());
    if (/^\d$/.test(key)) return done(this.setMode(VIEW_MODES[(Number(key) + 9) % 10]?.id ?? 'lit'));
    const actions: Record<string, () => unknown> = {
      v: () => this.toggleWalk(),
      f: () => this.frameAll(),
      F: () => this.frameSelection(),
      c: () => this.nextCamera(),
      x: () => this.mode.falseColour === 'choice' && this.setFalseColour(!this.falseColour),
      '[': () => this.setStops(app.viewer.exposure.stops - 0.25),
      ']': () => this.setStops(app.viewer.exposure.stops + 0.25),
      m: () => this.aimed(this.meter.toggle()),
      n: () => app.edit.selectNext(1),
      N: () => app.edit.selectNext(-1),
      t: () => app.edit.setGizmo('translate'),
      r: () => app.edit.setGizmo('rotate'),
      y: () => app.edit.setGizmo('scale'),
      l: () => app.edit.addLamp(),
      ' ': () => app.togglePause(),
      p: () => app.frame.togglePanel(),
      h: () => app.frame.toggleChrome(),
      Escape: () => app.edit.cancelDrag() || app.edit.select(undefined),
      '?': () => app.frame.help.showModal(),
    };
    const action = actions[key];
    return action ? done(action()) : false;
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

function done(_result: unknown): true {
  return true;
}

/** Keys that take something away do so in the picture and in the list of objects: elsewhere they were meant for a control. */
function isAmongObjects(target: EventTarget | null): boolean {
  return target === document.body || (target instanceof Element && target.closest('canvas.view, .tree') !== null);
}
