// The colours of false-colour pictures: one list for the shader and for the legend.

/** sRGB, from dark to bright; dark and bright ends differ in lightness too, for those who see no hues. */
export const STOPS: readonly (readonly [number, number, number])[] = [
  [0.07, 0.05, 0.2],
  [0.17, 0.2, 0.62],
  [0.06, 0.47, 0.75],
  [0.06, 0.66, 0.55],
  [0.47, 0.78, 0.25],
  [0.95, 0.8, 0.2],
  [0.95, 0.5, 0.16],
  [0.85, 0.2, 0.2],
  [1.0, 0.9, 0.86],
];

/** sRGB, of mip 0, 1, ...; between them where a lookup lies between two mips. */
export const MIP_STOPS: readonly (readonly [number, number, number])[] = [
  [0.16, 0.55, 0.9],
  [0.1, 0.68, 0.56],
  [0.42, 0.74, 0.25],
  [0.93, 0.75, 0.2],
  [0.93, 0.46, 0.16],
  [0.8, 0.2, 0.3],
];

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
