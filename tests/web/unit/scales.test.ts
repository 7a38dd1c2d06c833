import { errorsShown, within } from '../../../client/web/src/ui/error_plot';
import { scaleLabels } from '../../../client/web/src/ui/legend';

describe('the legend of false colours', () => {
  it('says of its ends that what lies beyond has their colour', () => {
    expect(scaleLabels(0.1, 1000)).toEqual(['≤ 0.1', '1', '10', '100', '≥ 1,000']);
  });
});

describe('the plot of error against time', () => {
  it('has room for every line that it names, the smallest too', () => {
    const sample = { seconds: 95, total: 0.02, residual: 0.013, sampling: 0.015 };
    expect(Math.min(...errorsShown([sample]))).toBe(0.013);
    expect(Math.max(...errorsShown([sample]))).toBe(0.02);
  });

  it('is not stretched by a part that is nothing beside the total', () => {
    expect(errorsShown([{ seconds: 1, total: 0.02, residual: 1e-9, sampling: 0 }])).toEqual([0.02]);
  });

  it('keeps the texts of its ticks whole', () => {
    expect(within(266, 30, 274)).toBe(259);
    expect(within(4, 30, 274)).toBe(15);
    expect(within(100, 30, 274)).toBe(100);
  });
});
