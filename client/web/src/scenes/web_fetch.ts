// Fetches the photometric webs of lamps that somebody looks at, each once, and seldom those that do not come.

import type { Gltf } from '../document/gltf';
import type { LampWeb, LampWebs } from '../document/lights';

export interface WebHost {
  fetch(path: string, init?: RequestInit): Promise<Response>;
  /** Another web is known, or fewer are. */
  changed(webs: LampWebs): void;
}

interface Known {
  key: string;
  web?: LampWeb;
  /** By the clock, milliseconds: it did not come. */
  failed?: number;
}

/** A drag asks at each of its steps; what was just refused would be refused again. */
const PAUSE_MS = 5000;

export class WebFetch {
  private readonly known = new Map<number, Known>();

  constructor(private readonly host: WebHost) {}

  get webs(): LampWebs {
    return new Map([...this.known].flatMap(([light, { web }]) => (web ? [[light, web] as const] : [])));
  }

  /**
   * `light`: index in EXT_lights_ies. Where the document names another file by it the web is fetched anew. One that did
   * not come is asked for again after a pause.
   */
  async want(gltf: Gltf, light: number | undefined): Promise<void> {
    const key = light === undefined ? undefined : keyOf(gltf, light);
    if (light === undefined || key === undefined) return;
    const before = this.known.get(light);
    if (before?.key === key && !(Date.now() - (before.failed ?? Infinity) >= PAUSE_MS)) return;
    const mine: Known = { key };
    this.known.set(light, mine);
    try {
      const web = (await (await this.host.fetch(`/webs/${light}.json`)).json()) as LampWeb;
      if (this.known.get(light) !== mine) return;
      mine.web = web;
      this.host.changed(this.webs);
    } catch {
      mine.failed = Date.now(); // the lamp is shown without its web
    }
  }

  /** The document has come as a whole: in another one the same words may mean another file. */
  forget(): void {
    if (this.known.size === 0) return;
    this.known.clear();
    this.host.changed(this.webs);
  }
}

function keyOf(gltf: Gltf, light: number): string | undefined {
  const entry = gltf.extensions?.EXT_lights_ies?.lights[light];
  const views = (gltf as { bufferViews?: unknown[] }).bufferViews;
  return entry && JSON.stringify([entry, views?.[entry.bufferView ?? -1]]);
}
