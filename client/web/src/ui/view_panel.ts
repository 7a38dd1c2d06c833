// The panel "View": what the picture shows, how brightly, and from where.

import { TONE_CURVES, VIEW_MODES, type ViewMode } from '../view/looks/view_modes';
import { button, checkbox, field, h, panel, pressed, section, select } from '../page/dom';
import { inField, parseNumber, readable } from '../page/numbers';

export const BACKGROUNDS = [
  { id: 'theme', label: 'Same as page' },
  { id: 'black', label: 'Black' },
  { id: 'grey', label: 'Grey' },
  { id: 'white', label: 'White' },
  { id: 'sky', label: 'Sky' },
] as const;

export interface ViewPanelActions {
  setMode(id: string): void;
  setFalseColour(on: boolean): void;
  setRange(range: [number, number] | undefined): void;
  setAutoExposure(on: boolean): void;
  setStops(stops: number): void;
  setToneCurve(id: string): void;
  setBackground(id: string): void;
  useCamera(index: number): void;
  /** `wanted`: the values that the field accepts. */
  notAccepted(text: string, wanted: string): void;
}

export class ViewPanel {
  readonly element: HTMLElement;
  private readonly modes = new Map<string, HTMLButtonElement>();
  private readonly falseBox: HTMLInputElement;
  private readonly stops: HTMLInputElement;
  private readonly stopsValue = h('output', { class: 'value' });
  private readonly auto: HTMLInputElement;
  private readonly tone = select(TONE_CURVES, TONE_CURVES[0].id, (id) => this.actions.setToneCurve(id));
  private readonly cameras = h('div', { class: 'list' });
  private readonly low = this.rangeInput('Lowest');
  private readonly high = this.rangeInput('Highest');
  private readonly autoRange: HTMLInputElement;
  private readonly rangeRow: HTMLElement;
  private readonly falseRow: HTMLElement;

  constructor(private readonly actions: ViewPanelActions) {
    const grid = h('div', { class: 'modes', role: 'group', 'aria-label': 'View' });
    VIEW_MODES.forEach((mode, i) => {
      const key = String((i + 1) % 10);
      const element = button(mode.label, () => actions.setMode(mode.id), { title: `${mode.hint} (${key})` });
      this.modes.set(mode.id, element);
      grid.append(element);
    });
    this.falseBox = checkbox(false, (on) => actions.setFalseColour(on));
    this.autoRange = checkbox(true, (on) => this.changeRange(on));
    this.auto = checkbox(true, (on) => actions.setAutoExposure(on));
    this.stops = h('input', { type: 'range', min: '-8', max: '8', step: '0.25', value: '0' });
    this.stops.oninput = () => actions.setStops(Number(this.stops.value));
    this.falseRow = field('False colour', this.falseBox);
    this.rangeRow = h('div', {}, field('Auto scale', this.autoRange), field('Scale', this.low, this.high));
    this.element = panel(
      section('Show', grid, this.falseRow, this.rangeRow),
      section(
        'Picture',
        field('Auto exposure', this.auto),
        field('Exposure', this.stops, this.stopsValue),
        field('Tone mapping', this.tone),
        field(
          'Background',
          select(BACKGROUNDS, 'theme', (id) => actions.setBackground(id)),
        ),
      ),
      section('Scene cameras', this.cameras),
    );
    this.setStops(0);
  }

  setMode(mode: ViewMode, falseColour: boolean): void {
    for (const [id, element] of this.modes) pressed(element, id === mode.id);
    this.falseRow.hidden = mode.falseColour === 'off';
    this.falseBox.disabled = mode.falseColour === 'always';
    this.falseBox.checked = falseColour;
    this.rangeRow.hidden = !falseColour || mode.falseColour === 'off';
  }

  /** Disables the views that the server streams no data for. */
  setAvailable(available: (mode: ViewMode) => boolean): void {
    for (const mode of VIEW_MODES) {
      const element = this.modes.get(mode.id)!;
      element.disabled = !available(mode);
      if (element.disabled) element.title = `${mode.hint} (not available from this server)`;
    }
  }

  setStops(stops: number): void {
    this.stops.value = String(stops);
    this.stopsValue.textContent = `${stops > 0 ? '+' : ''}${readable(stops, 3)} EV`;
  }

  setAuto(on: boolean): void {
    this.auto.checked = on;
  }

  setTone(id: string): void {
    this.tone.value = id;
  }

  /** The scale of a link; undefined: the scale follows the light. */
  setRange(range: [number, number] | undefined): void {
    this.autoRange.checked = range === undefined;
    this.low.disabled = this.high.disabled = range === undefined;
    if (!range) return;
    this.low.value = inField(range[0]);
    this.high.value = inField(range[1]);
  }

  showRange(low: number, high: number): void {
    if (!this.autoRange.checked) return;
    this.low.value = inField(low);
    this.high.value = inField(high);
  }

  setCameras(names: string[]): void {
    this.cameras.replaceChildren(
      ...names.map((name, i) => button(name, () => this.actions.useCamera(i))),
      ...(names.length === 0 ? [h('p', { class: 'dim' }, 'None in this scene.')] : []),
    );
  }

  private rangeInput(label: string): HTMLInputElement {
    return h('input', {
      type: 'text',
      inputMode: 'decimal',
      class: 'number',
      'aria-label': `${label} value of the scale`,
      disabled: true,
      onchange: () => this.changeRange(false),
    });
  }

  private changeRange(automatic: boolean): void {
    this.low.disabled = this.high.disabled = automatic;
    const [low, high] = [parseNumber(this.low.value), parseNumber(this.high.value)];
    if (automatic) this.actions.setRange(undefined);
    else if (low > 0 && high > low) this.actions.setRange([low, high]);
    else this.actions.notAccepted(`${this.low.value} to ${this.high.value}`, 'a value above 0 and a higher one');
  }
}
