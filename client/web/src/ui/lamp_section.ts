// Lamps in the panel "Scene": buttons that add them, and an editor of the selected one.

import type { LightField, LightType, NodeLight } from '../document/lights';
import { button, buttons, field, h, section } from '../page/dom';
import { parseNumber } from '../page/numbers';
import type { Json } from '../protocol/messages';

/** Kinds of lamps that need no file. */
export type PlainLamp = 'point' | 'spot' | 'rect' | 'disk';

export interface LampActions {
  addLamp(type: PlainLamp): void;
  /** .ies or .ldt */
  addProfile(file: File): void;
  setLight(path: string, value: Json): void;
}

/** Names for people of lights that the format has another one for. */
const LIGHT_NAMES: Partial<Record<LightType, string>> = { rect: 'rectangle', disk: 'disc', ies: 'IES' };

/** Digits of numbers that are shown, and of numbers that are stored of those in another unit. */
const SHOWN = 5;
const STORED = 7;

export function addLampButtons(actions: LampActions): HTMLElement {
  const file = h('input', { type: 'file', accept: '.ies,.ldt', class: 'offscreen', tabIndex: -1, 'aria-label': 'IES' });
  file.onchange = () => {
    const chosen = file.files?.[0];
    if (chosen) actions.addProfile(chosen);
    file.value = '';
  };
  return buttons(
    button('Add lamp', () => actions.addLamp('point'), { title: 'Add a point light in front of the camera (L)' }),
    button('Spot', () => actions.addLamp('spot'), { title: 'Add a spot light that shines down' }),
    button('Rectangle', () => actions.addLamp('rect'), { title: 'Add a rectangular area light that shines down' }),
    button('Disc', () => actions.addLamp('disk'), { title: 'Add a round area light that shines down' }),
    button('IES…', () => file.click(), { title: 'Add a lamp with a photometric file: .ies or .ldt (EULUMDAT)' }),
    file,
  );
}

/** The document's number for what was written into a field; undefined: the field does not accept it. */
export function storedValue({ per = 1, least = 0, most = Infinity }: LightField, text: string): number | undefined {
  const value = parseNumber(text);
  if (!(value >= least && value <= most)) return undefined;
  return per === 1 ? value : Number((value / per).toPrecision(STORED));
}

export function shownValue({ value }: LightField): string {
  return String(Number(value.toPrecision(SHOWN)));
}

function rangeOf({ least = 0, most }: LightField): string {
  return most === undefined ? `a number, ${least} or more` : `a number from ${least} to ${most}`;
}

/** `colour`: the control of the light's colour; `refuse`: tells what is wanted, and restores the field. */
export function lightEditor(
  light: NodeLight,
  colour: HTMLElement,
  actions: LampActions,
  refuse: (input: HTMLInputElement, wanted: string) => void,
): HTMLElement {
  const rows = light.fields.map((of) => {
    const input: HTMLInputElement = h('input', {
      type: 'text',
      inputMode: 'decimal',
      class: 'number',
      value: shownValue(of),
      onchange: () => {
        const wanted = storedValue(of, input.value);
        if (wanted !== undefined) actions.setLight(of.path, of.written?.(wanted) ?? wanted);
        else refuse(input, rangeOf(of));
      },
    });
    return field(of.label, input);
  });
  return section(`Light: ${LIGHT_NAMES[light.type] ?? light.type}`, field('Colour', colour), ...rows);
}
