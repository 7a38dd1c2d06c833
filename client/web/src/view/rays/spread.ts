/**
 * The i-th of a sequence of points in the picture, i > 0, in normalised device coordinates. Any number of its points is
 * evenly spread (the R2 sequence of Martin Roberts, 2018).
 */
export function spreadPoint(i: number): [number, number] {
  return [2 * ((i * 0.7548776662466927) % 1) - 1, 2 * ((i * 0.5698402909980532) % 1) - 1];
}
