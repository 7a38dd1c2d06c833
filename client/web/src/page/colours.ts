// Linear colours: how bright they are, and how the page writes them. Pure functions.

export function luminance([r, g, b]: readonly [number, number, number]): number {
  return 0.2126 * r + 0.7152 * g + 0.0722 * b;
}

/** Linear RGB to "#rrggbb". Values above 1 are cut off: callers keep the strength of light apart from its colour. */
export function toHex(rgb: readonly number[]): string {
  const byte = (v: number) => {
    const c = Math.min(1, Math.max(0, v));
    const s = c <= 0.0031308 ? 12.92 * c : 1.055 * c ** (1 / 2.4) - 0.055;
    return Math.round(255 * s)
      .toString(16)
      .padStart(2, '0');
  };
  return `#${rgb.slice(0, 3).map(byte).join('')}`;
}

export function fromHex(hex: string): [number, number, number] {
  const channel = (at: number) => {
    const s = parseInt(hex.slice(at, at + 2), 16) / 255;
    const c = s <= 0.04045 ? s / 12.92 : ((s + 0.055) / 1.055) ** 2.4;
    return Number(c.toPrecision(6));
  };
  return [channel(1), channel(3), channel(5)];
}
