// Selecting and changing objects: the scene's document, its panel, and the gizmo.

import type { Object3D } from 'three';
import * as edits from '../document/edits';
import { type Gltf, hangingNodes, isSameScene, nodeName, type Vec3 } from '../document/gltf';
import { handlesOf, lookOf, webOf, type LampWebs } from '../document/lights';
import { addLamp, MOST_PROFILE_BYTES, profileName, profileType, type NewLamp } from '../document/new_lamps';
import { addPlane, planeOf } from '../document/planes';
import { setSkyPicture, setSkyTurn } from '../document/skies';
import { SceneDocument, type SendEdit } from '../document/scene_document';
import type { Patch, ScenePatchedNote } from '../protocol/messages';
import { type PageName, shownName } from '../protocol/page_name';
import { RpcError } from '../protocol/rpc';
import type { Frame } from '../ui/frame';
import type { PlainLamp } from '../ui/lamp_section';
import { ScenePanel, type Selection } from '../ui/scene_panel';
import type { GizmoMode } from '../view/controls/gizmo';
import type { Viewer } from '../view/viewer';
import { lampAhead, lampLike, placementOf, planeOver, written } from './placement';

const HANDLES: readonly GizmoMode[] = ['translate', 'rotate', 'scale'];
const GIZMO_LABELS = { translate: 'Move', rotate: 'Rotate', scale: 'Scale' } as const;

export interface EditHost {
  name: Pick<PageName, 'isMine'>;
  picture: Pick<
    Viewer,
    'shown' | 'gizmo' | 'rig' | 'exposure' | 'applyDocument' | 'select' | 'showWebs' | 'invalidate' | 'boxOf'
  >;
  frame: Pick<Frame, 'toasts' | 'setGizmo' | 'showTab' | 'panelOpen'>;
  send: SendEdit;
  /** The steps of undo are others, or `document.lastEdit` is another. */
  historyChanged(): void;
  frameSelection(): void;
  loadFile(file: File): void;
  /** Keeps a file on the server and returns its URL there; rejects with the reason that the server gives. */
  upload(file: File): Promise<string>;
  /** The document has come, or changed. */
  /** `isWhole`: it has come from the server, maybe as another one. */
  documentChanged(gltf: Gltf, isWhole: boolean): void;
  notAccepted(text: string, wanted: string): void;
  /** The web of EXT_lights_ies that the selected lamp shines by; undefined: nothing like that is selected. */
  webWanted(gltf: Gltf, light: number | undefined): void;
}

export class EditSession {
  readonly panel: ScenePanel;
  readonly document: SceneDocument;
  selection: Selection | undefined;
  /** The handles that the user has chosen. */
  private wanted: GizmoMode = 'translate';
  /** The document as it came last. */
  private known: Gltf | undefined;
  /** The object that is being dragged, and where it was before. */
  private dragged: { node: number; before: edits.Placement } | undefined;

  constructor(private readonly host: EditHost) {
    this.document = new SceneDocument((by) => host.name.isMine(by), host.send, {
      changed: (pointers) => this.onChanged(pointers),
      refused: (label, reason) => host.frame.toasts.show(`${label}: ${reason}`, 'bad'),
      historyChanged: () => host.historyChanged(),
    });
    this.panel = this.makePanel();
  }

  private makePanel(): ScenePanel {
    const { host } = this;
    return new ScenePanel({
      select: (selection) => this.select(selection),
      setColour: (material, rgb) =>
        this.make('Colour', edits.setColour(material, this.document.gltf, rgb), `colour ${material}`),
      setEmission: (material, rgb, strength) =>
        this.make('Emission', edits.setEmission(material, rgb, strength), `emission ${material}`),
      setLight: (path, value) => this.make('Light', edits.setLight(this.document.gltf, path, value), `light ${path}`),
      setPlacement: (node, placement) => this.make('Placement', edits.setPlacement(node, placement)),
      setVisible: (node, visible) =>
        this.make(visible ? 'Show' : 'Hide', edits.setVisible(this.document.gltf, node, visible)),
      remove: (node) => this.remove(node),
      addLamp: (type) => void this.addLamp(type),
      addProfile: (file) => void this.addProfile(file),
      frameSelection: () => host.frameSelection(),
      endGesture: () => this.document.endGesture(),
      loadFile: (file) => host.loadFile(file),
      setSky: (member, value) => this.make('Sky', setSkyTurn(member, value), `sky ${member}`),
      openSky: (file) => void this.openSky(file),
      notAccepted: (text, wanted) => host.notAccepted(text, wanted),
    });
  }

