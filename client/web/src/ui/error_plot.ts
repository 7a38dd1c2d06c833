// The plot of the solve's error against time, on logarithmic axes.

import type { Progress } from '../protocol/messages';
import { h } from '../page/dom';

export interface Sample {
  seconds: number;
  total: number;
  residual: number;
  sampling: number;
}

const LINES = [
  { key: 'sampling', colour: '--plot-b' },
  { key: 'residual', colour: '--plot-c' },
  { key: 'total', colour: '--accent' },
] as const;
const MARGIN = { left: 44, right: 8, top: 8, bottom: 22 };
const MOST = 600;

export class ErrorPlot {
  readonly element = h('canvas', {
    class: 'plot',
    role: 'img',
    'aria-label': 'Error against solve time, on logarithmic axes',
  });
  private samples: Sample[] = [];
  private target = 0;

  constructor() {
    new ResizeObserver(() => this.draw()).observe(this.element);
    // Unlike elements, a canvas does not change its colours with the theme.
    new MutationObserver(() => this.draw()).observe(document.documentElement, { attributeFilter: ['data-theme'] });
    matchMedia('(prefers-color-scheme: light)').addEventListener('change', () => this.draw());
  }

  /** The next draw() shows it. */
  add(progress: Progress): void {
    const last = this.samples.at(-1);
    // Solve time steps back when an edit or another scene begins a new solve.
    if (last && progress.seconds < last.seconds) this.samples = [];
    if (!(progress.seconds > 0) || progress.seconds === last?.seconds) return;
    this.samples.push({ seconds: progress.seconds, ...progress.error });
    // Samples are even in time, but the axis is logarithmic: of many old samples every second one is enough.
    if (this.samples.length > MOST) this.samples = this.samples.filter((_, i) => i % 2 === 0 || i > MOST - 50);
  }

  /** Samples of the same solve from before the page was opened, or while it was away. The next draw() shows them. */
  addHistory(history: readonly Sample[]): void {
    this.samples = withHistory(this.samples, history);
  }

  /** The samples of the plot, by ascending time. */
  get drawn(): readonly Sample[] {
    return this.samples;
  }

  /** The next draw() shows it. */
  setTarget(target: number): void {
    this.target = target;
  }

  draw(): void {
    const { clientWidth, clientHeight } = this.element;
    // Lengths are for a page whose letters have 14 pixels, and grow with the letters.
    const unit = parseFloat(getComputedStyle(document.documentElement).fontSize) / 14;
    const [width, height] = [clientWidth / unit, clientHeight / unit];
    const context = this.element.getContext('2d');
    if (!context || width === 0) return;
    const ratio = devicePixelRatio;
    const [columns, rows] = [Math.round(clientWidth * ratio), Math.round(clientHeight * ratio)];
    if (this.element.width !== columns || this.element.height !== rows) {
      this.element.width = columns;
      this.element.height = rows;
    }
    context.setTransform(ratio * unit, 0, 0, ratio * unit, 0, 0);
    context.clearRect(0, 0, width, height);
    const style = getComputedStyle(this.element);
    const x = scale(
      this.samples.map((s) => s.seconds),
      1,
      MARGIN.left,
      width - MARGIN.right,
    );
    const y = scale([...errorsShown(this.samples), this.target || 0.02], 1, height - MARGIN.bottom, MARGIN.top);
    this.axes(context, style, x, y, width, height);
    context.save();
    context.beginPath();
    context.rect(MARGIN.left, MARGIN.top, width - MARGIN.left - MARGIN.right, height - MARGIN.top - MARGIN.bottom);
    context.clip();
    for (const { key, colour } of LINES) this.line(context, style.getPropertyValue(colour), key, x, y);
    context.restore();
  }

  private axes(
    context: CanvasRenderingContext2D,
    style: CSSStyleDeclaration,
    x: LogScale,
    y: LogScale,
    width: number,
    height: number,
  ): void {
    context.font = `11px ${style.fontFamily}`;
    context.fillStyle = style.getPropertyValue('--dim');
    context.strokeStyle = style.getPropertyValue('--line');
    context.lineWidth = 1;
    context.textAlign = 'center';
    for (const tick of x.ticks) {
      stroke(context, x.at(tick), MARGIN.top, x.at(tick), height - MARGIN.bottom);
      const text = `${short(tick)} s`;
      context.fillText(text, within(x.at(tick), context.measureText(text).width, width), height - 7);
    }
    context.textAlign = 'right';
    for (const tick of y.ticks) {
      stroke(context, MARGIN.left, y.at(tick), width - MARGIN.right, y.at(tick));
      context.fillText(`${short(100 * tick)} %`, MARGIN.left - 5, y.at(tick) + 4);
    }
    if (!this.target) return;
    context.strokeStyle = style.getPropertyValue('--good');
    context.setLineDash([4, 4]);
    stroke(context, MARGIN.left, y.at(this.target), width - MARGIN.right, y.at(this.target));
    context.setLineDash([]);
  }

