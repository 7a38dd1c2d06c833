// The panel "Solve": the progress and the target of the solve.

import type { ErrorSample, Method, Progress, Settings } from '../protocol/messages';
import { button, buttons, panel, checkbox, field, h, section, select } from '../page/dom';
import { inField, parseNumber, percent, readable } from '../page/numbers';
import { ErrorPlot } from './error_plot';
import { Spaced } from '../page/spaced';

export interface SolvePanelActions {
  pauseOrResume(): void;
  restart(): void;
  configure(settings: Partial<Settings>): void;
  /** `wanted`: the values that the field accepts. */
  notAccepted(text: string, wanted: string): void;
}

/**
 * States that a solve goes through by itself. Changes to and from other states show at once: somebody waits for them.
 */
const ITS_OWN = ['solving', 'converged', 'limited', 'timeLimit'];

const METHODS: { id: Method; label: string }[] = [
  { id: 'gather', label: 'Gather (default)' },
  { id: 'shooting', label: 'Progressive shooting' },
  { id: 'paper', label: 'Lum, Ma and Max 2002' },
];

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

/** The state for people, with the progress of a load. */
export function stateText({ state, fraction }: Pick<Progress, 'state' | 'fraction'>): string {
  const name = STATES[state] ?? state;
  return state !== 'loading' || fraction === undefined ? name : `${name}, ${Math.round(100 * fraction)} %`;
}

/** The error that the target is for. */
export function aimedAt({ error }: Pick<Progress, 'error'>, settings: Settings | undefined): number {
  return settings && choosesTexels(settings) ? error.total : error.texels;
}

/** Whether the server chooses texels: then the target is for what people see. */
export function choosesTexels({ adaptive, texelSize, method }: Settings): boolean {
  return adaptive && texelSize <= 0 && method !== 'paper';
}

/** Length of the bar in [0, 1]: towards the target error on a logarithmic scale, or towards the end of a load. */
export function barValue(
  progress: Pick<Progress, 'state' | 'fraction'>,
  error: number,
  firstError: number,
  target: number,
): number {
  if (progress.state === 'converged') return 1;
  if (progress.state === 'loading') return progress.fraction ?? 0;
  const way = Math.log(firstError / error) / Math.log(firstError / target);
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
  private readonly chosen: HTMLInputElement;
  private readonly bothSides: HTMLInputElement;
  private readonly method: HTMLSelectElement;
  private settings: Settings | undefined;
  private progress: Progress | undefined;
  private readonly spaced = new Spaced(() => this.showProgress());
  private typing: HTMLInputElement | undefined;
  private firstError = 1;

  constructor(private readonly actions: SolvePanelActions) {
    this.pause = button('Pause', () => actions.pauseOrResume());
    this.target = this.numberField('decimal', 'a percentage above 0, up to 100', (text) => {
      const value = parseNumber(text.replace('%', '')) / 100;
      return value > 0 && value <= 1 ? { targetError: value } : undefined;
    });
    this.texels = this.numberField('numeric', 'a number, 1 or more', (text) => {
      const value = Math.round(parseNumber(text));
      return value >= 1 ? { texels: value } : undefined;
    });
    this.chosen = checkbox(true, (on) => actions.configure({ adaptive: on }));
    this.bothSides = checkbox(false, (on) => actions.configure({ doubleSided: on }));
    this.method = select(METHODS, 'gather', (id) => actions.configure({ method: id as Method }));
    this.element = panel(
      section(
        'Progress',
        this.bar,
        this.facts,
        buttons(
          this.pause,
          button('Restart', () => actions.restart()),
        ),
      ),
      section('Error against time', this.plot.element, legendLine()),
      section(
        'Target',
        field('Error, %', this.target),
        field('Texels, approx.', this.texels),
        field('Finer texels where light wants them', this.chosen),
        field('Light both sides of all surfaces', this.bothSides),
        field('Method', this.method),
      ),
      this.warnings,
    );
  }

  update(progress: Progress): void {
    this.plot.add(progress);
    const states = [progress.state, this.progress?.state ?? ''];
    this.progress = progress;
    const error = aimedAt(progress, this.settings);
    if (progress.shots === 0 || error > this.firstError) this.firstError = Math.max(error, 1e-6);
    if (states.every((state) => ITS_OWN.includes(state))) this.spaced.soon();
    else this.spaced.now();
  }

  /** The server's samples of the present solve. */
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
    const chosen = this.settings !== undefined && choosesTexels(this.settings);
    const aim = ` (target ${percent(target)})`;
    this.bar.value = barValue(progress, aimedAt(progress, this.settings), this.firstError, target);
    this.pause.textContent = progress.state === 'paused' ? 'Resume' : 'Pause';
    this.pause.disabled = progress.state !== 'paused' && progress.state !== 'solving';
    this.showFacts([
      ['State', progress.failure ? `${stateText(progress)}: ${progress.failure}` : stateText(progress)],
      ['Error', progress.unlit ? `no light arrives: ${progress.unlit}` : percent(error.total) + (chosen ? aim : '')],
      [
        '95 % of places within',
        error.p95 !== undefined ? percent(error.p95) : error.measuring ? 'being measured' : '–',
      ],
      ['Texels alone', percent(error.texels) + (chosen ? '' : aim)],
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
    this.showProgress(); // the server may have no progress to tell of
  }

  setWarnings(warnings: string[], count: number): void {
    this.warnings.hidden = count === 0;
    this.warnings.replaceChildren(
      h('summary', {}, `${count} warning${count === 1 ? '' : 's'} about the scene`),
      h('ul', {}, ...warnings.slice(0, 50).map((warning) => h('li', {}, warning))),
    );
  }

  /** Puts the server's settings into the fields, but not into the one that the user is typing in. */
  showSettings(): void {
    if (!this.settings) return;
    if (this.typing !== this.target) this.target.value = inField(100 * this.settings.targetError);
    if (this.typing !== this.texels) this.texels.value = String(this.settings.texels);
    this.chosen.checked = this.settings.adaptive;
    const [label] = this.texels.labels ?? [];
    if (label) label.textContent = choosesTexels(this.settings) ? 'Texels, at most' : 'Texels, approx.';
    this.bothSides.checked = this.settings.doubleSided;
    this.method.value = this.settings.method;
  }

  /** `settingsOf`: the settings that a text means; undefined: it means none. `wanted`: the texts that mean some. */
  private numberField(
    inputMode: string,
    wanted: string,
    settingsOf: (text: string) => Partial<Settings> | undefined,
  ): HTMLInputElement {
    const input = h('input', { type: 'text', class: 'number', inputMode });
    input.oninput = () => (this.typing = input);
    input.onblur = () => (this.typing = undefined);
    input.onchange = () => {
      this.typing = undefined;
      const settings = settingsOf(input.value);
      if (settings) return this.actions.configure(settings);
      this.actions.notAccepted(input.value, wanted);
      this.showSettings();
    };
    return input;
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