  start(): void {
    this.panel.setSelection(undefined);
  }

  onPatched(note: ScenePatchedNote, fetchAnew: () => void): void {
    if (!this.document.patched(note.revision, note.patch, note.by)) fetchAnew();
    if (!this.host.name.isMine(note.by))
      this.host.frame.toasts.showOnce(
        `${shownName(note.by) || 'Someone'} ${edits.describePatch(this.document.gltf, note.patch)}`,
      );
  }

  /** The picture has new objects. The one that was selected may be among them. */
  onSceneShown(): void {
    this.host.picture.applyDocument(this.document.gltf, []);
    this.panel.setDocument(this.document.gltf, (node) => this.materialsOf(node));
    this.host.picture.select(this.selection?.node);
  }

  // ---- selection ----

  select(selection: Selection | undefined): void {
    this.selection = selection;
    this.host.picture.select(this.isPictureOld ? undefined : selection?.node);
    this.offerHandles();
    this.panel.setSelection(selection);
    this.wantWeb();
    if (selection && this.host.frame.panelOpen)
      this.host.frame.showTab(planeOf(this.document.gltf, selection.node) ? 'Measure' : 'Scene');
  }

  /** The photometric webs that are known: the selected lamp's flux is known with its own. */
  showWebs(webs: LampWebs): void {
    this.host.picture.showWebs(webs);
    this.panel.setWebs(webs);
  }

  private wantWeb(): void {
    this.host.webWanted(this.document.gltf, webOf(this.document.gltf, this.selection?.node));
  }

  /** The document is of another scene than the picture, so the numbers of nodes mean different objects in the two. */
  private get isPictureOld(): boolean {
    const { shown } = this.host.picture;
    return shown !== undefined && this.known?.nodes !== undefined && !isSameScene(shown.source, this.known);
  }

  selectHit(object: Object3D | undefined): void {
    const scene = this.host.picture.shown;
    const node = object && !this.isPictureOld ? scene?.nodeOf(object) : undefined;
    this.select(node === undefined ? undefined : { node, material: object && scene?.materialIndexOf(object) });
  }

