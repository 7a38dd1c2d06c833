// Links, commands and files to take away. Part of the App.

import type { App } from '../app/app';
import { fetchLightmaps, fetchLitScene, type Layouts } from '../document/one_layout';
import type { Patch, ServerInfo } from '../protocol/messages';
import { copyText, download } from '../page/dom';
import type { SharePanel } from '../ui/share_panel';

export type Download = 'glb' | 'unlit' | 'exr' | 'png' | 'snapshot';

/** One operation a line: to be read, and to be edited. */
export function formatPatch(patch: Patch): string {
  return `[\n${patch.map((operation) => `  ${JSON.stringify(operation)}`).join(',\n')}\n]`;
}

/** What makes the same edit from a shell, of which some take what echo is given apart at its backslashes. `token`: the server wants one, which stays out of what is copied. */
export function editCommand(patch: Patch, server: string, token = false): string {
  const json = JSON.stringify(patch).replaceAll("'", `'\\''`);
  return `printf %s '${json}' | radiosity edit ${server} -${token ? ' --token-file token' : ''}`;
}

/** Of files that a page saves faster, browsers keep ten and drop the rest without a word. */
const SAVE_EVERY_MS = 250;

function pause(ms: number): Promise<void> {
  return new Promise((resolve) => setTimeout(resolve, ms));
}

export class Share {
  private lastEdit: Patch | undefined;
  private readonly layouts: Layouts = {
    now: () => this.app.viewer.set?.note,
    fetch: (path, init) => this.app.fetch(path, init),
    pause: () => pause(100),
  };

  constructor(
    private readonly app: App,
    private readonly panel: SharePanel,
  ) {}

  onEdit(patch: Patch): void {
    this.lastEdit = patch;
    this.panel.setEdit(formatPatch(patch));
  }

  onServer(info: ServerInfo): void {
    this.panel.setAbout([
      ['Program', info.server],
      ['Renderer', info.glRenderer],
      ['Address', location.host],
    ]);
  }

  async copyLink(): Promise<void> {
    const link = `${location.origin}/#${this.app.view.linkHash()}`;
    history.replaceState(null, '', link);
    await this.copy(link, 'Link copied');
  }

  async copyEdit(form: 'command' | 'json'): Promise<void> {
    if (!this.lastEdit) return;
    const server = location.protocol === 'https:' ? location.origin : location.host;
    const command = editCommand(this.lastEdit, server, this.app.connection.info?.authRequired);
    const text = form === 'json' ? formatPatch(this.lastEdit) : command;
    await this.copy(text, form === 'json' ? 'JSON copied' : 'Command copied');
  }

  async download(what: Download): Promise<void> {
    try {
      if (what === 'png') return download(await this.app.viewer.picture(), 'view.png');
      if (what === 'glb') return download(await fetchLitScene(this.layouts), 'scene-lit.glb');
      if (what === 'unlit') return await this.save('/scene-unlit.glb', 'scene-unlit.glb');
      if (what === 'snapshot') return await this.save('/snapshot.png?width=1920&height=1080', 'snapshot.png');
      const pages = await fetchLightmaps(this.layouts);
      for (const [page, blob] of pages.entries()) {
        if (page > 0) await pause(SAVE_EVERY_MS);
        download(blob, `lightmap.${page}.exr`);
      }
    } catch (error) {
      this.app.frame.toasts.show(`Download failed: ${(error as Error).message}`, 'bad');
    }
  }

  private async save(path: string, name: string): Promise<void> {
    download(await (await this.app.fetch(path)).blob(), name);
  }

  private async copy(text: string, done: string): Promise<void> {
    const copied = await copyText(text);
    this.app.frame.toasts.show(copied ? done : 'The browser blocked copying', copied ? 'good' : 'bad');
  }
}
