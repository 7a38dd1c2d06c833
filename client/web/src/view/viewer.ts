// The picture: owns the WebGL context, the scene on the screen and the light on it. Draws only when something changed.
// Main thread. A new layout of lightmaps is prepared beside the one that is shown and takes its place when it is lit.

import { type Intersection, LinearSRGBColorSpace, NoToneMapping, type Object3D, Scene, WebGLRenderer } from 'three';
import type { Gltf } from '../document/gltf';
import type { LightmapsNote } from '../protocol/messages';
import { CameraRig } from './camera_rig';
import { ExposureMeter } from './exposure';
import { FrameFences } from './frame_fences';
import { FramePace } from './frame_pace';
import { Gizmo, type GizmoMode } from './gizmo';
import { ViewUniforms } from './lit_material';
import { LightGate } from './light_gate';
import { LightmapSet } from './lightmap_set';
import { LitScene } from './lit_scene';
import type { People } from './people';
import { PagesView } from './pages_view';
import { pick, readingAt, type Reading } from './picker';
import { exposureByRays } from './ray_exposure';
import { release } from './release';
import { Screen } from './screen';
import type { ViewMode } from './view_modes';

/** For taking up tiles, of the 16 that a frame has; of longer ones the same share, but no task of 50. */
const TILE_BUDGET_MS = 5;
const TILE_SHARE = 0.3;
const MOST_TILE_MS = 20;
/** A new layout is shown when its light is this far, or after so long. */
const READY_ERROR = 0.35;
const READY_AFTER_MS = 900;
const MEASURE_EVERY_MS = 250;
/** Reading back waits for all that the card has still to draw, which a slow one makes long: rest so many times that. */
const MEASURE_SHARE = 8;
/** A card that is busy with the first light takes long: what it told of half of that is not to stay for ten times as long. */
const MOST_PAUSE_MS = 1500;
/** A driver that never says it is done (a lost context) holds nothing up for longer. */
const MOST_COMPILING_MS = 2000;
/** What an edit changes shall be seen soon; how sharp comes after it. */
const EDIT_HURRY_MS = 700;
/** Length of the pyramid that stands for another viewer, of the scene's diagonal. */
const PERSON_SIZE = 0.04;

/** What leaves a surface is this much less than what arrives, at the dark end of the scale. */
const DARKEST = 0.1;
/** What is left to shoot counts for nothing where it is less than this of what arrives at the bright end. */
const LEAST_UNSHOT = 0.01;

export interface ViewerEvents {
  used(bytes: number): void;
  /** After each picture. */
  drawn(): void;
  sceneShown(scene: LitScene): void;
  gizmoDragging(active: boolean): void;
  gizmoChanged(object: Object3D, mode: GizmoMode): void;
  contextLost(lost: boolean): void;
}

interface Staged {
  set: LightmapSet;
  scene?: LitScene;
  since: number;
}

export class Viewer {
  readonly renderer: WebGLRenderer;
  readonly uniforms = new ViewUniforms();
  readonly rig: CameraRig;
  readonly exposure: ExposureMeter;
  readonly gizmo: Gizmo;
  readonly pagesView: PagesView;
  readonly screen: Screen;
  shown: LitScene | undefined;
  /** Pages of error or unshot light, where they are streamed, of the newest layout. */
  dataSet: LightmapSet | undefined;
  /** Those on the screen, of the layout that is shown: others would lie elsewhere on its surfaces. */
  shownData: LightmapSet | undefined;
  mode: ViewMode | undefined;
  autoRange = true;
  private staged: Staged | undefined;
  private people: People | undefined;
  private readonly anisotropy: number;
  private readonly pace: FramePace;
  private readonly fences: FrameFences;
  private scale: number;
  private readonly world = new Scene();
  private wanted = true;
  /** Something has changed that the scale of false colours, and the exposure, may depend on. */
  private scaleDue = true;
  private exposureDue = true;
  private lastFrame = 0;
  private lastMeasure = 0;
  private lastScale = 0;
  private lost = false;
  /** What is shown took the place of another scene's light. */
  private replaced = false;
  /** Irradiance at the dark and bright end of what was last known, lux. */
  private lightRange: [number, number] | undefined;
  private layoutKnown = true;
  private readonly gate = new LightGate();
  private document: Gltf = { asset: { version: '2.0' } };

