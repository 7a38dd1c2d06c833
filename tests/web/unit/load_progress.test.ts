import type { Progress } from '../../../client/web/src/protocol/messages';
import { barValue, stateText } from '../../../client/web/src/ui/solve_panel';

function progress(of: Partial<Progress>): Progress {
  const error = { total: 1, texels: 1, residual: 1, sampling: 0, discretization: 0 };
  return { state: 'solving', error, ...of } as Progress;
}

it('says how much of a load is done', () => {
  expect(stateText({ state: 'loading', fraction: 0.426 })).toBe('Loading, 43 %');
  expect(stateText({ state: 'loading', fraction: 0 })).toBe('Loading, 0 %');
  expect(stateText({ state: 'loading' }), 'a server that does not tell').toBe('Loading');
  expect(stateText({ state: 'solving', fraction: 0.5 })).toBe('Solving');
});

it('fills the bar with the load, whatever the error of the scene before', () => {
  const stated = { total: 0.02, texels: 0.02, residual: 0.02, sampling: 0, discretization: 0 };
  expect(barValue(progress({ state: 'loading', fraction: 0.25, error: stated }), stated.total, 1, 0.02)).toBe(0.25);
  expect(barValue(progress({ state: 'loading', error: stated }), stated.total, 1, 0.02)).toBe(0);
});

it('fills the bar with the way to the target error once the scene is there', () => {
  const error = { total: 0.1, texels: 0.1, residual: 0.1, sampling: 0, discretization: 0 };
  expect(barValue(progress({ error }), error.total, 1, 0.01)).toBeCloseTo(0.5, 10);
  expect(barValue(progress({ state: 'converged', error }), error.total, 1, 0.01)).toBe(1);
  expect(barValue(progress({ error }), 0, 1, 0.01)).toBe(0);
});
