import { Spaced } from '../../../client/web/src/page/spaced';

beforeEach(() => void vi.useFakeTimers());
afterEach(() => void vi.useRealTimers());

it('shows what comes in quick succession once, and what goes on four times a second', () => {
  let newest = 0;
  const shown: [number, number][] = [];
  const begin = performance.now();
  const spaced = new Spaced(() => shown.push([performance.now() - begin, newest]));
  for (; newest < 5; ++newest) {
    spaced.soon();
    vi.advanceTimersByTime(10);
  }
  vi.advanceTimersByTime(1000);
  expect(shown).toEqual([[100, 5]]);
  shown.length = 0;
  for (; newest < 105; ++newest) {
    spaced.soon();
    vi.advanceTimersByTime(10);
  }
  vi.advanceTimersByTime(1000);
  expect(shown.length).toBeGreaterThanOrEqual(4);
  expect(shown.length).toBeLessThanOrEqual(5);
  expect(shown.at(-1)![1]).toBe(105); // the last is never left out
});

it('shows at once what cannot wait, and not once more what waited', () => {
  let count = 0;
  const spaced = new Spaced(() => ++count);
  spaced.soon();
  spaced.now();
  expect(count).toBe(1);
  vi.advanceTimersByTime(1000);
  expect(count).toBe(1);
});
