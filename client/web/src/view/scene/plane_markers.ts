// The signs of all measuring planes of a shown scene, with what was measured last. What was measured before a plane was
// moved or changed is not shown.

import type { Object3D } from 'three';
import { isVisible } from '../../document/edits';
import type { Gltf } from '../../document/gltf';
import { planeKey, planeNodes, planeOf } from '../../document/planes';
import type { MeasuredPlane } from '../../protocol/messages';
import { PlaneMarker } from './plane_marker';

interface Shown {
  plane: MeasuredPlane;
  key: string;
}

export class PlaneMarkers {
  private readonly markers = new Map<number, PlaneMarker>();
  private readonly measured = new Map<number, Shown>();
  private visible = true;

  /** `nodes`: the objects that there are; `root` holds those of planes that the geometry does not contain yet. */
  place(gltf: Gltf, nodes: ReadonlyMap<number, Object3D>, root: Object3D): void {
    const there = new Set(planeNodes(gltf).filter((node) => isVisible(gltf, node)));
    for (const [node, marker] of this.markers) {
      if (there.has(node)) continue;
      marker.destroy();
      this.markers.delete(node);
    }
    for (const node of there) {
      const parent = nodes.get(node) ?? root;
      let marker = this.markers.get(node);
      if (!marker) this.markers.set(node, (marker = new PlaneMarker(node)));
      marker.visible = this.visible;
      if (marker.parent !== parent) parent.add(marker);
      if (parent === root) {
        const { translation = [0, 0, 0], rotation = [0, 0, 0, 1], scale = [1, 1, 1] } = gltf.nodes?.[node] ?? {};
        marker.position.set(...translation);
        marker.quaternion.set(...rotation);
        marker.scale.set(...scale);
      }
      const shown = this.measured.get(node);
      marker.display(planeOf(gltf, node)!, shown?.key === planeKey(gltf, node) ? shown.plane : undefined);
    }
  }

  /** `gltf`: the document that the planes were measured in. place() shows them. */
  take(planes: readonly MeasuredPlane[], gltf: Gltf): void {
    this.measured.clear();
    for (const plane of planes) this.measured.set(plane.node, { plane, key: planeKey(gltf, plane.node) });
  }

  get(node: number): PlaneMarker | undefined {
    return this.markers.get(node);
  }

  setVisible(visible: boolean): void {
    this.visible = visible;
    for (const marker of this.markers.values()) marker.visible = visible;
  }

  dispose(): void {
    for (const marker of this.markers.values()) marker.destroy();
    this.markers.clear();
  }
}
