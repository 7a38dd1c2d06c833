// The panel "Measure": measuring planes with what was measured on them, and what they are to reach.

import type { PlaneSpec, PlaneTarget } from '../document/planes';
import { button, buttons, checkbox, field, h, panel, section } from '../page/dom';
import { parseNumber } from '../page/numbers';
import type { MeasuredPlane, PlaneFigures, Planes } from '../protocol/messages';

export interface PlaneEntry {
  node: number;
  name: string;
  spec: PlaneSpec;
}

export interface PlanesPanelActions {
  add(): void;
  measure(): void;
  setDaylight(on: boolean): void;
  downloadCsv(): void;
  select(node: number): void;
  setSize(node: number, member: 'width' | 'depth', metres: number): void;
  setTarget(node: number, member: keyof PlaneTarget, value: number | undefined): void;
  notAccepted(text: string, wanted: string): void;
}

function brief(value: number): string {
  return String(Number(value.toPrecision(value < 1 ? 2 : 3)));
}

/** "540 ± 1.2 lx, minimum 480, maximum 590, U0 0.89" */
export function figuresText(figures: PlaneFigures, unit: string): string {
  const { mean, meanError, minimum, maximum, uniformity } = figures;
  const parts = [
    `${brief(mean)} ± ${brief(meanError)} ${unit}`,
    `minimum ${brief(minimum)}`,
    `maximum ${brief(maximum)}`,
    `U0 ${uniformity.toFixed(2)}`,
  ];
  return parts.join(', ');
}

/** "500 lx: passes, U0 0.6: undecided (95 %)"; undefined: nothing is asked for. */
export function verdictText({ target, verdict }: MeasuredPlane): string | undefined {
  if (!target || !verdict) return undefined;
  const parts: string[] = [];
  if (target.lux !== undefined && verdict.lux) parts.push(`${target.lux} lx: ${verdict.lux}`);
  if (target.uniformity !== undefined && verdict.uniformity)
    parts.push(`U0 ${target.uniformity}: ${verdict.uniformity}`);
  return `${parts.join(', ')} (95 %)`;
}

export class PlanesPanel {
  readonly element: HTMLElement;
  private readonly list = h('div');
  private readonly state = h('p', { class: 'dim' });
  private readonly measure: HTMLButtonElement;
  private readonly csv: HTMLButtonElement;
  private text = '';

  constructor(private readonly actions: PlanesPanelActions) {
    this.measure = button('Measure', () => actions.measure());
    this.csv = button('Download CSV', () => actions.downloadCsv());
    this.element = panel(
      section(
        'Measuring planes',
        buttons(
          button('Add plane', () => actions.add(), {
            title: '0.75 m above the selected floor, or on the selected table',
          }),
          this.measure,
          this.csv,
        ),
        field(
          'Daylight factor',
          checkbox(false, (on) => actions.setDaylight(on)),
        ),
        this.state,
      ),
      this.list,
    );
    this.show([], undefined, 0, false);
  }

  /** `measured`: at `measured.revision`; the scene is at `revision` now. */
  show(planes: readonly PlaneEntry[], measured: Planes | undefined, revision: number, busy: boolean): void {
    const text = JSON.stringify([planes, measured?.revision, measured?.planes.map(({ mean }) => mean), revision, busy]);
    const isTyping = this.list.contains(document.activeElement) && document.activeElement instanceof HTMLInputElement;
    if (text === this.text || isTyping) return;
    this.text = text;
    this.measure.disabled = busy || planes.length === 0;
    this.csv.disabled = busy || planes.length === 0;
    this.state.textContent = busy
      ? 'Measuring…'
      : planes.length === 0
        ? 'None yet.'
        : measured && measured.revision !== revision
          ? 'The scene has changed since these were measured.'
          : measured && measured.state !== 'converged'
            ? 'The light was not solved for yet when these were measured.'
            : '';
    this.list.replaceChildren(...planes.map((plane) => this.entry(plane, measured)));
  }

  private entry({ node, name, spec }: PlaneEntry, measured: Planes | undefined): HTMLElement {
    const found = measured?.planes.find((plane) => plane.node === node);
    const verdict = found && verdictText(found);
    return section(
      name,
      ...(found ? [h('p', {}, figuresText(found, 'lx'))] : []),
      ...(verdict ? [h('p', {}, verdict)] : []),
      ...(found?.daylightFactor ? [h('p', {}, `Daylight factor ${figuresText(found.daylightFactor, '%')}`)] : []),
      field('Width, m', this.size(node, 'width', spec.width)),
      field('Depth, m', this.size(node, 'depth', spec.depth)),
      field('Wanted mean, lx', this.target(node, 'lux', spec.target?.lux, 1e9)),
      field('Wanted U0', this.target(node, 'uniformity', spec.target?.uniformity, 1)),
      buttons(button('Select', () => this.actions.select(node))),
    );
  }

  private size(node: number, member: 'width' | 'depth', metres: number): HTMLInputElement {
    return this.input(String(metres), (text) => {
      const value = parseNumber(text);
      if (value > 0 && value <= 1e6) this.actions.setSize(node, member, value);
      else this.actions.notAccepted(text, 'a number of metres above 0');
    });
  }

  /** An empty field asks for nothing. */
  private target(node: number, member: keyof PlaneTarget, value: number | undefined, most: number): HTMLInputElement {
    return this.input(value === undefined ? '' : String(value), (text) => {
      const wanted = text.trim() === '' ? undefined : parseNumber(text);
      if (wanted === undefined || (wanted > 0 && wanted <= most)) this.actions.setTarget(node, member, wanted);
      else this.actions.notAccepted(text, `a number above 0, at most ${most}`);
    });
  }

  private input(value: string, changed: (text: string) => void): HTMLInputElement {
    const input = h('input', { type: 'text', inputMode: 'decimal', class: 'number', value });
    input.addEventListener('change', () => {
      this.text = ''; // a refused value is replaced by the last good one
      changed(input.value);
    });
    return input;
  }
}
