// Error against time, both logarithmic, as the solve goes on.

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
    // A canvas does not take up the page's new colours by itself.
    new MutationObserver(() => this.draw()).observe(document.documentElement, { attributeFilter: ['data-theme'] });
    matchMedia('(prefers-color-scheme: light)').addEventListener('change', () => this.draw());
  }

  /** To be drawn with the next draw(). */
  add(progress: Progress): void {
    const last = this.samples.at(-1);
    // Solve time runs backwards when an edit or another scene begins a new solve.
    if (last && progress.seconds < last.seconds) this.samples = [];
    if (!(progress.seconds > 0) || progress.seconds === last?.seconds) return;
    this.samples.push({ seconds: progress.seconds, ...progress.error });
    // Samples lie evenly in time, the plot is logarithmic: every second one is enough where there are many.
    if (this.samples.length > MOST) this.samples = this.samples.filter((_, i) => i % 2 === 0 || i > MOST - 50);
  }

  /** Of the same solve, what came before the page did and while it was away. To be drawn with the next draw(). */
  addHistory(history: readonly Sample[]): void {
    this.samples = withHistory(this.samples, history);
  }

  /** What is drawn, by ascending time. */
  get drawn(): readonly Sample[] {
    return this.samples;
  }

  /** To be drawn with the next draw(). */
  setTarget(target: number): void {
    this.target = target;
  }

  draw(): void {
    const { clientWidth, clientHeight } = this.element;
    // Letters and margins are those of a page of 14 pixels, and grow with it.
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
    // A solve that is done before it was first told of has one sample, which makes no line.
    const last = this.samples.at(-1);
    if (!last || !(last[key] > 0)) return;
    context.beginPath();
    context.fillStyle = colour;
    context.arc(x.at(last.seconds), y.at(last[key]), key === 'total' ? 3 : 2, 0, 2 * Math.PI);
    context.fill();
  }
}

/** As far as a server's samples reach they stand in the place of the page's own, which may have gaps. */
export function withHistory(own: readonly Sample[], history: readonly Sample[]): Sample[] {
  const [first, last] = [history[0], history.at(-1)];
  if (!first || !last) return [...own];
  const before = own.filter(({ seconds }) => seconds < first.seconds);
  return [...before, ...history, ...own.filter(({ seconds }) => seconds > last.seconds)];
}

/** What the scale has to hold: all that the legend names, down to where a part is nothing beside the total. */
export function errorsShown(samples: readonly Sample[]): number[] {
  const parts = samples.flatMap(({ sampling, residual }) => [sampling, residual]);
  return [...samples.map(({ total }) => total), ...parts.filter((part) => part > 1e-4)];
}

/** The middle of a text, so moved that the canvas does not cut it off at its left or right. */
export function within(middle: number, textWidth: number, width: number): number {
  return Math.max(textWidth / 2, Math.min(middle, width - textWidth / 2));
}

interface LogScale {
  at(value: number): number;
  ticks: number[];
}

/** Powers of ten alone; finer ones where those are too few to read a logarithmic scale by. */
const STEPS = [[1], [1, 2, 5], [1, 2, 3, 5, 7], [1, 1.5, 2, 3, 4, 5, 7]];
const FEWEST_TICKS = 3;
/** Texts of ticks have room beside each other, as a part of the scale. */
const LEAST_GAP = 0.15;

/** Of a logarithmic scale. */
export function ticksBetween(low: number, high: number): number[] {
  let ticks: number[] = [];
  // Where one after the other there is no room for powers of ten, every second or third of them.
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

/** Holds all values and `atLeast`, with a little room beyond. */
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