  constructor(
    readonly canvas: HTMLCanvasElement,
    private readonly events: ViewerEvents,
  ) {
    this.renderer = new WebGLRenderer({ canvas, antialias: false, alpha: true, powerPreference: 'high-performance' });
    this.renderer.toneMapping = NoToneMapping; // our shaders do it, and the encoding, so that one program serves all
    this.renderer.outputColorSpace = LinearSRGBColorSpace;
    // Each answer about a program's text waits for all that the card has to do; a program that fails is heard of anyway.
    this.renderer.debug.checkShaderErrors = import.meta.env.DEV;
    // Asked for here, where nothing is being drawn that the answer would have to wait for.
    this.anisotropy = Math.min(8, this.renderer.capabilities.getMaxAnisotropy());
    this.renderer.setClearColor(0, 0); // the page's own background shows behind the scene
    const gl = this.renderer.getContext() as WebGL2RenderingContext;
    this.pace = new FramePace(drawsWithoutCard(gl));
    this.scale = this.pace.firstScale;
    this.fences = new FrameFences(gl);
    this.screen = new Screen(this.renderer, gl); // which smooths edges
    this.rig = new CameraRig(canvas, () => this.moved());
    this.exposure = new ExposureMeter(this.renderer, this.uniforms, () => this.pace.isIdle);
    this.pagesView = new PagesView(canvas, this.uniforms, () => this.moved());
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
    this.scaleDue = true;
    this.exposureDue = true;
  }

  /** What is looked at moves, or was changed by hand: it shall be seen soon. */
  moved(): void {
    this.pace.hurry(performance.now());
    this.invalidate();
  }

  /** The set that tiles of irradiance belong to. */
  get set(): LightmapSet | undefined {
    return this.staged?.set ?? this.shown?.set;
  }

  /** The set that tiles of a quantity belong to; undefined: nobody looks at it. */
  setOf(quantity: string): LightmapSet | undefined {
    if (quantity === 'irradiance') return this.set;
    return this.dataSet?.quantity === quantity ? this.dataSet : undefined;
  }

  /** Pages have a new layout. Returns the set whose geometry is to be fetched; undefined: it is the one that is there. */
  expectLayout(note: LightmapsNote): LightmapSet | undefined {
    if (this.layoutKnown && this.set?.note.layout === note.layout && samePages(this.set.note, note)) return undefined;
    this.layoutKnown = true;
    this.dropStaged();
    const set = new LightmapSet(this.renderer, note, 'irradiance', this.events.used);
    this.staged = { set, since: performance.now() };
    if (this.dataSet !== this.shownData) this.dataSet?.dispose();
    this.dataSet = undefined; // its tiles are not those of the new layout; what is on the screen stays there
    return set;
  }

  /** The server may have started again: its next layout is new, whatever its number. */
  forgetLayout(): void {
    this.layoutKnown = false;
  }

  /** Geometry of a layout. A set that was overtaken is dropped. */
  async load(glb: ArrayBuffer, set: LightmapSet): Promise<void> {
    const scene = await LitScene.load(glb, set, this.uniforms, this.anisotropy);
    let taken = false;
    try {
      if (this.staged?.set !== set) return;
      scene.applyDocument(this.document);
      await this.compile(scene);
      if (this.staged?.set !== set) return;
      scene.applyDocument(this.document); // it may have been edited meanwhile
      this.staged.scene = scene;
      this.staged.since = performance.now();
      taken = true;
      this.invalidate();
    } finally {
      if (!taken) scene.dispose();
    }
  }

