// The panel "Solve": how far the light is, and how far it shall go.

import type { ErrorSample, Progress, Settings } from '../protocol/messages';
import { button, checkbox, field, h, section } from '../page/dom';
import { inField, parseNumber, percent, readable } from '../page/numbers';
import { ErrorPlot } from './error_plot';
import { Spaced } from '../page/spaced';

export interface SolvePanelActions {
  pauseOrResume(): void;
  restart(): void;
  configure(settings: Partial<Settings>): void;
  /** `wanted`: what the field takes. */
  notAccepted(text: string, wanted: string): void;
}

/** What a solve goes through by itself; what else it comes to, or from, somebody waits for. */
const ITS_OWN = ['solving', 'converged', 'limited', 'timeLimit'];

const STATES: Record<string, string> = {
  empty: 'No scene',
  loading: 'Loading',
  solving: 'Solving',
  paused: 'Paused',
  converged: 'Done',
  timeLimit: 'Time limit reached',
  limited: 'Stopped above target',
  failed: 'Failed',
};

export function stateName(state: string): string {
  return STATES[state] ?? state;
}

/** The state for people, and of a load how much of it is done. */
export function stateText({ state, fraction }: Pick<Progress, 'state' | 'fraction'>): string {
  if (state !== 'loading' || fraction === undefined) return stateName(state);
  return `${stateName(state)}, ${Math.round(100 * fraction)} %`;
}

/** How far the bar is, in [0, 1]: towards the target error on a logarithmic scale, or towards the end of a load. */
export function barValue(progress: Progress, firstError: number, target: number): number {
  if (progress.state === 'converged') return 1;
  if (progress.state === 'loading') return progress.fraction ?? 0;
  const way = Math.log(firstError / progress.error.total) / Math.log(firstError / target);
  return Math.min(1, Math.max(0, Number.isFinite(way) ? way : 0));
}

export function duration(seconds: number): string {
  if (seconds < 10) return `${readable(seconds, 2)} s`;
  if (seconds < 120) return `${Math.round(seconds)} s`;
  if (seconds < 7200) return `${Math.round(seconds / 60)} min`;
  return `${readable(seconds / 3600, 2)} h`;
}

export class SolvePanel {
  readonly element: HTMLElement;
  readonly plot = new ErrorPlot();
  private readonly facts = h('dl', { class: 'facts' });
  private readonly warnings = h('details', { hidden: true });
  private readonly pause: HTMLButtonElement;
  private readonly bar = h('progress', {
    max: 1,
    value: 0,
    'aria-label': 'Progress of the load, or towards the target error',
  });
  private readonly target: HTMLInputElement;
  private readonly texels: HTMLInputElement;
  private readonly bothSides: HTMLInputElement;
  private settings: Settings | undefined;
  private progress: Progress | undefined;
  private readonly spaced = new Spaced(() => this.showProgress());
  private typing: HTMLInputElement | undefined;
  private firstError = 1;

  constructor(actions: SolvePanelActions) {
    this.pause = button('Pause', () => actions.pauseOrResume());
    this.target = h('input', { type: 'text', class: 'number', inputMode: 'decimal' });
    this.target.onchange = () => {
      this.typing = undefined;
      const value = parseNumber(this.target.value.replace('%', '')) / 100;
      if (value > 0 && value <= 1) return actions.configure({ targetError: value });
      actions.notAccepted(this.target.value, 'a percentage above 0, up to 100');
      this.showSettings();
    };
    this.texels = h('input', { type: 'text', class: 'number', inputMode: 'numeric' });
    this.texels.onchange = () => {
      this.typing = undefined;
      const value = Math.round(parseNumber(this.texels.value));
      if (value >= 1) return actions.configure({ texels: value });
      actions.notAccepted(this.texels.value, 'a number, 1 or more');
      this.showSettings();
    };
    this.bothSides = checkbox(false, (on) => actions.configure({ doubleSided: on }));
    for (const input of [this.target, this.texels]) {
      input.oninput = () => (this.typing = input);
      input.onblur = () => (this.typing = undefined);
    }
    this.element = h(
      'div',
      {},
      section(
        'Progress',
        this.bar,
        this.facts,
        h(
          'div',
          { class: 'buttons' },
          this.pause,
          button('Restart', () => actions.restart()),
        ),
      ),
      section('Error against time', this.plot.element, legendLine()),
      section(
        'Target',
        field('Error, %', this.target),
        field('Texels, approx.', this.texels),
        field('Light both sides of all surfaces', this.bothSides),
      ),
      this.warnings,
    );
  }

