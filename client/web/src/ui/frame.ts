// The page: the picture, and around it a bar above, tools below and a panel beside (on narrow screens: below).

import { button, h, icon, iconButton, pressed } from '../page/dom';
import { makeHelp } from './help';
import { Legend, MeterCard } from './legend';
import { Spaced } from '../page/spaced';
import { store, stored } from '../page/stored';
import type { Toasts } from './toast';

export interface FrameActions {
  toggleWalk(): void;
  frameAll(): void;
  gizmo(mode: (typeof HANDLES)[number]): void;
  toggleMeter(): void;
  addLamp(): void;
  undo(): void;
  redo(): void;
}

type Tone = 'busy' | 'good' | 'short' | 'bad' | 'idle';
const HANDLES = ['translate', 'rotate', 'scale'] as const;
/** What may be wrong; without the first nothing of the others can be mended. */
const BANNERS = ['link', 'card', 'solve'] as const;
const THEMES = ['auto', 'dark', 'light'] as const;

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
  private readonly state = h('span', { class: 'state', role: 'status' }, 'Connecting');
  private readonly dot = h('span', { class: 'dot' });
  private readonly error = h('span', { class: 'error-now' });
  private readonly rate = h('span', { class: 'rate' });
  private told: { text: string; tone: Tone; error: string; rate: string } | undefined;
  private readonly spaced = new Spaced(() => this.showState());
  private readonly people = h('span', { class: 'people', title: 'Viewers', hidden: true });
  private readonly banners = new Map<(typeof BANNERS)[number], HTMLElement[]>();
  private readonly banner = h('div', { class: 'banner', role: 'alert', hidden: true });
  private readonly welcome = h('div', { class: 'welcome card', hidden: true });
  private readonly loadBar = h('progress', { max: 1, value: 0, 'aria-label': 'How much of the scene is loaded' });
  /** There is a picture, which no message shall cover. */
  sceneShown = false;
  private readonly panelButton = iconButton('panel', 'Panel', 'P', () => this.togglePanel());
  private readonly panel = h('aside', { class: 'panel', 'aria-label': 'Panel' });
  private readonly tools: Record<string, HTMLButtonElement>;
  private readonly tabs = new Map<string, { tab: HTMLButtonElement; body: HTMLElement }>();

  constructor(
    readonly toasts: Toasts,
    actions: FrameActions,
  ) {
    this.tools = this.makeTools(actions);
    const bar = h(
      'header',
      { class: 'bar' },
      h('span', { class: 'brand' }, 'radiosityd'),
      h('span', { class: 'chip' }, this.dot, this.state, this.error, this.rate),
      h('span', { class: 'spacer' }),
      this.people,
      this.themeButton(),
      iconButton('help', 'Keys', '?', () => this.help.showModal()),
      this.panelButton,
    );
    this.people.append(icon('people'), h('span', {}));
    const tools = h('div', { class: 'tools', role: 'toolbar', 'aria-label': 'Tools' }, ...Object.values(this.tools));
    const readings = h('div', { class: 'readings' }, this.legend.element);
    document.body.append(
      h('main', {}, this.canvas, readings, tools, this.welcome, this.banner),
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

  /** Shows a little later, but for what went wrong. */
  setState(text: string, tone: Tone, error = '', rate = ''): void {
    this.told = { text, tone, error, rate };
    if (tone === 'bad') this.spaced.now();
    else this.spaced.soon();
  }

  private showState(): void {
    if (!this.told) return;
    const { text, tone, error, rate } = this.told;
    // What is written anew is read out anew, though it is the same.
    const texts: [HTMLElement, string][] = [[this.state, text], [this.error, error], [this.rate, rate]]; // prettier-ignore
    for (const [element, wanted] of texts) if (element.textContent !== wanted) element.textContent = wanted;
    this.dot.className = `dot ${tone}`;
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

  /** `offered`: the others would change nothing. */
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

  /** Something that stays until it is mended; undefined: nothing is wrong about that. */
  setBanner(about: (typeof BANNERS)[number], text: string | undefined, label = '', act?: () => void): void {
    if (text === undefined) this.banners.delete(about);
    else this.banners.set(about, [h('span', {}, text), ...(act ? [button(label, act)] : [])]);
    this.showBanner();
  }

  /** What is wrong besides is said once the first is mended. */
  private showBanner(): void {
    const first = BANNERS.map((about) => this.banners.get(about)).find((one) => one !== undefined);
    this.banner.hidden = first === undefined;
    if (first && first[0] !== this.banner.firstChild) this.banner.replaceChildren(...first);
  }

  /** Says what there is to do where there is no scene, and that one is coming. */
  setWelcome(state: string, failure = '', fraction = 0): void {
    this.loadBar.value = fraction;
    this.welcome.hidden = !['empty', 'failed'].includes(state) && (state !== 'loading' || this.sceneShown);
    const shown = `${state} ${failure}`;
    if (this.welcome.hidden || this.welcome.dataset['state'] === shown) return;
    this.welcome.dataset['state'] = shown;
    if (state === 'loading')
      return this.welcome.replaceChildren(
        h('h2', {}, 'Loading the scene'),
        this.loadBar,
        h('p', {}, 'Laying out its surfaces for lightmaps; a large scene takes a while.'),
      );
    this.welcome.replaceChildren(
      h('h2', {}, state === 'failed' ? 'The server has lost the scene' : 'No scene yet'),
      failure && h('p', {}, `Reason: ${failure}.`),
      h('p', {}, 'Drop a .glb here, or send one:'),
      h('pre', { class: 'code' }, `curl -T room.glb ${location.origin}/scene`),
    );
  }

  askToken(reason: string, give: (token: string) => void): void {
    const input = h('input', { type: 'password', 'aria-label': 'Token', autocomplete: 'off' });
    const form = h(
      'form',
      { class: 'token' },
      h('span', {}, `This server requires a token: ${reason}.`),
      input,
      h('button', {}, 'Connect'),
    );
    form.onsubmit = (event) => {
      event.preventDefault();
      if (input.value) give(input.value.trim());
    };
    this.banners.set('link', [form]);
    this.showBanner();
    input.focus();
  }

  /** Lies over the picture, below the tools. */
  overPicture(element: HTMLElement): void {
    this.canvas.after(element);
  }

  /** From pixels of the page to those from -1 to 1 that the picture is projected to. */
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

  private makeTools(actions: FrameActions): Record<string, HTMLButtonElement> {
    const tool = (name: string, label: string, key: string, act: () => void) => iconButton(name, label, key, act);
    return {
      walk: tool('walk', 'First person', 'V', () => actions.toggleWalk()),
      frame: tool('frame', 'Frame everything', 'F', () => actions.frameAll()),
      meter: tool('meter', 'Light meter', 'M', () => actions.toggleMeter()),
      translate: tool('move', 'Move', 'T', () => actions.gizmo('translate')),
      rotate: tool('rotate', 'Rotate', 'R', () => actions.gizmo('rotate')),
      scale: tool('scale', 'Scale', 'Y', () => actions.gizmo('scale')),
      lamp: tool('lamp', 'Add a lamp', 'L', () => actions.addLamp()),
      undo: tool('undo', 'Undo', 'Ctrl+Z', () => actions.undo()),
      redo: tool('redo', 'Redo', 'Ctrl+Shift+Z', () => actions.redo()),
    };
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

  private themeButton(): HTMLButtonElement {
    let theme = stored('theme') ?? 'auto';
    const system = matchMedia('(prefers-color-scheme: light)');
    const apply = () => {
      document.documentElement.dataset['theme'] = theme !== 'auto' ? theme : system.matches ? 'light' : 'dark';
      element.textContent = theme === 'auto' ? '◐' : theme === 'dark' ? '☾' : '☀';
      element.title = `Theme: ${theme}`;
      element.setAttribute('aria-label', element.title);
    };
    const element: HTMLButtonElement = button(
      '',
      () => {
        theme = THEMES[(THEMES.indexOf(theme as (typeof THEMES)[number]) + 1) % THEMES.length]!;
        store('theme', theme);
        apply();
      },
      { class: 'icon' },
    );
    system.addEventListener('change', apply);
    apply();
    return element;
  }
}
