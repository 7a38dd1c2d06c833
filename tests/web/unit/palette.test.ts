import { readFileSync } from 'node:fs';
import { NOTHING, paletteGlsl, STOPS } from '../../../client/web/src/view/looks/palette';

/** CIE 1976 L* of an sRGB colour, D65. */
function lightness(rgb: readonly number[]): number {
  const [r, g, b] = rgb.map((c) => (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4));
  const y = 0.2126 * r! + 0.7152 * g! + 0.0722 * b!;
  return y > 216 / 24389 ? 116 * Math.cbrt(y) - 16 : (24389 / 27) * y;
}

/** As the shader and the legend mix them. */
function colour(t: number): number[] {
  const at = t * (STOPS.length - 1);
  const low = Math.min(Math.floor(at), STOPS.length - 2);
  return STOPS[low]!.map((c, i) => c + (STOPS[low + 1]![i]! - c) * (at - low));
}

describe('the palette of false colours', () => {
  it('gets lighter all the way, as evenly as eyes see it', () => {
    const steps = 256;
    const all = Array.from({ length: steps + 1 }, (_, i) => lightness(colour(i / steps)));
    const rises = all.slice(1).map((l, i) => l - all[i]!);
    const mean = (all.at(-1)! - all[0]!) / steps;
    expect(all[0]).toBeLessThan(20);
    expect(all.at(-1)).toBeGreaterThan(85);
    // Between two of its nine colours a mix of sRGB is a little off the even way.
    expect(Math.min(...rises) / mean).toBeGreaterThan(0.6);
    expect(Math.max(...rises) / mean).toBeLessThan(1.4);
  });

  it('shows nothing darker than the least', () => {
    expect(lightness(NOTHING)).toBeLessThan(lightness(STOPS[0]!) - 5);
  });

  it('is the same in pictures of the server', () => {
    const shader = readFileSync(new URL('../../../server/gpu/shaders/view.frag', import.meta.url), 'utf8');
    const list = /kStops\[9\] = vec3\[\]\((.*?)\);/s.exec(shader)![1]!;
    const theirs = [...list.matchAll(/vec3\(([^)]*)\)/g)].map(([, stop]) => stop!.split(',').map(Number));
    expect(theirs).toEqual(STOPS.map((stop) => stop.map((c) => Math.round(255 * c))));
  });

  it('is the same in the shader', () => {
    expect(paletteGlsl()).toContain(`kStops[${STOPS.length}]`);
    for (const stop of STOPS) expect(paletteGlsl()).toContain(`vec3(${stop.map((c) => c.toFixed(3)).join(', ')})`);
  });
});
