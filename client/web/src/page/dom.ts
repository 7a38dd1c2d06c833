// Elements in one expression, the small parts that panels are made of, and what leaves the page: clipboard and files.

type Child = Node | string | undefined | false;
type Properties = Record<string, unknown>;

/** Properties that begin with "on" are listeners; "class", "for", "role" and names with "-" are attributes. */
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

export function panel(...children: Child[]): HTMLElement {
  return h('div', {}, ...children);
}

export function buttons(...children: Child[]): HTMLElement {
  return h('div', { class: 'buttons' }, ...children);
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

export async function copyText(text: string): Promise<boolean> {
  try {
    await navigator.clipboard.writeText(text);
    return true;
  } catch {
    // Pages without TLS have no clipboard, but an older way still works there.
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
