// Selecting and changing: the scene's document, the gizmo, undo, files dropped on the page. Part of the App.

import { Vector3, type Object3D } from 'three';
import type { App } from '../app/app';
import { EditHistory } from './edit_history';
import * as edits from '../document/edits';
import {
  type Gltf,
  handlesOf,
  hangingNodes,
  isSameScene,
  lightOf,
  nodeName,
  type Vec3,
  type Vec4,
} from '../document/gltf';
import { SceneDocument, type SendEdit } from '../document/scene_document';
import type { Patch, ScenePatchedNote } from '../protocol/messages';
import { type PageName, shownName } from '../protocol/page_name';
import { ScenePanel, type Selection } from '../ui/scene_panel';
import type { GizmoMode } from '../view/controls/gizmo';

const HANDLES: readonly GizmoMode[] = ['translate', 'rotate', 'scale'];
const GIZMO_LABELS = { translate: 'Move', rotate: 'Rotate', scale: 'Scale' } as const;

export class EditSession {
  readonly panel: ScenePanel;
  readonly document: SceneDocument;
  readonly history: EditHistory;
  selection: Selection | undefined;
  /** The handles that the user has chosen. */
  private wanted: GizmoMode = 'translate';
  /** The document as it came last. */
  private known: Gltf | undefined;
  /** What is held by its handles, as it was before. */
  private dragged: { node: number; before: edits.Placement } | undefined;

  constructor(
    private readonly app: App,
    private readonly name: PageName,
    send: SendEdit,
  ) {
    this.document = new SceneDocument((by) => name.isMine(by), send, {
      changed: (pointers) => this.onChanged(pointers),
      refused: (label, reason) => app.frame.toasts.show(`${label}: ${reason}`, 'bad'),
      historyChanged: () => this.onHistory(),
    });
    this.history = new EditHistory(app, this.document);
    this.panel = new ScenePanel({
      select: (selection) => this.select(selection),
      setColour: (material, rgb) =>
        this.make('Colour', edits.setColour(material, this.document.gltf, rgb), `colour ${material}`),
      setEmission: (material, rgb, strength) =>
        this.make('Emission', edits.setEmission(material, rgb, strength), `emission ${material}`),
      setLight: (light, change) =>
        this.make('Light', edits.setLight(light, change), `light ${light} ${Object.keys(change).join()}`),
      setPlacement: (node, placement) => this.make('Placement', edits.setPlacement(node, placement)),
      setVisible: (node, visible) =>
        this.make(visible ? 'Show' : 'Hide', edits.setVisible(this.document.gltf, node, visible)),
      remove: (node) => this.remove(node),
      addLamp: () => void this.addLamp(),
      frameSelection: () => app.view.frameSelection(),
      endGesture: () => this.document.endGesture(),
      loadFile: (file) => void app.scene.loadFile(file),
      notAccepted: (text, wanted) => app.notAccepted(text, wanted),
    });
  }

  start(): void {
    this.panel.setSelection(undefined);
  }

  onPatched(note: ScenePatchedNote, fetchAnew: () => void): void {
    if (!this.document.patched(note.revision, note.patch, note.by)) fetchAnew();
    if (!this.name.isMine(note.by))
      this.app.frame.toasts.showOnce(
        `${shownName(note.by) || 'Someone'} ${edits.describePatch(this.document.gltf, note.patch)}`,
      );
  }

  /** The objects are new; what was selected may still be there. */
  onSceneShown(): void {
    this.app.viewer.applyDocument(this.document.gltf, []);
    this.panel.setDocument(this.document.gltf, (node) => this.materialsOf(node));
    this.app.viewer.select(this.selection?.node);
  }

  // ---- selection ----

  select(selection: Selection | undefined): void {
    this.selection = selection;
    this.app.viewer.select(this.isPictureOld ? undefined : selection?.node);
    this.offerHandles();
    this.panel.setSelection(selection);
    if (selection && this.app.frame.panelOpen) this.app.frame.showTab('Scene');
  }

  /** Its scene was replaced, and numbers of its objects are those of others: the next picture follows. */
  private get isPictureOld(): boolean {
    const { shown } = this.app.viewer;
    return shown !== undefined && this.known?.nodes !== undefined && !isSameScene(shown.source, this.known);
  }

  selectHit(object: Object3D | undefined): void {
    const scene = this.app.viewer.shown;
    const node = object && !this.isPictureOld ? scene?.nodeOf(object) : undefined;
    this.select(node === undefined ? undefined : { node, material: object && scene?.materialIndexOf(object) });
  }

  /** For those who have no pointer. */
  selectNext(step: number): void {
    const nodes = hangingNodes(this.document.gltf)
      .map(({ node }) => node)
      .filter((node) => this.document.gltf.nodes?.[node]?.mesh !== undefined || lightOf(this.document.gltf, node));
    if (nodes.length === 0) return;
    const at = this.selection ? nodes.indexOf(this.selection.node) : -1;
    const node = nodes[at < 0 ? (step > 0 ? 0 : nodes.length - 1) : (at + step + nodes.length) % nodes.length]!;
    this.select({ node, material: this.materialsOf(node)[0] });
  }

  private materialsOf(node: number): number[] {
    const mesh = this.document.gltf.nodes?.[node]?.mesh;
    const primitives = mesh === undefined ? [] : (this.document.gltf.meshes?.[mesh]?.primitives ?? []);
    return [...new Set(primitives.flatMap((primitive) => primitive.material ?? []))];
  }

  // ---- changes ----

  private make(label: string, patch: Patch, key?: string): void {
    this.document.edit(label, patch, key).catch(() => undefined); // the refusal was shown
  }

