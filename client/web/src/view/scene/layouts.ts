// Layouts of lightmaps: the one that is on the screen, the next, which gets its geometry and its light beside it, and the
// pages of what is looked at besides irradiance. Knows when the next one's turn has come; who shows it is the viewer.

import type { WebGLRenderer } from 'three';
import type { LightmapsNote } from '../../protocol/messages';
import { LightmapSet } from '../light/lightmap_set';
import type { LitScene } from './lit_scene';

/** A new layout is shown when its light is this far, or after so long. */
const READY_ERROR = 0.35;
const READY_AFTER_MS = 900;

interface Staged {
  set: LightmapSet;
  scene?: LitScene;
  since: number;
}

export class Layouts {
  shown: LitScene | undefined;
  /** Pages of error or unshot light, where they are streamed, of the newest layout. */
  dataSet: LightmapSet | undefined;
  /** Those on the screen, of the layout that is shown: others would lie elsewhere on its surfaces. */
  shownData: LightmapSet | undefined;
  private staged: Staged | undefined;
  private isKnown = true;

  constructor(
    private readonly renderer: WebGLRenderer,
    private readonly used: (bytes: number) => void,
  ) {}

  /** The set that tiles of irradiance belong to. */
  get set(): LightmapSet | undefined {
    return this.staged?.set ?? this.shown?.set;
  }

  /** The set that tiles of a quantity belong to; undefined: nobody looks at it. */
  setOf(quantity: string): LightmapSet | undefined {
    if (quantity === 'irradiance') return this.set;
    return this.dataSet?.quantity === quantity ? this.dataSet : undefined;
  }

  /** Everything that has textures on the card. */
  get sets(): LightmapSet[] {
    const all = [this.shown?.set, this.staged?.set, this.dataSet, this.shownData];
    return [...new Set(all.filter((set) => set !== undefined))];
  }

  /** The geometry of the next layout, as soon as it is there. */
  get stagedScene(): LitScene | undefined {
    return this.staged?.scene;
  }

  /** Pages have a new layout. Returns the set whose geometry is to be fetched; undefined: it is the one that is there. */
  expect(note: LightmapsNote): LightmapSet | undefined {
    if (this.isKnown && this.set?.note.layout === note.layout && samePages(this.set.note, note)) return undefined;
    this.isKnown = true;
    this.dropStaged();
    const set = new LightmapSet(this.renderer, note, 'irradiance', this.used);
    this.staged = { set, since: performance.now() };
    if (this.dataSet !== this.shownData) this.dataSet?.dispose();
    this.dataSet = undefined; // its tiles are not those of the new layout; what is on the screen stays there
    return set;
  }

  /** The server may have started again: its next layout is new, whatever its number. */
  forget(): void {
    this.isKnown = false;
  }

  /** The geometry of this set is waited for: it was not overtaken. */
  awaits(set: LightmapSet): boolean {
    return this.staged?.set === set;
  }

  stage(scene: LitScene, set: LightmapSet): void {
    this.staged = { set, scene, since: performance.now() };
  }

  /** The first scene shows at once; a later one when its light has come, so that nothing goes dark in between. */
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

  /** Pages for a quantity beside irradiance, or none. */
  setDataQuantity(quantity: string | undefined): void {
    if (this.dataSet?.quantity === quantity) return;
    if (this.dataSet !== this.shownData) this.dataSet?.dispose();
    const note = this.set?.note;
    this.dataSet = quantity && note ? new LightmapSet(this.renderer, note, quantity, this.used) : undefined;
    this.bindData();
  }

  /** Data of the layout that is shown; as long as they are only of the next, those there are of the quantity. */
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
