// Measuring planes: asks the server to measure, and hands what it finds to the picture and the panel.

import type { Gltf } from '../document/gltf';
import { nodeName } from '../document/gltf';
import { planeNodes, planeOf, setPlane, withTarget, type PlaneSpec } from '../document/planes';
import { download } from '../page/dom';
import type { Patch, Planes } from '../protocol/messages';
import { PlanesPanel } from '../ui/planes_panel';
import type { Notes } from '../ui/toast';

export interface PlanesHost {
  fetch(path: string, init?: RequestInit): Promise<Response>;
  document: { gltf: Gltf; revision: number };
  picture: { showPlanes(planes: Planes['planes']): void };
  notes: Notes;
  add(): void;
  select(node: number): void;
  edit(label: string, patch: Patch): void;
  notAccepted(text: string, wanted: string): void;
}

export class PlanesSession {
  readonly panel: PlanesPanel;
  private measured: Planes | undefined;
  private daylight = false;
  private busy = false;

  constructor(private readonly host: PlanesHost) {
    this.panel = new PlanesPanel({
      add: () => host.add(),
      measure: () => void this.measure(),
      setDaylight: (on) => (this.daylight = on),
      downloadCsv: () => void this.downloadCsv(),
      select: (node) => host.select(node),
      setSize: (node, member, metres) => this.change(node, (plane) => ({ ...plane, [member]: metres })),
      setTarget: (node, member, value) => this.change(node, (plane) => withTarget(plane, member, value)),
      notAccepted: (text, wanted) => {
        host.notAccepted(text, wanted);
        this.refresh();
      },
    });
  }

  /** The document has come, or changed. */
  refresh(): void {
    const { gltf, revision } = this.host.document;
    const planes = planeNodes(gltf).map((node) => ({
      node,
      name: nodeName(gltf, node),
      spec: planeOf(gltf, node)!,
    }));
    this.panel.show(planes, this.measured, revision, this.busy);
  }

  async measure(): Promise<void> {
    if (this.busy) return;
    this.busy = true;
    this.refresh();
    try {
      const response = await this.host.fetch(`/planes.json?daylightFactor=${this.daylight}`);
      this.measured = (await response.json()) as Planes;
      // Where an edit came meanwhile the planes may lie elsewhere now: the panel says so.
      if (this.measured.revision === this.host.document.revision) this.host.picture.showPlanes(this.measured.planes);
    } catch (error) {
      this.host.notes.show(`The planes were not measured: ${(error as Error).message}`, 'bad');
    }
    this.busy = false;
    this.refresh();
  }

  private async downloadCsv(): Promise<void> {
    try {
      const response = await this.host.fetch(`/planes.csv?daylightFactor=${this.daylight}`);
      download(await response.blob(), 'planes.csv');
    } catch (error) {
      this.host.notes.show(`The table was not made: ${(error as Error).message}`, 'bad');
    }
  }

  private change(node: number, make: (plane: PlaneSpec) => PlaneSpec): void {
    const plane = planeOf(this.host.document.gltf, node);
    if (plane) this.host.edit('Measuring plane', setPlane(node, make(plane)));
  }
}