  /** For users without a pointer. */
  selectNext(step: number): void {
    const { gltf } = this.document;
    const nodes = hangingNodes(gltf)
      .map(({ node }) => node)
      .filter((node) => gltf.nodes?.[node]?.mesh !== undefined || lookOf(gltf, node));
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

  make(label: string, patch: Patch, key?: string): void {
    this.document.edit(label, patch, key).catch(() => undefined); // the refusal was shown
  }

  setGizmo(mode: GizmoMode): void {
    const { picture } = this.host;
    if (picture.gizmo.dragging) return; // the user has to let go of one kind of handle before taking another
    this.wanted = mode;
    this.offerHandles();
    picture.invalidate();
  }

  /** Offers the handles that change something about the selected object, and takes the user's choice if it is one. */
  private offerHandles(): void {
    const { gizmo } = this.host.picture;
    const node = this.selection?.node;
    const offered = node === undefined ? HANDLES : handlesOf(this.document.gltf, node);
    const mode = offered.includes(this.wanted) ? this.wanted : offered[0]!;
    if (mode !== gizmo.mode && !gizmo.dragging) gizmo.setMode(mode);
    this.host.frame.setGizmo(mode, offered);
  }

  onGizmoDragging(active: boolean): void {
    const node = active ? this.selection?.node : undefined;
    const { translation, rotation, scale } = (node === undefined ? undefined : this.document.gltf.nodes?.[node]) ?? {};
    this.dragged = node === undefined ? undefined : { node, before: { translation, rotation, scale } };
    if (!active) this.document.endGesture();
  }

  /** Puts the dragged object back to where it was, here and on the server. False: no object is being dragged. */
  cancelDrag(): boolean {
    const { gizmo } = this.host.picture;
    if (!gizmo.cancel()) return false;
    if (!this.dragged) return true;
    const { node, before } = this.dragged;
    const patch = edits.setPlacement(node, written(gizmo.mode, before));
    const { label, key } = this.dragOf(node, gizmo.mode);
    this.document.cancelGesture(label, key, patch).catch(() => undefined); // the refusal was shown
    return true;
  }

  onGizmoChanged(object: Object3D, mode: GizmoMode): void {
    const node = this.selection?.node;
    if (node === undefined) return;
    const { label, key } = this.dragOf(node, mode);
    this.make(label, edits.setPlacement(node, written(mode, placementOf(object))), key);
  }

  private dragOf(node: number, mode: GizmoMode): { label: string; key: string } {
    return { label: `${GIZMO_LABELS[mode]} ${nodeName(this.document.gltf, node)}`, key: `${mode} ${node}` };
  }

  async addLamp(type: PlainLamp = 'point'): Promise<void> {
    const ahead = this.ahead();
    if (ahead) await this.add(ahead.place, lampLike(type, ahead.candela, ahead.reach));
  }

  /** A lamp that shines by a photometric file. */
  async addProfile(file: File): Promise<void> {
    const { toasts } = this.host.frame;
    if (file.size > MOST_PROFILE_BYTES || file.size === 0)
      return toasts.show(`${file.name}: a photometric file has 1 byte to 16 MiB`, 'bad');
    try {
      const uri = await this.host.upload(file);
      const ahead = this.ahead();
      const profile = { uri, bytes: file.size, mimeType: profileType(file.name) };
      if (ahead) await this.add(ahead.place, { type: 'ies', name: profileName(file.name), file: profile });
    } catch (error) {
      toasts.show(`${file.name}: ${(error as Error).message}`, 'bad');
    }
  }

  /** Where a new lamp goes, and how bright it is to be; undefined: there is no picture. */
  private ahead(): ReturnType<typeof lampAhead> | undefined {
    const { rig, exposure, shown } = this.host.picture;
    return shown && lampAhead(rig.camera, rig.target, shown.bounds, exposure.ofLeaving);
  }

  private async add(place: Vec3, lamp: NewLamp): Promise<void> {
    const { patch, node } = addLamp(this.document.gltf, place, lamp);
    try {
      await this.document.edit('Add lamp', patch);
      this.select({ node, material: undefined });
    } catch {
      // The refusal was shown.
    }
  }

  /** A measuring plane over the selected object, or in all of the scene. */
  async addPlane(): Promise<void> {
    const { picture } = this.host;
    if (!picture.shown) return;
    const { bounds } = picture.shown;
    const { place, plane } = planeOver((this.selection && picture.boxOf(this.selection.node)) ?? bounds, bounds);
    const { patch, node } = addPlane(this.document.gltf, place, plane);
    try {
      await this.document.edit('Add measuring plane', patch);
      this.select({ node, material: undefined });
    } catch {
      // The refusal was shown.
    }
  }

  /** Gives the scene another picture as its sky. */
  async openSky(file: File): Promise<void> {
    try {
      const uri = await this.host.upload(file);
      await this.document.edit('Sky', setSkyPicture(this.document.gltf, uri, file.size));
    } catch (error) {
      // A refusal of the edit was shown.
      if (!(error instanceof RpcError)) this.host.frame.toasts.show(`${file.name}: ${(error as Error).message}`, 'bad');
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
    const { gltf } = this.document;
    this.host.picture.applyDocument(gltf, pointers);
    this.host.documentChanged(gltf, pointers.length === 0);
    if (pointers.length === 0) {
      // The document may come after the picture: an object that was clicked meanwhile stays selected, unless the server
      // has come back with another scene, in which its number means another object.
      const isKept = this.known?.nodes === undefined || isSameScene(this.known, gltf);
      this.known = gltf;
      this.select(isKept && this.selection && gltf.nodes?.[this.selection.node] ? this.selection : undefined);
      this.panel.setDocument(gltf, (node) => this.materialsOf(node));
    } else {
      const hangs = hangingNodes(gltf).some(({ node }) => node === this.selection?.node);
      if (this.selection && !hangs) this.select(undefined); // somebody has removed the object
      this.offerHandles(); // the edit may have changed the kind of a lamp
      this.wantWeb();
      this.panel.refresh();
    }
  }
}
