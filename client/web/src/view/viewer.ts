// The picture. It owns the WebGL context, the shown scene and the light on it, and draws only when something has
// changed. Main thread.

import {
  type Box3,
  type Intersection,
  LinearSRGBColorSpace,
  NoToneMapping,
  type Object3D,
  Scene,
  Vector3,
  WebGLRenderer,
} from 'three';
import type { Gltf } from '../document/gltf';
import type { LampWebs } from '../document/lights';
import { pause } from '../page/pause';
import type { MeasuredPlane, Sky } from '../protocol/messages';
import { Brightness } from './exposure/brightness';
import { CameraRig } from './controls/camera_rig';
import type { ExposureMeter } from './exposure/exposure';
import { FrameFences } from './frames/frame_fences';
import { FramePace } from './frames/frame_pace';
import { Gizmo, type GizmoMode } from './controls/gizmo';
import { Layouts } from './scene/layouts';
import type { LightmapSet } from './light/lightmap_set';
import { ViewUniforms } from './scene/lit_material';
import { LitScene } from './scene/lit_scene';
import { surfaceBox } from './scene/object_box';
import type { People } from './controls/people';
import { PagesView } from './controls/pages_view';
import { pick, pickSurface, readingAt, type Reading } from './rays/picker';
import { Programs } from './scene/programs';
import { release } from './scene/release';
import { Screen } from './frames/screen';
import { SkyBackground, skyOf } from './scene/sky';
import { SkyPicture } from './scene/sky_picture';
import type { ViewMode } from './looks/view_modes';

/**
 * Time for taking up tiles, of a frame of 16 ms. Longer frames get the same share, but less than a long task (50 ms).
 */
const TILE_BUDGET_MS = 5;
const TILE_SHARE = 0.3;
const MOST_TILE_MS = 20;
/** Textures stay sharp at a slant. */
const MOST_ANISOTROPY = 8;
/** Between looks whether waiting tiles were taken up. */
const LOOK_MS = 20;
/** For so long after an edit a soon picture is worth more than a sharp one. */
const EDIT_HURRY_MS = 700;
/** Length of the pyramid that stands for another viewer, as a part of the scene's diagonal. */
const PERSON_SIZE = 0.04;
/** Size of the surroundings of a lamp, as a part of the scene's diagonal. */
const LAMP_ROOM = 0.2;

export interface ViewerEvents {
  used(bytes: number): void;
  /** After each picture. */
  drawn(): void;
  sceneShown(scene: LitScene): void;
  gizmoDragging(active: boolean): void;
  gizmoChanged(object: Object3D, mode: GizmoMode): void;
  contextLost(lost: boolean): void;
}

export class Viewer {
  readonly renderer: WebGLRenderer;
  readonly uniforms = new ViewUniforms();
  readonly background = new SkyBackground(this.uniforms);
  readonly rig: CameraRig;
  readonly gizmo: Gizmo;
  readonly pagesView: PagesView;
  readonly screen: Screen;
  readonly layouts: Layouts;
  readonly brightness: Brightness;
  mode: ViewMode | undefined;
  private people: People | undefined;
  private readonly pace: FramePace;
  private readonly fences: FrameFences;
  private readonly programs: Programs;
  private scale: number;
  private readonly world = new Scene();
  private wanted = true;
  private lastFrame = 0;
  private lost = false;

  constructor(
    canvas: HTMLCanvasElement,
    private readonly events: ViewerEvents,
  ) {
    this.renderer = new WebGLRenderer({ canvas, antialias: false, alpha: true, powerPreference: 'high-performance' });
    this.renderer.toneMapping = NoToneMapping; // our shaders map and encode, as they know which values are light
    this.renderer.outputColorSpace = LinearSRGBColorSpace;
    // Each answer about a shader waits for all that the card has to do, and a program that fails is reported anyway.
    this.renderer.debug.checkShaderErrors = import.meta.env.DEV;
    // three.js keeps the answer, which later would have to wait for all that is being drawn.
    this.renderer.capabilities.getMaxAnisotropy();
    this.renderer.setClearColor(0, 0); // the page's own background shows behind the scene
    const gl = this.renderer.getContext() as WebGL2RenderingContext;
    this.pace = new FramePace(drawsWithoutCard(gl));
    this.scale = this.pace.firstScale;
    this.fences = new FrameFences(gl);
    this.screen = new Screen(this.renderer, gl);
    this.rig = new CameraRig(canvas, () => this.moved());
    this.layouts = new Layouts(this.renderer, events.used);
    this.programs = new Programs(this.renderer, this.rig.camera, this.world, this.uniforms);
    this.brightness = this.makeBrightness();
    this.pagesView = new PagesView(canvas, this.uniforms, () => this.moved());
    this.world.add(this.background.mesh);
    this.gizmo = new Gizmo(this.world, this.rig.camera, canvas, {
      dragging: (active) => {
        this.rig.enabled = !active;
        events.gizmoDragging(active);
      },
      changed: (object, mode) => events.gizmoChanged(object, mode),
      redraw: () => (this.gizmo.dragging ? this.moved() : this.invalidate()),
    });
    new ResizeObserver(() => this.resize()).observe(canvas);
    canvas.addEventListener('webglcontextlost', () => this.onContext(true));
    canvas.addEventListener('webglcontextrestored', () => this.onContext(false));
    this.resize();
    requestAnimationFrame((now) => this.frame(now));
  }

