// The page: the picture, a bar above it, tools below it, and a panel beside it (on narrow screens: below it).

import { button, h, icon, iconButton, pressed } from '../page/dom';
import { Banner, type Cause } from './banner';
import { makeHelp } from './help';
import { Legend, MeterCard } from './legend';
import { StateChip, type StateTone } from './state_chip';
import { themeButton } from './theme';
import type { Toasts } from './toast';
import { Welcome } from './welcome';

export interface FrameActions {
  toggleWalk(): void;
  frameAll(): void;
  gizmo(mode: (typeof HANDLES)[number]): void;
  toggleMeter(): void;
  addLamp(): void;
  undo(): void;
  redo(): void;
}

const HANDLES = ['translate', 'rotate', 'scale'] as const;

export class Frame {
  readonly canvas = h('canvas', {
    class: 'view',
    tabIndex: 0,
    role: 'application',
    'aria-label': 'The scene. Press ? for keys.',
  });
  readonly legend = new Legend();
  readonly meter = new MeterCard(this.legend.element);
  readonly help = makeHelp();
  private readonly chip = new StateChip();
  private readonly banner = new Banner();
  private readonly welcome = new Welcome();
  private readonly people = h('span', { class: 'people', title: 'Viewers', hidden: true }, icon('people'), h('span'));
  private readonly panelButton = iconButton('panel', 'Panel', 'P', () => this.togglePanel());
  private readonly panel = h('aside', { class: 'panel', 'aria-label': 'Panel' });
  private readonly tools: Record<string, HTMLButtonElement>;
  private readonly tabs = new Map<string, { tab: HTMLButtonElement; body: HTMLElement }>();

  constructor(
    readonly toasts: Toasts,
    actions: FrameActions,
  ) {
    this.tools = makeTools(actions);
    const bar = h(
      'header',
      { class: 'bar' },
      h('span', { class: 'brand' }, 'radiosityd'),
      this.chip.element,
      h('span', { class: 'spacer' }),
      this.people,
      themeButton(),
      iconButton('help', 'Keys', '?', () => this.help.showModal()),
      this.panelButton,
    );
    const tools = h('div', { class: 'tools', role: 'toolbar', 'aria-label': 'Tools' }, ...Object.values(this.tools));
    const readings = h('div', { class: 'readings' }, this.legend.element);
    document.body.append(
      h('main', {}, this.canvas, readings, tools, this.welcome.element, this.banner.element),
      bar,
      this.panel,
      this.meter.mark,
      this.meter.element,
      this.toasts.element,
      this.help,
    );
    this.openPanel(innerWidth >= 900);
    this.setGizmo('translate');
    this.setHistory(false, false);
  }

  /** There is a picture, which the welcome must not cover. */
  set sceneShown(shown: boolean) {
    this.welcome.sceneShown = shown;
  }

  setState(text: string, tone: StateTone, error = '', rate = ''): void {
    this.chip.set({ text, tone, error, rate });
  }

  setWelcome(state: string, failure?: string, fraction?: number): void {
    this.welcome.show(state, failure, fraction);
  }

  setBanner(about: Cause, text: string | undefined, label?: string, act?: () => void): void {
    this.banner.set(about, text, label, act);
  }

  askToken(reason: string, give: (token: string) => void): void {
    this.banner.askToken(reason, give);
  }

  setViewers(count: number): void {
    this.people.hidden = count < 2;
    this.people.lastElementChild!.textContent = String(count);
    this.people.title = `${count} viewers`;
  }

  setWalk(on: boolean): void {
    pressed(this.tools['walk']!, on);
  }

  setMeter(on: boolean): void {
    pressed(this.tools['meter']!, on);
  }

  /** `offered`: the handles that change something about the selected object. */
  setGizmo(mode: string, offered: readonly string[] = HANDLES): void {
    for (const name of HANDLES) {
      pressed(this.tools[name]!, name === mode);
      this.tools[name]!.disabled = !offered.includes(name);
    }
  }

  setHistory(undo: boolean, redo: boolean): void {
    this.tools['undo']!.disabled = !undo;
    this.tools['redo']!.disabled = !redo;
  }

  /** Puts an element over the picture, and below the tools. */
  overPicture(element: HTMLElement): void {
    this.canvas.after(element);
  }

  /** From pixels of the page to normalised device coordinates of the picture. */
  toDevice(x: number, y: number): [number, number] {
    const box = this.canvas.getBoundingClientRect();
    return [((x - box.left) / box.width) * 2 - 1, 1 - ((y - box.top) / box.height) * 2];
  }

  togglePanel(): void {
    this.openPanel(this.panel.hidden);
  }

  toggleChrome(): void {
    document.body.classList.toggle('bare');
  }

  showTab(name: string): void {
    for (const [other, { tab, body }] of this.tabs) {
      const on = other === name;
      tab.setAttribute('aria-selected', String(on));
      tab.tabIndex = on ? 0 : -1;
      body.hidden = !on;
    }
  }

  get panelOpen(): boolean {
    return !this.panel.hidden;
  }

  private openPanel(open: boolean): void {
    this.panel.hidden = !open;
    document.body.classList.toggle('with-panel', open);
    pressed(this.panelButton, open);
  }

  /** By the names of their tabs; the first is shown. */
  setPanels(panels: Record<string, HTMLElement>): void {
    const names = Object.keys(panels);
    const bar = h('div', { class: 'tabs', role: 'tablist' });
    this.panel.append(bar);
    for (const name of names) {
      const body = h('div', { class: 'tab-body', role: 'tabpanel', id: `tab-${name}` }, panels[name]);
      const tab = button(name, () => this.showTab(name), { role: 'tab', 'aria-controls': body.id });
      tab.onkeydown = ({ key }) => {
        const step = key === 'ArrowRight' ? 1 : key === 'ArrowLeft' ? names.length - 1 : 0;
        if (step === 0) return;
        const next = names[(names.indexOf(name) + step) % names.length]!;
        this.showTab(next);
        this.tabs.get(next)?.tab.focus();
      };
      bar.append(tab);
      this.panel.append(body);
      this.tabs.set(name, { tab, body });
    }
    this.showTab(names[0]!);
  }
}

function makeTools(actions: FrameActions): Record<string, HTMLButtonElement> {
  return {
    walk: iconButton('walk', 'First person', 'V', () => actions.toggleWalk()),
    frame: iconButton('frame', 'Frame everything', 'F', () => actions.frameAll()),
    meter: iconButton('meter', 'Light meter', 'M', () => actions.toggleMeter()),
    translate: iconButton('move', 'Move', 'T', () => actions.gizmo('translate')),
    rotate: iconButton('rotate', 'Rotate', 'R', () => actions.gizmo('rotate')),
    scale: iconButton('scale', 'Scale', 'Y', () => actions.gizmo('scale')),
    lamp: iconButton('lamp', 'Add a lamp', 'L', () => actions.addLamp()),
    undo: iconButton('undo', 'Undo', 'Ctrl+Z', () => actions.undo()),
    redo: iconButton('redo', 'Redo', 'Ctrl+Shift+Z', () => actions.redo()),
  };
}