  /** Has the driver make the scene's programs while the page goes on, where it can: drawing waits for them. */
  private async compile(scene: LitScene): Promise<void> {
    if (!this.renderer.extensions.has('KHR_parallel_shader_compile')) return;
    const timeUp = new Promise((resolve) => setTimeout(resolve, MOST_COMPILING_MS));
    await Promise.race([this.renderer.compileAsync(scene.root, this.rig.camera, this.world), timeUp]);
  }

  /** The solve does not go on: where nothing has shone there is no light. */
  settleLight(): void {
    if (this.set?.lit !== false) return;
    this.set.settle();
    this.invalidate();
  }

  /** Nothing to show any more (the server has no scene). */
  clear(): void {
    this.dropStaged();
    this.replaceShown(undefined);
    this.setDataQuantity(undefined);
  }

  applyDocument(document: Gltf, pointers: string[]): void {
    this.document = document;
    this.shown?.applyPointers(document, pointers);
    this.staged?.scene?.applyPointers(document, pointers);
    this.gizmo.refresh();
    // The document of a scene that has just come is no edit: its first light may be sharp.
    if (this.shown?.set.showsLight) this.pace.hurry(performance.now(), EDIT_HURRY_MS);
    this.invalidate();
  }

  /** Pages for a quantity beside irradiance, or none. */
  setDataQuantity(quantity: string | undefined): LightmapSet | undefined {
    if (this.dataSet?.quantity === quantity) return this.dataSet;
    if (this.dataSet !== this.shownData) this.dataSet?.dispose();
    const note = this.set?.note;
    this.dataSet = quantity && note ? new LightmapSet(this.renderer, note, quantity, this.events.used) : undefined;
    this.bindData();
    return this.dataSet;
  }

  setMode(mode: ViewMode): void {
    this.mode = mode;
    this.uniforms.all.viewMode.value = mode.number;
    this.pagesView.active = mode.flat === true;
    this.rig.enabled = !mode.flat;
    this.gizmo.setVisible(!mode.flat);
    if (mode.flat) this.pagesView.show(this.shown?.set);
    this.updateRange();
    this.moved();
  }

  pickAt(x: number, y: number): Intersection | undefined {
    return this.shown && !this.mode?.flat ? pick(this.shown, this.rig.camera, x, y) : undefined;
  }

  readAt(x: number, y: number): Reading | undefined {
    const hit = this.pickAt(x, y);
    const errors = this.shownData?.quantity === 'error' ? this.shownData.pages : undefined;
    return hit && this.shown ? readingAt(this.shown, hit, errors) : undefined;
  }

  /** The graphics card was taken away. */
  get isLost(): boolean {
    return this.lost;
  }

  /** Where others look from is drawn into the picture. */
  showPeople(people: People): void {
    this.people = people;
    this.world.add(people.root);
  }

  select(node: number | undefined): void {
    const object = node === undefined ? undefined : (this.lampRoot(node) ?? this.shown?.nodes.get(node));
    this.gizmo.attach(object);
    this.moved();
  }

  /** PNG of what is on the screen. */
  async picture(): Promise<Blob> {
    await this.settle();
    this.setSigns(false);
    this.draw(1);
    this.setSigns(true);
    this.invalidate();
    return new Promise((resolve, reject) =>
      this.canvas.toBlob((blob) =>
        blob ? resolve(blob) : reject(new Error('the browser could not encode the picture')),
      ),
    );
  }

  /** A lamp that came with an edit has a marker before it has a node in the geometry. */
  private lampRoot(node: number): Object3D | undefined {
    return this.shown?.nodes.has(node) ? undefined : this.shown?.lamps.get(node);
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
    if (taken > 0) this.invalidate();
    this.promote(now);
    if (this.rig.update(seconds)) this.invalidate();
    if (this.people?.step(seconds, this.rig.sceneSize * PERSON_SIZE)) this.wanted = true;
    this.gate.turn(now, this.shown?.set.lit === true && this.exposure.unknown, this.replaced);
    this.measure(now);
    if (this.exposure.step(seconds)) this.wanted = true;
    const streamed = this.dataSet ?? this.shown?.set;
    if (streamed?.complete === false) this.pace.hurry(now, 0); // the first light is soon first, and then sharp
    if ((!this.wanted && !this.pace.isSharpDue(now)) || this.gate.standsStill(now)) return;
    if (this.exposure.wantsQuiet) return;
    const scale = this.pace.ask(now);
    if (scale === undefined) return;
    this.wanted = false;
    this.draw(scale);
    this.pace.began(now, scale);
    this.fences.put(now);
    this.events.drawn();
  }

