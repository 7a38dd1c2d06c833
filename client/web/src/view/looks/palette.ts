// The colours of false-colour pictures, for the shader and for the legend.

/**
 * sRGB, from dark to bright: nine colours of viridis (Smith and van der Walt, matplotlib 1.5, 2015; CC0). Its lightness
 * rises evenly, so that more looks brighter also in print and to people who see no hues.
 */
export const STOPS: readonly (readonly [number, number, number])[] = [
  [68, 1, 84],
  [71, 45, 123],
  [59, 82, 139],
  [44, 114, 142],
  [33, 145, 140],
  [40, 174, 128],
  [94, 201, 98],
  [173, 220, 48],
  [253, 231, 37],
].map(([r, g, b]) => [r! / 255, g! / 255, b! / 255] as const);

/** The colour where there is nothing to measure: darker than the lowest value. */
export const NOTHING = STOPS[0]!.map((c) => 0.5 * c);

/** sRGB, for mip 0, 1, ... A lookup between two mips gets a colour between theirs. */
export const MIP_STOPS: readonly (readonly [number, number, number])[] = [
  [0.16, 0.55, 0.9],
  [0.1, 0.68, 0.56],
  [0.42, 0.74, 0.25],
  [0.93, 0.75, 0.2],
  [0.93, 0.46, 0.16],
  [0.8, 0.2, 0.3],
];

/** sRGB, for 0 to 1, as the shader has it. */
export function paletteColour(t: number): [number, number, number] {
  const at = Math.min(Math.max(t, 0), 1) * (STOPS.length - 1);
  const low = Math.min(Math.floor(at), STOPS.length - 2);
  const [a, b] = [STOPS[low]!, STOPS[low + 1]!];
  const mix = (c: 0 | 1 | 2) => a[c] + (at - low) * (b[c] - a[c]);
  return [mix(0), mix(1), mix(2)];
}

/** As a GLSL array of vec3. */
export function glslList(stops: typeof STOPS): string {
  const list = stops.map((stop) => `vec3(${stop.map((c) => c.toFixed(3)).join(', ')})`).join(', ');
  return `vec3[${stops.length}](${list})`;
}

export function paletteGlsl(): string {
  return `
const vec3 kStops[${STOPS.length}] = ${glslList(STOPS)};
vec3 paletteColour(float t) {
  float at = clamp(t, 0.0, 1.0) * ${(STOPS.length - 1).toFixed(1)};
  int low = int(min(floor(at), ${(STOPS.length - 2).toFixed(1)}));
  return mix(kStops[low], kStops[low + 1], at - float(low));
}`;
}

export function paletteCss(direction: string, stops = STOPS): string {
  const colours = stops.map((stop) => `rgb(${stop.map((c) => Math.round(255 * c)).join(' ')})`);
  return `linear-gradient(${direction}, ${colours.join(', ')})`;
}
