import { median, quantile, spread, table } from '../benchmark/figures';
import { CONVERGED, DRAWN, FIRST_TILE, mainThread, TURNED, TURNING } from '../benchmark/trace';

it('takes medians of even and odd counts, and quantiles', () => {
  expect(median([3, 1, 2])).toBe(2);
  expect(median([4, 1, 2, 3])).toBe(2.5);
  expect(median([])).toBeNaN();
  expect(quantile([5, 1, 4, 2, 3], 0.95)).toBe(5);
  expect(spread([12.34, 1, 100])).toBe('12 (100)');
  expect(table(['a', 'b'], [['x', '1']])).toBe('| a | b |\n| --- | ---: |\n| x | 1 |');
});

it('finds the tasks of the thread that set the marks', () => {
  const mark = (name: string, ts: number) => ({ name, cat: 'blink.user_timing', ph: 'R', pid: 7, tid: 1, ts });
  const task = (tid: number, ts: number, dur: number, tdur: number) => ({
    name: 'ThreadControllerImpl::RunTask',
    cat: 'toplevel',
    ph: 'X',
    pid: 7,
    tid,
    ts,
    dur,
    tdur,
  });
  const events = [
    task(1, 0, 9000, 4000),
    task(2, 0, 99000, 99000), // another thread's
    task(1, 10_000, 5000, 3000), // the first tile comes in the middle of it
    mark(FIRST_TILE, 12_000),
    task(1, 20_000, 70_000, 2000),
    mark(CONVERGED, 95_000),
    task(1, 96_000, 5000, 5000),
  ];
  expect(mainThread(events)).toMatchObject({ before: [4], withTiles: [3, 2] });
  expect(() => mainThread(events.slice(0, 3))).toThrow('no marks');
});

it('finds the scripts of frames that drew, by what was going on', () => {
  const at = (name: string, ts: number) => ({ name, cat: 'blink.user_timing', ph: 'R', pid: 7, tid: 1, ts });
  const frame = (ts: number, tdur: number, tid = 1) => ({
    ...at('FireAnimationFrame', ts),
    cat: 'devtools.timeline',
    ph: 'X',
    tid,
    dur: 900,
    tdur,
  });
  const events = [
    frame(0, 100), // before all tiles
    at(DRAWN, 50),
    at(FIRST_TILE, 1000),
    frame(2000, 500),
    at(DRAWN, 2100),
    frame(3000, 5), // draws nothing
    frame(2000, 700, 2), // another thread's
    at(CONVERGED, 5000),
    at(TURNING, 6000),
    frame(6100, 800),
    at(DRAWN, 6900),
    at(TURNED, 8000),
  ];
  expect(mainThread(events)).toMatchObject({ framesWithTiles: [0.5], framesOfTurning: [0.8] });
});