  /** `scale`: of each side, to draw fewer pixels than the screen has. */
  private draw(scale: number): void {
    this.scale = scale;
    if (!this.gate.isClosed(performance.now())) this.shown?.set.showLight();
    this.shown?.eachMaterial((material) => material.refresh());
    this.pagesView.refresh();
    this.people?.leaveOut(this.rig.camera);
    const flat = this.mode?.flat;
    const [scene, camera] = flat ? [this.pagesView.scene, this.pagesView.camera] : [this.world, this.rig.camera];
    this.screen.draw(scale, () => this.renderer.render(scene, camera));
    if (this.people) {
      this.people.labels.hidden = flat === true;
      this.people.placeLabels(this.rig.camera, this.canvas.clientWidth, this.canvas.clientHeight);
    }
  }

  /** What changes during a pause is measured after it: the last tiles of a solve, too. */
  private measure(now: number): void {
    if (this.scaleDue && now - this.lastScale >= MEASURE_EVERY_MS) {
      this.lastScale = now;
      this.scaleDue = false;
      if (this.uniforms.all.falseColour.value) {
        this.updateRange();
        this.wanted = true;
      }
    }
    const { unknown, automatic } = this.exposure;
    const share = Math.min(MOST_PAUSE_MS, MEASURE_SHARE * this.exposure.tookMs);
    const pause = unknown ? 0 : Math.max(MEASURE_EVERY_MS, share);
    if (!this.exposureDue || now - this.lastMeasure < pause) return;
    const { covered, complete, waiting } = this.shown?.set ?? {};
    if (!this.gate.mayMeasure(now, covered === true, complete === true && waiting === 0)) return;
    this.lastMeasure = now;
    if (unknown && this.guessExposure(now)) return; // and the card has the first light itself to draw
    this.exposureDue = false;
    if (automatic && (unknown || !this.mode?.flat)) void this.measureNow().then(() => (this.wanted = true));
  }

  private guessExposure(now: number): boolean {
    const guess = this.shown && exposureByRays(this.shown, this.rig.camera);
    if (guess === undefined) return false;
    this.exposure.guess(guess);
    this.gate.turn(now, false);
    return (this.wanted = true);
  }

  /** Signs and handles are no part of the scene's light. */
  private measureNow(): Promise<void> {
    this.setSigns(false);
    const measured = this.exposure.measure(this.world, this.rig.camera);
    this.setSigns(true);
    return measured;
  }

  /** Handles, lamps' signs and other viewers. */
  private setSigns(visible: boolean): void {
    this.gizmo.setVisible(visible && !this.mode?.flat);
    for (const lamp of this.shown?.lamps.values() ?? []) lamp.visible = visible;
    if (this.people) this.people.root.visible = visible;
  }

  /** Ends when the picture has the exposure that the light there is now asks for. */
  async settle(): Promise<void> {
    while (this.shown && this.set?.waiting) await new Promise((resolve) => setTimeout(resolve, 20));
    for (let again = 0; again < 2 && this.shown; ++again) await this.measureNow(); // the first may have been on its way
    this.exposure.settle();
    this.exposure.step(0);
    this.shown?.set.showLight();
    this.invalidate();
  }

  /**
   * Unshot light is shown by how bright the scene is: by a scale of its own the little that is left at the end would look
   * like much. As long as it is streamed no irradiance comes, and a layout that comes meanwhile has none: the last stays.
   */
  private updateRange(): void {
    if (!this.autoRange) return;
    const isUnshot = this.mode?.quantity === 'unshot';
    const isOfLight = isUnshot || this.mode?.quantity === 'irradiance';
    const range = (isOfLight ? this.shown?.set : this.shownData)?.range() ?? (isUnshot ? this.lightRange : undefined);
    if (!range) return;
    if (isOfLight) this.lightRange = range;
    const [low, high] = range;
    const darkest = isUnshot ? LEAST_UNSHOT * high : this.mode?.id === 'radiosity' ? DARKEST * low : low;
    this.uniforms.all.falseRange.value.set(darkest, high);
  }

