// The panel "Share": a link to the view, the last edit as a command, and files to download.

import { LONGEST_NAME } from '../protocol/page_name';
import { button, buttons, panel, checkbox, field, h, section } from '../page/dom';

export type Download = 'glb' | 'unlit' | 'exr' | 'png' | 'snapshot';

export interface PeopleActions {
  /** What the user is called, and how others see the page of a user who has not said so. */
  name: { person: string; unnamed: string };
  setName(person: string): void;
  /** Whether the user shares the camera when the page opens. */
  sharing: boolean;
  setSharing(on: boolean): void;
}

export interface SharePanelActions extends PeopleActions {
  copyLink(): void;
  copyEdit(form: 'command' | 'json'): void;
  download(what: Download): void;
}

export class SharePanel {
  readonly element: HTMLElement;
  private readonly edit = h('pre', { class: 'code', tabIndex: 0 }, 'No edits yet.');
  private readonly about = h('dl', { class: 'facts' });
  private readonly copies: HTMLButtonElement[];

  constructor(actions: SharePanelActions) {
    this.copies = [
      button('Copy as command', () => actions.copyEdit('command'), { disabled: true }),
      button('Copy JSON', () => actions.copyEdit('json'), { disabled: true }),
    ];
    this.element = panel(
      section(
        'This view',
        buttons(
          button('Copy link', () => actions.copyLink()),
          button('Save picture', () => actions.download('png')),
        ),
      ),
      section(
        'People',
        field('Your name', this.nameField(actions)),
        field(
          'Share cameras',
          checkbox(actions.sharing, (on) => actions.setSharing(on)),
        ),
        h('p', { class: 'dim' }, 'Viewers who share their cameras see where the others look from.'),
      ),
      section('Last edit', this.edit, buttons(...this.copies)),
      section(
        'Download',
        buttons(
          button('Lit scene (.glb)', () => actions.download('glb'), { title: 'With lightmap coordinates' }),
          button('Baked scene (.glb)', () => actions.download('unlit'), { title: 'For any glTF viewer' }),
          button('Lightmaps (.exr)', () => actions.download('exr'), { title: 'Irradiance in lux, 32-bit float' }),
          button('Server snapshot (.png)', () => actions.download('snapshot')),
        ),
      ),
      section('Server', this.about),
    );
  }

  private nameField({ name, setName }: SharePanelActions): HTMLElement {
    const title = `Others see it with your edits; without a name they see “${name.unnamed}”`;
    const input = h('input', {
      type: 'text',
      value: name.person,
      title,
      maxLength: LONGEST_NAME,
      autocomplete: 'name',
    });
    input.onchange = () => setName(input.value);
    return input;
  }

  setEdit(json: string): void {
    this.edit.textContent = json;
    for (const copy of this.copies) copy.disabled = false;
  }

  setAbout(facts: [string, string][]): void {
    this.about.replaceChildren(...facts.flatMap(([name, value]) => [h('dt', {}, name), h('dd', {}, value)]));
  }
}
