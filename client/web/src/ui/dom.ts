// Elements in one expression, and the small parts that panels are made of.

type Child = Node | string | undefined | false;
type Properties = Record<string, unknown>;

/** Properties that begin with "on" listen; "class" and names with "-" are attributes; others are set as they are. */
export function h<K extends keyof HTMLElementTagNameMap>(
  tag: K,
  properties: Properties = {},
  ...children: Child[]
): HTMLElementTagNameMap[K] {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(properties)) {
    if (value === undefined || value === false) continue;
    if (name.startsWith('on')) element.addEventListener(name.slice(2).toLowerCase(), value as EventListener);
    else if (name === 'class' || name === 'for' || name === 'role' || name.includes('-'))
      element.setAttribute(name, String(value));
    else Object.assign(element, { [name]: value });
  }
  element.append(...children.filter((child): child is Node | string => child !== undefined && child !== false));
  return element;
}

/** A button with a shown or spoken name. */
export function button(label: string, onClick: () => void, properties: Properties = {}): HTMLButtonElement {
  return h('button', { type: 'button', onclick: onClick, ...properties }, label);
}

const ICONS: Record<string, string> = {
  orbit: 'M12 4a8 8 0 1 0 8 8M12 8a4 4 0 1 0 4 4M17 3l3 3-3 3',
  walk: 'M13 4a1 1 0 1 0 .01 0M10 21l2-6-2-3 1-5 3 3h3M8 12l3-5M14 21l-2-6',
  frame: 'M4 9V4h5M15 4h5v5M20 15v5h-5M9 20H4v-5M9 12h6M12 9v6',
  move: 'M12 3v18M3 12h18M9 6l3-3 3 3M9 18l3 3 3-3M6 9l-3 3 3 3M18 9l3 3-3 3',
  rotate: 'M20 12a8 8 0 1 1-2.5-5.8M18 2v5h-5',
  scale: 'M4 20L20 4M14 4h6v6M10 20H4v-6',
  meter: 'M4 17a8 8 0 0 1 16 0M12 17l4-6M4 20h16',
  lamp: 'M9 18h6M10 21h4M12 3a6 6 0 0 0-3.5 10.9V16h7v-2.1A6 6 0 0 0 12 3',
  undo: 'M9 5L4 10l5 5M4 10h10a5 5 0 0 1 0 10h-3',
  redo: 'M15 5l5 5-5 5M20 10H10a5 5 0 0 0 0 10h3',
  panel: 'M4 5h16v14H4zM14 5v14',
  help: 'M9 9a3 3 0 1 1 4 2.8c-.8.4-1 1-1 2.2M12 17.5v.01',
  people: 'M9 11a3 3 0 1 0 0-6 3 3 0 0 0 0 6M3 20a6 6 0 0 1 12 0M16 5.5a3 3 0 0 1 0 5.5M17.5 14.5A6 6 0 0 1 21 20',
};

export function icon(name: string): SVGSVGElement {
  const svg = document.createElementNS('http://www.w3.org/2000/svg', 'svg');
  svg.setAttribute('viewBox', '0 0 24 24');
  svg.setAttribute('aria-hidden', 'true');
  const path = document.createElementNS('http://www.w3.org/2000/svg', 'path');
  path.setAttribute('d', ICONS[name] ?? '');
  svg.append(path);
  return svg;
}

export function iconButton(
  name: string,
  label: string,
  key: string,
  onClick: () => void,
  properties: Properties = {},
): HTMLButtonElement {
  const title = key ? `${label} (${key})` : label;
  return h(
    'button',
    { type: 'button', class: 'icon', title, 'aria-label': label, onclick: onClick, ...properties },
    icon(name),
  );
}

export function pressed(element: HTMLElement, on: boolean): void {
  element.setAttribute('aria-pressed', String(on));
}

export function section(title: string, ...children: Child[]): HTMLElement {
  return h('section', {}, h('h3', {}, title), ...children);
}

export function row(label: string, ...children: Child[]): HTMLElement {
  return h('div', { class: 'row' }, h('span', { class: 'label' }, label), ...children);
}

let nextId = 0;

/** A labelled control. */
export function field(label: string, control: HTMLElement, after?: HTMLElement): HTMLElement {
  control.id ||= `field-${++nextId}`;
  return h('div', { class: 'row' }, h('label', { class: 'label', for: control.id }, label), control, after);
}

export function select(
  options: readonly { id: string; label: string }[],
  value: string,
  onChange: (id: string) => void,
): HTMLSelectElement {
  const element = h('select', { onchange: () => onChange(element.value) });
  for (const option of options) element.append(h('option', { value: option.id }, option.label));
  element.value = value;
  return element;
}

export function checkbox(checked: boolean, onChange: (on: boolean) => void): HTMLInputElement {
  const element: HTMLInputElement = h('input', {
    type: 'checkbox',
    checked,
    onchange: () => onChange(element.checked),
  });
  return element;
}

/** Number with `digits` significant digits and thousands set apart; what is very small or large as a multiple of a power of ten. */
export function readable(value: number, digits = 3): string {
  if (!Number.isFinite(value)) return '–';
  if (value !== 0 && (Math.abs(value) < 1e-3 || Math.abs(value) >= 1e7)) return scientific(value, digits);
  return value.toLocaleString('en', {
    maximumSignificantDigits: Math.max(digits, 1 + Math.floor(Math.log10(Math.abs(value) || 1))),
  });
}