  setGizmo(mode: GizmoMode): void {
    if (this.app.viewer.gizmo.dragging) return; // what is held by one kind of handles is let go first
    this.wanted = mode;
    this.offerHandles();
    this.app.viewer.invalidate();
  }

  /** Of the handles, those by which something changes; the user's choice where it is among them. */
  private offerHandles(): void {
    const { gizmo } = this.app.viewer;
    const node = this.selection?.node;
    const offered = node === undefined ? HANDLES : handlesOf(this.document.gltf, node);
    const mode = offered.includes(this.wanted) ? this.wanted : offered[0]!;
    if (mode !== gizmo.mode && !gizmo.dragging) gizmo.setMode(mode);
    this.app.frame.setGizmo(mode, offered);
  }

  onGizmoDragging(active: boolean): void {
    const node = active ? this.selection?.node : undefined;
    const { translation, rotation, scale } = (node === undefined ? undefined : this.document.gltf.nodes?.[node]) ?? {};
    this.dragged = node === undefined ? undefined : { node, before: { translation, rotation, scale } };
    if (!active) this.document.endGesture();
  }

  /** What is held by its handles goes back to where it was, here and on the server. False: nothing is held. */
  cancelDrag(): boolean {
    const { gizmo } = this.app.viewer;
    if (!gizmo.cancel()) return false;
    if (!this.dragged) return true;
    const { node, before } = this.dragged;
    const patch = edits.setPlacement(node, written(gizmo.mode, before));
    const label = `${GIZMO_LABELS[gizmo.mode]} ${nodeName(this.document.gltf, node)}`;
    this.document.cancelGesture(label, `${gizmo.mode} ${node}`, patch).catch(() => undefined); // the refusal was shown
    return true;
  }

  onGizmoChanged(object: Object3D, mode: GizmoMode): void {
    const node = this.selection?.node;
    if (node === undefined) return;
    const rounded = (values: number[]) => values.map((v) => Number(v.toPrecision(7)));
    const placement = written(mode, {
      translation: rounded(object.position.toArray()) as Vec3,
      rotation: unit(object.quaternion.toArray() as Vec4),
      scale: rounded(object.scale.toArray()) as Vec3,
    });
    const label = `${GIZMO_LABELS[mode]} ${nodeName(this.document.gltf, node)}`;
    this.make(label, edits.setPlacement(node, placement), `${mode} ${node}`);
  }

  /** In front of the camera, a third of the way to what it looks at, as bright as the scene is exposed for. */
  async addLamp(): Promise<void> {
    const { rig, exposure, shown } = this.app.viewer;
    if (!shown) return;
    const eye = rig.camera.position;
    const ahead = rig.camera.getWorldDirection(new Vector3());
    const distance = eye.distanceTo(rig.target);
    const at = eye.clone().addScaledVector(ahead, 0.75 * distance);
    shown.bounds.clampPoint(at, at);
    // A grey wall at a quarter of the scene's size away would be a middle grey.
    const reach = shown.bounds.getSize(new Vector3()).length() / 4;
    const candela = Number(((0.5 * Math.PI * reach * reach) / exposure.ofLeaving).toPrecision(2));
    const place = at.toArray().map((v) => Number(v.toPrecision(4))) as Vec3;
    const { patch, node } = edits.addLamp(this.document.gltf, place, candela);
    try {
      await this.document.edit('Add lamp', patch);
      this.select({ node, material: undefined });
    } catch {
      // The refusal was shown.
    }
  }

  removeSelected(): void {
    if (this.selection) this.remove(this.selection.node);
  }

  private remove(node: number): void {
    const patch = edits.detachNode(this.document.gltf, node);
    if (!patch) return;
    this.select(undefined);
    this.make(`Remove ${nodeName(this.document.gltf, node)}`, patch);
  }

  private onChanged(pointers: string[]): void {
    this.app.viewer.applyDocument(this.document.gltf, pointers);
    if (pointers.length === 0) {
      const { gltf } = this.document;
      // The document may come after the picture: what was clicked meanwhile stays selected. Numbers of another scene, which
      // a server has that comes back, mean other objects.
      const isKept = this.known?.nodes === undefined || isSameScene(this.known, gltf);
      this.known = gltf;
      this.select(isKept && this.selection && gltf.nodes?.[this.selection.node] ? this.selection : undefined);
      this.panel.setDocument(this.document.gltf, (node) => this.materialsOf(node));
    } else {
      const hangs = hangingNodes(this.document.gltf).some(({ node }) => node === this.selection?.node);
      if (this.selection && !hangs) this.select(undefined); // somebody has removed it
      this.offerHandles(); // a lamp may be of another kind now
      this.panel.refresh();
    }
  }

  private onHistory(): void {
    this.history?.show();
    if (this.document.lastEdit) this.app.share?.onEdit(this.document.lastEdit);
  }
}

/** Of a placement, what handles of a mode write: turning and scaling go about the object's middle, and move its origin. */
function written(mode: GizmoMode, { translation, rotation, scale }: edits.Placement): edits.Placement {
  return {
    translation: translation ?? [0, 0, 0],
    ...(mode === 'rotate' ? { rotation: rotation ?? [0, 0, 0, 1] } : {}),
    ...(mode === 'scale' ? { scale: scale ?? [1, 1, 1] } : {}),
  };
}

/** Rounded, and still of unit length to the last digit that counts. */
function unit(q: Vec4): Vec4 {
  const length = Math.hypot(...q) || 1;
  return q.map((v) => Number((v / length).toPrecision(9))) as Vec4;
}
