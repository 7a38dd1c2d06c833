// Layouts of lightmaps: the shown layout, the next layout, which collects its geometry and light in the background, and
// the pages of the quantity that is shown besides irradiance. Decides when the next layout is ready; the viewer shows
// it.

import type { WebGLRenderer } from 'three';
import type { Gltf } from '../../document/gltf';
import type { LampWebs } from '../../document/lights';
import type { LightmapsNote, MeasuredPlane } from '../../protocol/messages';
import { LightmapSet } from '../light/lightmap_set';
import type { LitScene } from './lit_scene';

/** A new layout is shown when its error is below this, or after so long. */
const READY_ERROR = 0.35;
const READY_AFTER_MS = 900;

interface Staged {
  set: LightmapSet;
  scene?: LitScene;
  since: number;
}

export class Layouts {
  shown: LitScene | undefined;
  /** Pages of another quantity (error, unshot light), of the newest layout; undefined: only irradiance is streamed. */
  dataSet: LightmapSet | undefined;
  /** The same for the shown layout: pages of another layout would not fit its surfaces. */
  shownData: LightmapSet | undefined;
  private staged: Staged | undefined;
  private isKnown = true;
  /** The scene's document as it is now. */
  private document: Gltf = { asset: { version: '2.0' } };
  private lamp: number | undefined;
  private webs: LampWebs = new Map();
  private measured: { planes: readonly MeasuredPlane[]; document: Gltf } | undefined;

  constructor(
    private readonly renderer: WebGLRenderer,
    private readonly used: (bytes: number) => void,
  ) {}

  /** The pages that tiles of irradiance belong to. */
  get set(): LightmapSet | undefined {
    return this.staged?.set ?? this.shown?.set;
  }

  /** The pages that tiles of a quantity belong to; undefined: the quantity is not shown. */
  setOf(quantity: string): LightmapSet | undefined {
    if (quantity === 'irradiance') return this.set;
    return this.dataSet?.quantity === quantity ? this.dataSet : undefined;
  }

  /** All pages that have textures on the card. */
  get sets(): LightmapSet[] {
    const all = [this.shown?.set, this.staged?.set, this.dataSet, this.shownData];
    return [...new Set(all.filter((set) => set !== undefined))];
  }

  /** The geometry of the next layout; undefined: it has not come yet. */
  get stagedScene(): LitScene | undefined {
    return this.staged?.scene;
  }

  /**
   * The server tells of a layout. Returns its pages, whose geometry is to be fetched; undefined: it is no new layout.
   */
  expect(note: LightmapsNote): LightmapSet | undefined {
    if (this.isKnown && this.set?.note.layout === note.layout && samePages(this.set.note, note)) return undefined;
    this.isKnown = true;
    this.dropStaged();
    const set = new LightmapSet(this.renderer, note, 'irradiance', this.used);
    this.staged = { set, since: performance.now() };
    if (this.dataSet !== this.shownData) this.dataSet?.dispose();
    this.dataSet = undefined; // its pages are of the old layout; those that are shown stay
    return set;
  }

  /** The server may have restarted: its next layout is new, whatever its number. */
  forget(): void {
    this.isKnown = false;
  }

  /** Whether the pages are of the next layout, and not of one that is overtaken. */
  awaits(set: LightmapSet): boolean {
    return this.staged?.set === set;
  }

  /** Puts edits onto the objects that are there: JSON pointers; none: all of the document. */
  applyDocument(document: Gltf, pointers: string[]): void {
    this.document = document;
    this.shown?.applyPointers(document, pointers);
    this.stagedScene?.applyPointers(document, pointers);
  }

  /** The lamp of a node shows more of itself; undefined: none does. */
  selectLamp(node: number | undefined): void {
    this.lamp = node;
    this.shown?.selectLamp(node, this.webs, this.document);
  }

  /** The photometric webs that are known. */
  showWebs(webs: LampWebs): void {
    this.webs = webs;
    this.selectLamp(this.lamp);
  }

  /** The document may have been edited since the scene's geometry was made. */
  bringUpToDate(scene: LitScene): void {
    if (this.measured) scene.planes.take(this.measured.planes, this.measured.document);
    scene.applyDocument(this.document);
  }

  /** Shows the light on measuring planes, which were measured in the document as it is now. */
  showPlanes(planes: readonly MeasuredPlane[]): void {
    this.measured = { planes, document: structuredClone(this.document) };
    for (const scene of [this.shown, this.stagedScene]) if (scene) this.bringUpToDate(scene);
  }

  stage(scene: LitScene, set: LightmapSet): void {
    this.staged = { set, scene, since: performance.now() };
  }

  /** The first layout is ready at once; a later one when its light has come, so that the picture does not go dark. */
  takeReady(now: number): LitScene | undefined {
    const { staged } = this;
    if (!staged?.scene) return undefined;
    const streamed = this.dataSet ?? staged.set;
    const lit = streamed.covered && streamed.waiting === 0 && streamed.error < READY_ERROR;
    if (this.shown && !lit && now - staged.since < READY_AFTER_MS) return undefined;
    this.staged = undefined;
    return staged.scene;
  }

  dropStaged(): void {
    this.staged?.scene?.dispose();
    this.staged?.set.dispose();
    this.staged = undefined;
  }

  /** Makes pages for a quantity besides irradiance; undefined: for none. */
  setDataQuantity(quantity: string | undefined): void {
    if (this.dataSet?.quantity === quantity) return;
    if (this.dataSet !== this.shownData) this.dataSet?.dispose();
    const note = this.set?.note;
    this.dataSet = quantity && note ? new LightmapSet(this.renderer, note, quantity, this.used) : undefined;
    this.bindData();
  }

  /** Gives the surfaces their data pages. Until the next layout is shown, its new pages wait and the old ones stay. */
  bindData(): void {
    const { shown, dataSet, shownData: before } = this;
    if (dataSet?.note === shown?.set.note) this.shownData = dataSet;
    else if (before?.note !== shown?.set.note || before?.quantity !== dataSet?.quantity) this.shownData = undefined;
    if (before !== this.shownData) before?.dispose();
    shown?.eachMaterial((material) => {
      const index = material.page ? shown.set.pages.indexOf(material.page) : -1;
      material.setDataPage(this.shownData?.pages[index]);
    });
  }
}

function samePages(a: LightmapsNote, b: LightmapsNote): boolean {
  return (
    a.pages.length === b.pages.length &&
    a.pages.every((page, i) => page.width === b.pages[i]!.width && page.height === b.pages[i]!.height)
  );
}