  invalidate(): void {
    this.wanted = true;
    this.brightness.changed();
  }

  /** The user has moved the camera or an object, and waits to see it. */
  moved(): void {
    this.pace.moved(performance.now());
    this.invalidate();
  }

  get canvas(): HTMLCanvasElement {
    return this.renderer.domElement;
  }

  get exposure(): ExposureMeter {
    return this.brightness.exposure;
  }

  get shown(): LitScene | undefined {
    return this.layouts.shown;
  }

  /** The pages that tiles of irradiance belong to. */
  get set(): LightmapSet | undefined {
    return this.layouts.set;
  }

  /** The pages of the quantity that is shown besides irradiance. */
  get dataSet(): LightmapSet | undefined {
    return this.layouts.dataSet;
  }

  /** Takes the geometry of a layout; drops it if there is a newer layout. */
  async load(glb: ArrayBuffer, set: LightmapSet): Promise<void> {
    const anisotropy = Math.min(MOST_ANISOTROPY, this.renderer.capabilities.getMaxAnisotropy());
    const scene = await LitScene.load(glb, set, this.uniforms, anisotropy);
    let taken = false;
    try {
      if (!this.layouts.awaits(set)) return;
      this.layouts.bringUpToDate(scene);
      await this.programs.compile(scene);
      if (!this.layouts.awaits(set)) return;
      // The new materials share the shown scene's programs only if they take them while that scene exists.
      if (this.shown?.showsWhole) this.programs.makeWhole(scene);
      this.layouts.bringUpToDate(scene); // after edits that came meanwhile
      this.layouts.stage(scene, set);
      taken = true;
      this.invalidate();
    } finally {
      if (!taken) scene.dispose();
    }
  }

  /** The solve is over: a black surface is dark, and no longer waits for light. */
  settleLight(): void {
    if (this.set?.lit !== false) return;
    this.set.settle();
    this.invalidate();
  }

  /** The server has no scene. */
  clear(): void {
    this.layouts.dropStaged();
    this.replaceShown(undefined);
    this.setDataQuantity(undefined);
  }

  /** The sky of the solve's settings. */
  setSky(sky: Sky | undefined): void {
    this.background.ofSettings = sky;
    this.invalidate();
  }

  /** All of the sky, where it is more than colours: Radiance HDR. */
  setSkyPicture(bytes: Uint8Array | undefined): void {
    this.background.setPicture(bytes && SkyPicture.from(bytes));
    this.invalidate();
  }

  applyDocument(document: Gltf, pointers: string[]): void {
    this.background.ofScene = skyOf(document);
    this.layouts.applyDocument(document, pointers);
    this.gizmo.refresh();
    // A scene without light has just come; its document is no edit, and its first light may be sharp.
    if (this.shown?.set.showsLight) {
      this.pace.hurry(performance.now(), EDIT_HURRY_MS);
      this.pace.awaitLight(performance.now());
    }
    this.invalidate();
  }

  /** Makes pages for a quantity besides irradiance; undefined: for none. */
  setDataQuantity(quantity: string | undefined): void {
    this.layouts.setDataQuantity(quantity);
    this.invalidate();
  }

  setMode(mode: ViewMode): void {
    this.mode = mode;
    this.uniforms.choose({ VIEW_MODE: mode.number });
    this.pagesView.active = mode.flat === true;
    this.rig.enabled = !mode.flat;
    this.gizmo.setVisible(!mode.flat);
    if (mode.flat) this.pagesView.show(this.shown?.set);
    this.brightness.setMode(mode);
    this.moved();
  }