function scientific(value: number, digits: number): string {
  const [units, power] = value.toExponential(digits - 1).split('e');
  return `${units} × 10${superscript(Number(power))}`;
}

/** The same for what was measured: a zero at its end was measured, too. */
export function measured(value: number): string {
  const text = readable(value);
  if (!/^-?[\d.]+$/.test(text)) return text; // without a fraction, or as a power of ten: nothing was left out
  return value.toLocaleString('en', { minimumSignificantDigits: 3, maximumSignificantDigits: 3 });
}

/** Digits of a measured value at most, however small its error. */
const MOST_DIGITS = 5;

/** Place of the first digit: 0 is that of units. What rounding took from 1000 in the last bits is not missed. */
function firstDigit(value: number): number {
  return value === 0 ? -Infinity : Number(value.toExponential(8).split('e')[1]);
}

/**
 * A measured value and its error, one written as the other: to the second significant digit of the error, and where
 * either would be long, as multiples of the same power of ten. Between them belongs " ± ", after them the unit.
 */
export function withError(value: number, error: number): [string, string] {
  const roundedError = Number(Math.abs(error).toPrecision(2));
  const largest = Math.max(Math.abs(Number(value.toPrecision(MOST_DIGITS))), roundedError);
  if (!(largest > 0 && Number.isFinite(largest))) return [readable(value), readable(error)];
  const last = Math.max(firstDigit(roundedError), firstDigit(largest) + 2 - MOST_DIGITS) - 1;
  const v = Math.round(value / 10 ** last) + 0; // -0 would be written with its sign
  // An error that is less than the last digit is no more than one of it.
  const e = Math.max(roundedError > 0 ? 1 : 0, Math.round(roundedError / 10 ** last));
  // Of what is written: a value may have got a digit more when it was rounded.
  const first = firstDigit(Math.max(Math.abs(v), e)) + last;
  const power = first < -3 || first >= 7 ? first : 0;
  const decimals = Math.max(0, power - last);
  const format = { minimumFractionDigits: decimals, maximumFractionDigits: decimals };
  const write = (units: number) => (units * 10 ** (last - power)).toLocaleString('en', format);
  return power === 0 ? [write(v), write(e)] : [`(${write(v)}`, `${write(e)}) × 10${superscript(power)}`];
}

function superscript(n: number): string {
  return [...String(n)].map((c) => (c === '-' ? '⁻' : '⁰¹²³⁴⁵⁶⁷⁸⁹'[Number(c)]!)).join('');
}

/**
 * The number that somebody wrote, with a point or a comma before its fraction; NaN: none. Commas between groups of three
 * digits, as readable() writes them, set thousands apart: "1,500" is 1500, "1,5" and "0,125" are fractions.
 */
export function parseNumber(text: string): number {
  const plain = text.trim().replace(/\s+/g, '');
  if (/^[-+]?[1-9]\d{0,2}(,\d{3})+(\.\d*)?$/.test(plain)) return Number(plain.replaceAll(',', ''));
  if (!/^[-+]?(\d+[.,]?\d*|[.,]\d+)(e[-+]?\d+)?$/i.test(plain)) return NaN;
  const value = Number(plain.replace(',', '.'));
  return Number.isFinite(value) ? value : NaN; // "1e999" is none that a message could carry
}

/** Three digits of a number as somebody would write it. */
export function inField(value: number): string {
  return String(Number(value.toPrecision(3)));
}

export function percent(fraction: number): string {
  return Number.isFinite(fraction) ? `${readable(100 * fraction, 2)} %` : '–';
}

/** "#rrggbb" of linear RGB and back; above 1 is cut off, the caller keeps strength apart. */
export function toHex(rgb: readonly number[]): string {
  const byte = (v: number) => {
    const c = Math.min(1, Math.max(0, v));
    const s = c <= 0.0031308 ? 12.92 * c : 1.055 * c ** (1 / 2.4) - 0.055;
    return Math.round(255 * s)
      .toString(16)
      .padStart(2, '0');
  };
  return `#${rgb.slice(0, 3).map(byte).join('')}`;
}

export function fromHex(hex: string): [number, number, number] {
  const channel = (at: number) => {
    const s = parseInt(hex.slice(at, at + 2), 16) / 255;
    const c = s <= 0.04045 ? s / 12.92 : ((s + 0.055) / 1.055) ** 2.4;
    return Number(c.toPrecision(6));
  };
  return [channel(1), channel(3), channel(5)];
}

export async function copyText(text: string): Promise<boolean> {
  try {
    await navigator.clipboard.writeText(text);
    return true;
  } catch {
    // Pages without TLS have no clipboard; an old way still works there.
    const area = h('textarea', { value: text, class: 'offscreen' });
    document.body.append(area);
    area.select();
    const done = document.execCommand('copy');
    area.remove();
    return done;
  }
}

export function download(blob: Blob, name: string): void {
  const link = h('a', { href: URL.createObjectURL(blob), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}
