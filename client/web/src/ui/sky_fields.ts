// The sky in the panel "Scene": how a picture or daylight is turned, how strong it is, and another picture.

import type { Gltf } from '../document/gltf';
import { skyTurn, type SkyTurn } from '../document/skies';
import { button, buttons, field, h, section } from '../page/dom';
import { parseNumber } from '../page/numbers';

export interface SkyActions {
  setSky(member: keyof SkyTurn, value: number): void;
  openSky(file: File): void;
  endGesture(): void;
  notAccepted(text: string, wanted: string): void;
}

const LABELS = { rotation: 'Turn (°)', strength: 'Strength' } as const;
const WANTED = { rotation: 'a number of degrees', strength: 'a number from 0 to 1e9' } as const;
const isGood = {
  rotation: (value: number) => Math.abs(value) <= 1e4,
  strength: (value: number) => value >= 0 && value <= 1e9,
};

export class SkyFields {
  readonly element: HTMLElement;
  private readonly inputs = { rotation: this.input('rotation'), strength: this.input('strength') };
  private readonly rows: HTMLElement[];

  constructor(private readonly actions: SkyActions) {
    const file = h('input', { type: 'file', accept: '.hdr,.exr', class: 'offscreen', tabIndex: -1 });
    file.onchange = () => {
      const chosen = file.files?.[0];
      if (chosen) actions.openSky(chosen);
      file.value = '';
    };
    this.rows = [field(LABELS.rotation, this.inputs.rotation), field(LABELS.strength, this.inputs.strength)];
    this.element = section(
      'Sky',
      ...this.rows,
      buttons(
        button('Open sky…', () => file.click(), { title: 'A picture all around: .hdr or .exr' }),
        file,
      ),
    );
  }

  private input(member: keyof SkyTurn): HTMLInputElement {
    const input = h('input', { type: 'text', inputMode: 'decimal' });
    input.addEventListener('change', () => {
      const value = parseNumber(input.value);
      if (!isGood[member](value)) this.actions.notAccepted(input.value, WANTED[member]);
      else this.actions.setSky(member, value);
      this.actions.endGesture();
    });
    return input;
  }

  /** A value that the user is typing stays as it is. */
  show(gltf: Gltf): void {
    const turn = skyTurn(gltf);
    for (const row of this.rows) row.hidden = turn === undefined;
    if (!turn) return;
    for (const member of ['rotation', 'strength'] as const)
      if (document.activeElement !== this.inputs[member]) this.inputs[member].value = String(turn[member]);
  }
}
