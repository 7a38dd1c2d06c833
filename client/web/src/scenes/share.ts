// Links, commands and files to take away.

import { fetchLightmaps, fetchLitScene, type Layouts } from '../document/one_layout';
import { copyText, download } from '../page/dom';
import { pause } from '../page/pause';
import type { LightmapsNote, Patch, ServerInfo } from '../protocol/messages';
import { SharePanel, type Download, type PeopleActions } from '../ui/share_panel';
import type { Notes } from '../ui/toast';

/** One operation a line, to be read and to be edited. */
export function formatPatch(patch: Patch): string {
  return `[\n${patch.map((operation) => `  ${JSON.stringify(operation)}`).join(',\n')}\n]`;
}

/**
 * A shell command that makes the same edit. It uses printf because the echo of some shells interprets backslashes.
 * `token`: the server requires a token, which the command reads from a file and does not contain.
 */
export function editCommand(patch: Patch, server: string, token = false): string {
  const json = JSON.stringify(patch).replaceAll("'", `'\\''`);
  return `printf %s '${json}' | radiosity edit ${server} -${token ? ' --token-file token' : ''}`;
}

/** Browsers keep ten of the files that a page saves faster than this, and drop the others without a word. */
const SAVE_EVERY_MS = 250;
/** Time for a message of the server to arrive. */
const MESSAGE_MS = 100;

export interface ShareHost {
  fetch(path: string, init?: RequestInit): Promise<Response>;
  /** The newest layout; undefined: none. */
  layout(): LightmapsNote | undefined;
  /** PNG of the picture. */
  picture(): Promise<Blob>;
  /** The hash of a link to the present view. */
  linkHash(): string;
  notes: Pick<Notes, 'show'>;
}

export class Share {
  readonly panel: SharePanel;
  private lastEdit: Patch | undefined;
  private tokenRequired = false;
  private readonly layouts: Layouts;

  constructor(
    private readonly host: ShareHost,
    people: PeopleActions,
  ) {
    this.layouts = { now: () => host.layout(), fetch: host.fetch, pause: () => pause(MESSAGE_MS) };
    this.panel = new SharePanel({
      ...people,
      copyLink: () => void this.copyLink(),
      copyEdit: (form) => void this.copyEdit(form),
      download: (what) => void this.download(what),
    });
  }

  onEdit(patch: Patch): void {
    this.lastEdit = patch;
    this.panel.setEdit(formatPatch(patch));
  }

  onServer(info: ServerInfo): void {
    this.tokenRequired = info.authRequired;
    this.panel.setAbout([
      ['Program', info.server],
      ['Renderer', info.glRenderer],
      ['Address', location.host],
    ]);
  }

  private async copyLink(): Promise<void> {
    const link = `${location.origin}/#${this.host.linkHash()}`;
    history.replaceState(null, '', link);
    await this.copy(link, 'Link copied');
  }

  private async copyEdit(form: 'command' | 'json'): Promise<void> {
    if (!this.lastEdit) return;
    const server = location.protocol === 'https:' ? location.origin : location.host;
    if (form === 'json') await this.copy(formatPatch(this.lastEdit), 'JSON copied');
    else await this.copy(editCommand(this.lastEdit, server, this.tokenRequired), 'Command copied');
  }

  async download(what: Download): Promise<void> {
    try {
      if (what === 'png') return download(await this.host.picture(), 'view.png');
      if (what === 'glb') return download(await fetchLitScene(this.layouts), 'scene-lit.glb');
      if (what === 'unlit') return await this.save('/scene-unlit.glb', 'scene-unlit.glb');
      if (what === 'snapshot') return await this.save('/snapshot.png?width=1920&height=1080', 'snapshot.png');
      const pages = await fetchLightmaps(this.layouts);
      for (const [page, blob] of pages.entries()) {
        if (page > 0) await pause(SAVE_EVERY_MS);
        download(blob, `lightmap.${page}.exr`);
      }
    } catch (error) {
      this.host.notes.show(`Download failed: ${(error as Error).message}`, 'bad');
    }
  }

  private async save(path: string, name: string): Promise<void> {
    download(await (await this.host.fetch(path)).blob(), name);
  }

  private async copy(text: string, done: string): Promise<void> {
    const copied = await copyText(text);
    this.host.notes.show(copied ? done : 'The browser blocked copying', copied ? 'good' : 'bad');
  }
}
