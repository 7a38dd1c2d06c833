import { errorsShown, ticksBetween, withHistory, within } from '../../../client/web/src/ui/error_plot';
import { briefly } from '../../../client/web/src/ui/scene_panel';
import { besidePointer, scaleLabels } from '../../../client/web/src/ui/legend';

describe('the legend of false colours', () => {
  it('says of its ends that what lies beyond has their colour', () => {
    expect(scaleLabels(0.1, 1000)).toEqual(['≤ 0.1', '1', '10', '100', '≥ 1,000']);
  });

  it('writes small values as the light meter does, fewer of them, as they are long', () => {
    expect(scaleLabels(3.4e-6, 3.4e-4)).toEqual(['≤ 3.4 × 10⁻⁶', '3.4 × 10⁻⁵', '≥ 3.4 × 10⁻⁴']);
  });
});

describe('the plot of error against time', () => {
  it('has room for every line that it names, the smallest too', () => {
    const sample = { seconds: 95, total: 0.02, residual: 0.013, sampling: 0.015 };
    expect(Math.min(...errorsShown([sample]))).toBe(0.013);
    expect(Math.max(...errorsShown([sample]))).toBe(0.02);
  });

  it('puts what the server remembers in the place of its own, and keeps what lies before and after', () => {
    const at = (seconds: number, total: number) => ({ seconds, total, residual: 0, sampling: total });
    const own = [at(1, 0.9), at(2, 0.8), at(3, 0.7), at(9, 0.1)];
    const history = [at(2, 0.5), at(2.5, 0.4), at(4, 0.3)];
    const times = (samples: { seconds: number }[]) => samples.map(({ seconds }) => seconds);
    expect(times(withHistory(own, history))).toEqual([1, 2, 2.5, 4, 9]);
    expect(withHistory(own, history)[1]!.total).toBe(0.5);
    expect(withHistory([at(4, 0.3)], history)).toEqual(history); // a page that came when all was done
    expect(withHistory(own, [])).toEqual(own);
    expect(withHistory([], history)).toEqual(history);
  });

  it('is not stretched by a part that is nothing beside the total', () => {
    expect(errorsShown([{ seconds: 1, total: 0.02, residual: 1e-9, sampling: 0 }])).toEqual([0.02]);
  });

  it('has ticks enough to be read by, however little it spans, and no more than there is room for', () => {
    const near = (low: number, high: number) => ticksBetween(low, high).map((tick) => Number(tick.toPrecision(3)));
    expect(near(0.0009, 1.1)).toEqual([0.001, 0.01, 0.1, 1]);
    expect(near(0.018, 1.1)).toEqual([0.02, 0.05, 0.1, 0.2, 0.5, 1]);
    expect(near(0.0108, 0.034)).toEqual([0.015, 0.02, 0.03]);
    expect(near(0.0095, 0.034)).toEqual([0.01, 0.02, 0.03]);
    expect(near(0.9, 1.98)).toEqual([1, 1.5]);
    expect(near(0.9e-6, 1.1e6)).toEqual([1e-6, 1e-4, 0.01, 1, 100, 1e4, 1e6]);
    for (let low = 1e-3; low < 10; low *= 1.13)
      for (let span = 2.2; span < 1e20; span *= 1.1) {
        const ticks = ticksBetween(low, low * span);
        expect(ticks.length, `${low} to ${low * span}`).toBeGreaterThan(1);
        const gaps = ticks.slice(1).map((tick, i) => Math.log(tick / ticks[i]!) / Math.log(span));
        expect(Math.min(...gaps), `${low} to ${low * span}`).toBeGreaterThan(0.149);
      }
  });

  it('keeps the texts of its ticks whole', () => {
    expect(within(266, 30, 274)).toBe(259);
    expect(within(4, 30, 274)).toBe(15);
    expect(within(100, 30, 274)).toBe(100);
  });
});

it('numbers of a place are brief, and none of them nothing but what rounding leaves', () => {
  const given = [0.36833, -0.000662, 0.0596, -50.8237, 38.3579, 1, 0, 1e-15, 123.456, -1234.567, 9.99999, 2e-8];
  expect(given.map(briefly)).toEqual(
    ['0.3683', '-6.6e-4', '0.0596', '-50.82', '38.36', '1', '0', '0', '123.46', '-1234.57', '10', '2.0e-8'], // prettier-ignore
  );
});

describe('the card of the light meter', () => {
  const [card, page] = [
    { width: 200, height: 90 },
    { width: 360, height: 740 },
  ];
  const legend = { x: 10, y: 611, width: 266, height: 70 };
  const at = (x: number, y: number, other?: typeof legend) => Object.values(besidePointer({ x, y }, card, page, other));

  it('is below the pointer to its right, where there is room', () => {
    expect(at(50, 100)).toEqual([68, 118]);
    expect(at(300, 100)).toEqual([152, 118]);
    expect(at(50, 700)).toEqual([68, 596]);
  });

  it('keeps off the legend', () => {
    expect(at(50, 100, legend)).toEqual([68, 118]);
    for (const y of [500, 550, 600, 650, 680, 720]) expect(at(50, y, legend)[1]! + card.height).toBeLessThan(612);
  });
});