  private line(
    context: CanvasRenderingContext2D,
    colour: string,
    key: (typeof LINES)[number]['key'],
    x: LogScale,
    y: LogScale,
  ): void {
    context.beginPath();
    context.strokeStyle = colour;
    context.lineWidth = key === 'total' ? 2 : 1.2;
    for (const sample of this.samples) if (sample[key] > 0) context.lineTo(x.at(sample.seconds), y.at(sample[key]));
    context.stroke();
    // A very short solve has only one sample, which makes no line, so the last sample gets a dot.
    const last = this.samples.at(-1);
    if (!last || !(last[key] > 0)) return;
    context.beginPath();
    context.fillStyle = colour;
    context.arc(x.at(last.seconds), y.at(last[key]), key === 'total' ? 3 : 2, 0, 2 * Math.PI);
    context.fill();
  }
}

/** The server's samples replace the page's own, which may have gaps, for the time that they cover. */
export function withHistory(own: readonly Sample[], history: readonly Sample[]): Sample[] {
  const [first, last] = [history[0], history.at(-1)];
  if (!first || !last) return [...own];
  const before = own.filter(({ seconds }) => seconds < first.seconds);
  return [...before, ...history, ...own.filter(({ seconds }) => seconds > last.seconds)];
}

/** The values that the axis has to show: all of the legend, but no part that is negligible beside the total. */
export function errorsShown(samples: readonly Sample[]): number[] {
  const parts = samples.flatMap(({ sampling, residual }) => [sampling, residual]);
  return [...samples.map(({ total }) => total), ...parts.filter((part) => part > 1e-4)];
}

/** The middle of a text, moved so that the canvas cuts nothing of the text off at the left or right. */
export function within(middle: number, textWidth: number, width: number): number {
  return Math.max(textWidth / 2, Math.min(middle, width - textWidth / 2));
}

interface LogScale {
  at(value: number): number;
  ticks: number[];
}

/** Ticks of a decade. The first that give enough ticks are taken. */
const STEPS = [[1], [1, 2, 5], [1, 2, 3, 5, 7], [1, 1.5, 2, 3, 4, 5, 7]];
const FEWEST_TICKS = 3;
/** Least distance between ticks, as a part of the axis: their texts need room. */
const LEAST_GAP = 0.15;

/** Ticks of a logarithmic axis. */
export function ticksBetween(low: number, high: number): number[] {
  let ticks: number[] = [];
  // A long axis has room only for every second or third power of ten.
  const stride = Math.max(1, Math.ceil(LEAST_GAP * Math.log10(high / low)));
  for (const steps of STEPS) {
    const finer: number[] = [];
    for (let decade = stride * Math.floor(Math.log10(low) / stride); 10 ** decade <= high; decade += stride)
      finer.push(...steps.map((step) => step * 10 ** decade).filter((tick) => tick >= low && tick <= high));
    const gaps = finer.slice(1).map((tick, i) => Math.log(tick / finer[i]!) / Math.log(high / low));
    if (steps.length > 1 && Math.min(...gaps) < LEAST_GAP) break;
    ticks = finer;
    if (ticks.length >= FEWEST_TICKS) break;
  }
  return ticks;
}

/** An axis for all values and `atLeast`, with a little room at its ends. */
function scale(values: number[], atLeast: number, from: number, to: number): LogScale {
  const good = values.filter((v) => v > 0 && Number.isFinite(v));
  const least = 0.9 * Math.min(atLeast, ...good);
  const most = 1.1 * Math.max(values.length ? 0 : atLeast, ...good, 2 * least);
  const [low, high] = [Math.log10(least), Math.log10(most)];
  const at = (value: number) => from + ((Math.log10(value) - low) / (high - low)) * (to - from);
  return { at, ticks: ticksBetween(least, most) };
}

function short(value: number): string {
  return String(Number(value.toPrecision(2)));
}

function stroke(context: CanvasRenderingContext2D, x0: number, y0: number, x1: number, y1: number): void {
  context.beginPath();
  context.moveTo(x0, y0);
  context.lineTo(x1, y1);
  context.stroke();
}