  update(progress: Progress): void {
    this.plot.add(progress);
    const states = [progress.state, this.progress?.state ?? ''];
    this.progress = progress;
    if (progress.shots === 0 || progress.error.total > this.firstError)
      this.firstError = Math.max(progress.error.total, 1e-6);
    if (states.every((state) => ITS_OWN.includes(state))) this.spaced.soon();
    else this.spaced.now();
  }

  /** What the server remembers of the solve that is going on. */
  setHistory(samples: readonly ErrorSample[]): void {
    this.plot.addHistory(samples);
    this.spaced.soon();
  }

  private showProgress(): void {
    this.plot.draw();
    const { progress } = this;
    if (!progress) return;
    const { error } = progress;
    const target = this.settings?.targetError ?? 0.02;
    this.bar.value = barValue(progress, this.firstError, target);
    this.pause.textContent = progress.state === 'paused' ? 'Resume' : 'Pause';
    this.pause.disabled = progress.state !== 'paused' && progress.state !== 'solving';
    this.showFacts([
      ['State', progress.failure ? `${stateText(progress)}: ${progress.failure}` : stateText(progress)],
      [
        'Error',
        progress.unlit ? `no light arrives: ${progress.unlit}` : `${percent(error.total)} (target ${percent(target)})`,
      ],
      ['Residual', percent(error.residual)],
      ['Sampling', percent(error.sampling)],
      ['Within texels', percent(error.variation ?? 0)],
      ['Between texels', percent(error.discretization)],
      ['Shots', `${readable(progress.shots, 4)} (${readable(progress.shotsPerSecond, 2)}/s)`],
      ['Solve time', duration(progress.seconds)],
      ['Time left, approx.', progress.secondsLeft === undefined ? '–' : duration(progress.secondsLeft)],
      [
        'Unshot',
        `${readable(Math.abs(progress.energy['unshot'] ?? 0))} of ${readable(progress.energy['emitted'] ?? 0)} lm`,
      ],
      ['Patches', readable(progress.patches, 4)],
      ['Surfaces', readable(progress.surfaces, 4)],
    ]);
  }

  setSettings(settings: Settings): void {
    this.settings = settings;
    this.plot.setTarget(settings.targetError);
    this.showSettings();
    this.showProgress(); // what is done may stay as it is, and nothing be told of it
  }

  setWarnings(warnings: string[], count: number): void {
    this.warnings.hidden = count === 0;
    this.warnings.replaceChildren(
      h('summary', {}, `${count} warning${count === 1 ? '' : 's'} about the scene`),
      h('ul', {}, ...warnings.slice(0, 50).map((warning) => h('li', {}, warning))),
    );
  }

  /** What stands in the fields: the server's, also after it has refused others; not where somebody is typing. */
  showSettings(): void {
    if (!this.settings) return;
    if (this.typing !== this.target) this.target.value = inField(100 * this.settings.targetError);
    if (this.typing !== this.texels) this.texels.value = String(this.settings.texels);
    this.bothSides.checked = this.settings.doubleSided;
  }

  private showFacts(facts: [string, string][]): void {
    facts.forEach(([name, value], i) => {
      let [dt, dd] = [this.facts.children[2 * i], this.facts.children[2 * i + 1]];
      if (!dt || !dd) this.facts.append((dt = h('dt', {}, name)), (dd = h('dd')));
      if (dd.textContent !== value) dd.textContent = value;
    });
  }
}

function legendLine(): HTMLElement {
  const swatch = (name: string, label: string) => h('span', { class: `swatch ${name}` }, label);
  return h(
    'p',
    { class: 'swatches' },
    swatch('a', 'total'),
    swatch('b', 'sampling'),
    swatch('c', 'residual'),
    swatch('t', 'target'),
  );
}