  /** The first scene shows at once; a later one when its light has come, so that nothing goes dark in between. */
  private promote(now: number): void {
    const staged = this.staged;
    if (!staged?.scene || this.gizmo.dragging) return; // what is held is not taken out of the hand
    const streamed = this.dataSet ?? staged.set;
    const lit = streamed.covered && streamed.waiting === 0 && streamed.error < READY_ERROR;
    if (this.shown && !lit && now - staged.since < READY_AFTER_MS) return;
    this.staged = undefined;
    this.replaceShown(staged.scene);
    this.bindData();
    this.events.sceneShown(staged.scene);
  }

  private replaceShown(scene: LitScene | undefined): void {
    const before = this.shown;
    this.replaced = before?.set.lit === true;
    this.shown = scene;
    if (before) {
      this.gizmo.attach(undefined);
      before.dispose();
      before.set.dispose();
    }
    if (scene) {
      this.world.add(scene.root);
      this.rig.setBounds(scene.bounds);
    }
    this.pagesView.show(this.mode?.flat ? scene?.set : undefined); // it keeps no pages that are gone
    this.invalidate();
  }

  private dropStaged(): void {
    this.staged?.scene?.dispose();
    this.staged?.set.dispose();
    this.staged = undefined;
  }

  /** Data of the layout that is shown; as long as they are only of the next, those there are of the quantity. */
  private bindData(): void {
    const { shown, dataSet, shownData: before } = this;
    if (dataSet?.note === shown?.set.note) this.shownData = dataSet;
    else if (before?.note !== shown?.set.note || before?.quantity !== dataSet?.quantity) this.shownData = undefined;
    if (before !== this.shownData) before?.dispose();
    shown?.eachMaterial((material) => {
      const index = material.page ? shown.set.pages.indexOf(material.page) : -1;
      material.setDataPage(this.shownData?.pages[index]);
    });
    this.invalidate();
  }

  private resize(): void {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    if (width === 0 || height === 0) return;
    this.screen.resize(width, height, Math.min(devicePixelRatio, 2));
    this.rig.resize(width / height);
    this.pagesView.resize(width / height);
    if (this.shown) this.draw(this.scale); // resizing clears the canvas: drawn at once, it does not blink
    this.invalidate();
  }

  private onContext(lost: boolean): void {
    this.lost = lost;
    this.pace.forget();
    this.fences.forget();
    this.screen.forget();
    this.exposure.forgetCard();
    const sets = new Set([this.shown?.set, this.staged?.set, this.dataSet, this.shownData]);
    if (lost) {
      for (const root of [this.world, this.pagesView.scene, this.staged?.scene?.root]) if (root) release(root);
      for (const set of sets) set?.release();
    } else {
      for (const set of sets) set?.restore();
      this.invalidate();
    }
    this.events.contextLost(lost);
  }
}

/** What the browser says of the card, where it says anything. */
function drawsWithoutCard(gl: WebGL2RenderingContext): boolean {
  let name = String(gl.getParameter(gl.RENDERER));
  // Only browsers that hide the name there are asked for it in the old way, which others warn of.
  const extension = name === 'WebKit WebGL' ? gl.getExtension('WEBGL_debug_renderer_info') : null;
  if (extension) name = String(gl.getParameter(extension.UNMASKED_RENDERER_WEBGL));
  return /swiftshader|llvmpipe|softpipe|software|basic render/i.test(name);
}

function samePages(a: LightmapsNote, b: LightmapsNote): boolean {
  return (
    a.pages.length === b.pages.length &&
    a.pages.every((page, i) => page.width === b.pages[i]!.width && page.height === b.pages[i]!.height)
  );
}
