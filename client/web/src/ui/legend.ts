// The legend of a false-colour picture, and the card with the light meter's reading.

import { MIP_STOPS, NOTHING, paletteCss } from '../view/looks/palette';
import { h } from '../page/dom';
import { measured, readable, withError } from '../page/numbers';

const LABELS = 5;
/** Labels with powers of ten are longer, so there is room for fewer. */
const LONG_LABELS = 3;

/**
 * Labels of a logarithmic scale. Its first and last colour also stand for all values beyond the scale, such as lamps.
 */
export function scaleLabels(low: number, high: number): string[] {
  const labels = (count: number) =>
    Array.from({ length: count }, (_, i) => {
      const sign = i === 0 ? '≤ ' : i === count - 1 ? '≥ ' : '';
      return sign + readable(low * (high / low) ** (i / (count - 1)), 2);
    });
  const all = labels(LABELS);
  return all.some((label) => label.includes('×')) ? labels(LONG_LABELS) : all;
}

export class Legend {
  private readonly bar = h('div', { class: 'bar' });
  private readonly ticks = h('div', { class: 'ticks' });
  private readonly title = h('div', { class: 'title' });
  readonly element = h(
    'figure',
    { class: 'legend card', 'aria-label': 'Colour scale', hidden: true },
    this.title,
    this.bar,
    this.ticks,
  );

  hide(): void {
    this.element.hidden = true;
  }

  show(title: string, unit: string, low: number, high: number): void {
    this.fill(`${title}, ${unit}`, paletteCss('to right'), scaleLabels(low, high));
  }

  /** There is no value yet, or none above 0, so there is no scale. */
  showNothing(title: string, unit: string, why: string): void {
    this.fill(`${title}, ${unit}`, `rgb(${NOTHING.map((c) => Math.round(255 * c)).join(' ')})`, [why]);
  }

  showMips(): void {
    const labels = MIP_STOPS.map((_, mip) =>
      mip === 0 ? '0, finest' : mip < MIP_STOPS.length - 1 ? `${mip}` : `${mip} +`,
    );
    this.fill('Mip level of the light', paletteCss('to right', MIP_STOPS), labels);
  }

  private fill(title: string, background: string, labels: string[]): void {
    this.element.hidden = false;
    const text = [title, background, ...labels].join(' ');
    if (this.ticks.dataset['text'] === text) return;
    this.ticks.dataset['text'] = text;
    this.title.textContent = title;
    this.bar.style.background = background;
    this.ticks.replaceChildren(...labels.map((label) => h('span', {}, label)));
  }
}

interface Size {
  width: number;
  height: number;
}

interface Point {
  x: number;
  y: number;
}

/** Left and top of a card at the pointer, within the page and, if possible, clear of `other`. */
export function besidePointer(pointer: Point, card: Size, page: Size, other?: Point & Size): Point {
  const right = Math.min(Math.max(8, pointer.x + 18), Math.max(8, page.width - card.width - 8));
  const left = Math.max(8, pointer.x - card.width - 14);
  const [below, above] = [pointer.y + 18, pointer.y - card.height - 14];
  const isFree = ({ x, y }: Point) =>
    y >= 0 &&
    y + card.height <= page.height &&
    !(
      other &&
      x < other.x + other.width &&
      x + card.width > other.x &&
      y < other.y + other.height &&
      y + card.height > other.y
    );
  const overOther = { x: right, y: (other?.y ?? page.height) - card.height - 8 };
  const places = [below, above].flatMap((y) => [right, left].map((x) => ({ x, y })));
  return [...places, overOther].find(isFree) ?? { x: right, y: below + card.height > page.height ? above : below };
}

/** The light meter's reading, beside the pointer. */
export class MeterCard {
  private readonly value = h('strong', {});
  private readonly bar = h('span', { class: 'errorbar' });
  private readonly more = h('div', { class: 'dim' });
  readonly element = h(
    'div',
    { class: 'meter card', role: 'status', hidden: true },
    h('div', {}, this.value, this.bar),
    this.more,
  );

  /** Marks the place that is read when no pointer shows it. */
  readonly mark = h('div', { class: 'meter-mark', hidden: true });

  /** `legend`: the card avoids it. */
  constructor(private readonly legend: HTMLElement) {}

  hide(): void {
    this.element.hidden = this.mark.hidden = true;
  }

  /** `light`: lux, or the reason why there is none. `error`: standard error, lux. */
  show(
    x: number,
    y: number,
    light: number | string,
    error: number | undefined,
    details: string,
    isMarked: boolean,
  ): void {
    this.element.hidden = false;
    this.mark.hidden = !isMarked;
    this.mark.style.transform = `translate(${Math.round(x)}px, ${Math.round(y)}px) translate(-50%, -50%)`;
    const sure = error === undefined || !Number.isFinite(error);
    const isDark = typeof light === 'string';
    const [value, either] = isDark ? [light, ''] : sure ? [measured(light), ''] : withError(light, error);
    this.value.textContent = value;
    this.bar.textContent = isDark ? '' : either ? ` ± ${either} lx` : ' lx';
    this.more.textContent = details;
    const { offsetWidth: width, offsetHeight: height } = this.element;
    const legend = this.legend.hidden ? undefined : this.legend.getBoundingClientRect();
    const at = besidePointer({ x, y }, { width, height }, { width: innerWidth, height: innerHeight }, legend);
    this.element.style.transform = `translate(${Math.round(at.x)}px, ${Math.round(at.y)}px)`;
  }
}