  pickAt(x: number, y: number): Intersection | undefined {
    return this.shown && !this.mode?.flat ? pick(this.shown, this.rig.camera, x, y) : undefined;
  }

  readAt(x: number, y: number): Reading | undefined {
    if (this.mode?.flat) return this.shown && this.pagesView.readAt(this.shown, x, y);
    const hit = this.shown && pickSurface(this.shown, this.rig.camera, x, y);
    const { shownData } = this.layouts;
    const errors = shownData?.quantity === 'error' ? shownData.pages : undefined;
    return hit && this.shown ? readingAt(this.shown, hit, errors) : undefined;
  }

  /** Shows the light on measuring planes, which were measured in the document as it is now. */
  showPlanes(planes: readonly MeasuredPlane[]): void {
    this.layouts.showPlanes(planes);
    this.moved();
  }

  /** Draws where others look from into the picture. */
  showPeople(people: People): void {
    this.people = people;
    this.world.add(people.root);
  }

  select(node: number | undefined): void {
    this.layouts.selectLamp(node);
    this.gizmo.attach(node === undefined ? undefined : this.objectOf(node));
    this.moved();
  }

  /** The photometric webs that are known: a selected lamp shows its own. */
  showWebs(webs: LampWebs): void {
    this.layouts.showWebs(webs);
    this.invalidate();
  }

  /** The box to frame for a node, in metres: around its surfaces, or the surroundings of a lamp without surfaces. */
  boxOf(node: number): Box3 | undefined {
    const object = this.objectOf(node);
    const box = object && surfaceBox(object);
    if (!box?.isEmpty()) return box;
    const room = new Vector3().setScalar(LAMP_ROOM * this.rig.sceneSize);
    return this.shown?.lamps.has(node)
      ? box.setFromCenterAndSize(object!.getWorldPosition(new Vector3()), room)
      : undefined;
  }

  /** PNG of the picture, without signs. */
  async picture(): Promise<Blob> {
    await this.settle();
    this.withoutSigns(() => this.draw(1));
    this.invalidate();
    return new Promise((resolve, reject) =>
      this.canvas.toBlob((blob) =>
        blob ? resolve(blob) : reject(new Error('the browser could not encode the picture')),
      ),
    );
  }

  /** A new lamp has a marker before the geometry has its node. */
  private objectOf(node: number): Object3D | undefined {
    return this.shown?.nodes.get(node) ?? this.shown?.lamps.anchorOf(node) ?? this.shown?.planes.get(node);
  }

  private frame(now: number): void {
    requestAnimationFrame((next) => this.frame(next));
    const sinceMs = now - this.lastFrame;
    const seconds = Math.min(0.25, sinceMs / 1000);
    const tileMs = Math.min(MOST_TILE_MS, Math.max(TILE_BUDGET_MS, TILE_SHARE * sinceMs));
    this.lastFrame = now;
    if (this.lost) return;
    this.pace.turn(now);
    this.pace.ended(now, this.fences.poll(now));
    const taken = (this.set?.takeUp(tileMs) ?? 0) + (this.dataSet?.takeUp(tileMs) ?? 0);
    if (taken > 0) {
      this.invalidate();
      this.pace.lightCame(now);
    }
    if (!(this.dataSet ?? this.set)?.expectsMore) this.pace.allCame();
    this.promote(now);
    if (this.rig.update(seconds)) this.moved();
    if (this.people?.step(seconds, this.rig.sceneSize * PERSON_SIZE, this.rig.camera.position)) this.wanted = true;
    this.programs.turn(this.shown, this.pace.isAtRest(now));
    if (this.programs.recompile(this.shown, () => (this.wanted = true))) return; // the last picture stays
    this.brightness.turn(now);
    if (this.exposure.step(seconds)) this.wanted = true;
    const streamed = this.dataSet ?? this.shown?.set;
    if (streamed?.complete === false) this.pace.hurry(now, 0); // the first light comes soon first, and sharp later
    if ((!this.wanted && !this.pace.isSharpDue(now)) || this.brightness.standsStill(now)) return;
    if (this.exposure.wantsQuiet) return;
    const scale = this.pace.ask(now);
    if (scale === undefined) return;
    this.wanted = false;
    this.draw(scale);
    this.pace.began(now, scale);
    this.fences.put(now);
    this.events.drawn();
  }

