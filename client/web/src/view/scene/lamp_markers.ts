// The signs of all lights of a shown scene that are no surfaces.

import { Object3D } from 'three';
import { isVisible } from '../../document/edits';
import { parentsOf, type Gltf, type GltfNode } from '../../document/gltf';
import { lookOf, webOf, type LampWeb, type LampWebs } from '../../document/lights';
import { LampMarker } from './lamp_marker';
import { outlineOf, webLines, type Lines } from './lamp_outline';

/** Parts of the scene's diagonal: the ball of a sign, a spot's cone, and a web where it shines most. */
const BALL = 0.012;
const CONE = 0.15;
const WEB = 0.15;
const MOST_DEPTH = 64;

export class LampMarkers {
  private readonly markers = new Map<number, LampMarker>();
  /** Objects of lamps that the geometry does not contain yet. */
  private readonly anchors = new Map<number, Object3D>();
  private readonly drawn = new WeakMap<LampWeb, { reach: number; lines: Lines | undefined }>();
  private selected: number | undefined;
  private webs: LampWebs = new Map();

  /**
   * `nodes`: the objects that there are; `root` holds lamps that the geometry does not contain yet. `diagonal`: of the
   * scene, metres.
   */
  place(gltf: Gltf, nodes: ReadonlyMap<number, Object3D>, root: Object3D, diagonal: number): void {
    const hanging = new Set(hangingLights(gltf));
    for (const [node, marker] of this.markers) {
      if (hanging.has(node)) continue;
      marker.destroy();
      this.markers.delete(node);
    }
    for (const [node, anchor] of this.anchors) {
      if (hanging.has(node) && !nodes.has(node)) continue;
      anchor.removeFromParent();
      this.anchors.delete(node);
    }
    const parents = parentsOf(gltf);
    for (const node of hanging) {
      const parent = nodes.get(node) ?? this.anchor(node, root, gltf.nodes?.[node] ?? {});
      let marker = this.markers.get(node);
      if (!marker) this.markers.set(node, (marker = new LampMarker(node)));
      if (marker.parent !== parent) parent.add(marker);
      const selected = node === this.selected;
      const web = selected ? this.webs.get(webOf(gltf, node) ?? -1) : undefined;
      const outline = outlineOf(gltf, node, CONE * diagonal, parents);
      const look = { light: lookOf(gltf, node)!, outline, web: web && this.linesOf(web, WEB * diagonal), selected };
      marker.display(look, BALL * diagonal);
    }
  }

  /** The next place() shows it. */
  select(node: number | undefined, webs: LampWebs): void {
    this.selected = node;
    this.webs = webs;
  }

  has(node: number): boolean {
    return this.markers.has(node);
  }

  /** The object of a lamp that the geometry does not contain yet: placed, turned and scaled as its node. */
  anchorOf(node: number): Object3D | undefined {
    return this.anchors.get(node);
  }

  values(): Iterable<LampMarker> {
    return this.markers.values();
  }

  setVisible(visible: boolean): void {
    for (const marker of this.markers.values()) marker.visible = visible;
  }

  dispose(): void {
    for (const marker of this.markers.values()) marker.destroy();
    this.markers.clear();
    for (const anchor of this.anchors.values()) anchor.removeFromParent();
    this.anchors.clear();
  }

  private anchor(node: number, root: Object3D, { translation, rotation, scale }: GltfNode): Object3D {
    let anchor = this.anchors.get(node);
    if (!anchor) {
      this.anchors.set(node, (anchor = new Object3D()));
      root.add(anchor);
    }
    anchor.position.set(...(translation ?? [0, 0, 0]));
    anchor.quaternion.set(...(rotation ?? [0, 0, 0, 1]));
    anchor.scale.set(...(scale ?? [1, 1, 1]));
    anchor.updateMatrixWorld(true);
    return anchor;
  }

  private linesOf(web: LampWeb, reach: number): Lines | undefined {
    let known = this.drawn.get(web);
    if (known?.reach !== reach) this.drawn.set(web, (known = { reach, lines: webLines(web, reach) }));
    return known.lines;
  }
}

function hangingLights(gltf: Gltf): number[] {
  const out: number[] = [];
  const visit = (node: number, depth: number) => {
    if (depth > MOST_DEPTH || !isVisible(gltf, node)) return;
    if (lookOf(gltf, node)) out.push(node);
    for (const child of gltf.nodes?.[node]?.children ?? []) visit(child, depth + 1);
  };
  for (const root of gltf.scenes?.[gltf.scene ?? 0]?.nodes ?? []) visit(root, 0);
  return out;
}