  /** `scale`: of each side; below 1, fewer pixels are drawn than the screen has. */
  private draw(scale: number): void {
    this.scale = scale;
    if (!this.brightness.holdsLightBack(performance.now())) this.shown?.set.showLight();
    this.shown?.specialise(); // for pictures that cannot wait for recompile()
    this.shown?.eachMaterial((material) => material.refresh());
    this.pagesView.refresh();
    this.people?.leaveOut(this.rig.camera);
    this.background.refresh(this.mode?.id === 'lit' && this.shown?.set.showsLight === true);
    const flat = this.mode?.flat;
    const [scene, camera] = flat ? [this.pagesView.scene, this.pagesView.camera] : [this.world, this.rig.camera];
    this.screen.draw(scale, () => this.renderer.render(scene, camera));
    if (this.people) {
      this.people.labels.hidden = flat === true;
      this.people.placeLabels(this.rig.camera, this.canvas.clientWidth, this.canvas.clientHeight);
    }
  }

  private makeBrightness(): Brightness {
    const { renderer, uniforms, layouts, world, rig, background } = this;
    return new Brightness({
      renderer,
      uniforms,
      layouts,
      world,
      camera: rig.camera,
      background,
      mode: () => this.mode,
      withoutSigns: (draw) => this.withoutSigns(draw),
      isCardQuiet: () => this.pace.isQuiet,
      redraw: () => (this.wanted = true),
    });
  }

  /** Draws without handles, lamp signs and other viewers, which are no part of the scene's light. */
  private withoutSigns<T>(draw: () => T): T {
    this.setSigns(false);
    const drawn = draw();
    this.setSigns(true);
    return drawn;
  }

  private setSigns(visible: boolean): void {
    this.gizmo.setVisible(visible && !this.mode?.flat);
    this.shown?.lamps.setVisible(visible);
    this.shown?.planes.setVisible(visible);
    if (this.people) this.people.root.visible = visible;
  }

  /** Ends when the picture has the exposure for the light that is there now. */
  async settle(): Promise<void> {
    while (this.shown && this.set?.waiting) await pause(LOOK_MS);
    this.shown?.specialise();
    await this.brightness.settle();
    this.shown?.set.showLight();
    this.invalidate();
  }

  private promote(now: number): void {
    if (this.gizmo.dragging) return; // the user holds an object of the shown scene
    const scene = this.layouts.takeReady(now);
    if (!scene) return;
    this.replaceShown(scene);
    this.layouts.bindData();
    this.events.sceneShown(scene);
  }

  private replaceShown(scene: LitScene | undefined): void {
    const before = this.shown;
    this.brightness.replacesLight = before?.set.lit === true;
    this.layouts.shown = scene;
    if (before) {
      this.gizmo.attach(undefined);
      before.dispose();
      before.set.dispose();
    }
    if (scene) {
      this.world.add(scene.root);
      this.rig.setBounds(scene.bounds);
    }
    this.pagesView.show(this.mode?.flat ? scene?.set : undefined); // the old pages are gone
    this.invalidate();
  }

  private resize(): void {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    if (width === 0 || height === 0) return;
    this.screen.resize(width, height, Math.min(devicePixelRatio, 2));
    this.rig.resize(width / height);
    this.pagesView.resize(width / height);
    if (this.shown) this.draw(this.scale); // resizing clears the canvas, which would blink
    this.invalidate();
  }

  private onContext(lost: boolean): void {
    this.lost = lost;
    this.pace.forget();
    this.fences.forget();
    this.screen.forget();
    this.programs.forget();
    this.exposure.forgetCard();
    const { sets, stagedScene } = this.layouts;
    if (lost) {
      for (const root of [this.world, this.pagesView.scene, stagedScene?.root]) if (root) release(root);
      for (const set of sets) set.release();
    } else {
      for (const set of sets) set.restore();
      this.invalidate();
    }
    this.events.contextLost(lost);
  }
}

/** Whether the browser draws in software, as far as it tells. */
function drawsWithoutCard(gl: WebGL2RenderingContext): boolean {
  let name = String(gl.getParameter(gl.RENDERER));
  // Only browsers that hide the name need the extension; others warn of its use.
  const extension = name === 'WebKit WebGL' ? gl.getExtension('WEBGL_debug_renderer_info') : null;
  if (extension) name = String(gl.getParameter(extension.UNMASKED_RENDERER_WEBGL));
  return /swiftshader|llvmpipe|softpipe|software|basic render/i.test(name);
}
