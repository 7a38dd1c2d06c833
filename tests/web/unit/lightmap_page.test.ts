import { decodeRgb9e5, encodeRgb9e5, scaleRgb9e5 } from '../../../client/web/src/protocol/rgb9e5';
import type { Tile } from '../../../client/web/src/protocol/tile_frame';
import { LightmapPage } from '../../../client/web/src/view/light/lightmap_page';
import { LightmapSet } from '../../../client/web/src/view/light/lightmap_set';
import { PageRescale } from '../../../client/web/src/view/light/page_rescale';

type Renderer = ConstructorParameters<typeof LightmapPage>[0];

/** A card that keeps what is uploaded, level by level, and throws where a page goes beyond a texture. */
class Card {
  readonly textures = new Set<CardTexture>();
  private bound: CardTexture | undefined;
  readonly state = {
    activeTexture: () => undefined,
    bindTexture: (_target: number, texture: CardTexture) => (this.bound = texture),
    pixelStorei: () => undefined,
  };

  createTexture(): CardTexture {
    const texture = { levels: [] };
    this.textures.add(texture);
    return texture;
  }
  deleteTexture(texture: CardTexture): void {
    this.textures.delete(texture);
  }
  texStorage2D(_target: number, levels: number, _format: number, width: number, height: number): void {
    this.bound!.levels = Array.from({ length: levels }, (_, m) => ({
      width: width >> m,
      texels: new Uint32Array((width >> m) * (height >> m)),
    }));
  }
  texParameteri(): void {}
  texSubImage2D(
    ...[, level, x, y, w, h, , , from]: [number, number, number, number, number, number, number, number, Uint32Array]
  ): void {
    // prettier-ignore
    const { width, texels } = this.bound!.levels[level]!;
    if (x + w > width || from.length !== w * h) throw new Error('outside of the texture');
    for (let row = 0; row < h; ++row) texels.set(from.subarray(row * w, (row + 1) * w), (y + row) * width + x);
  }

  get renderer(): Renderer {
    return { getContext: () => this, state: this.state } as unknown as Renderer;
  }
}

interface CardTexture {
  levels: { width: number; texels: Uint32Array }[];
}

function tile(x: number, y: number, value: number, exponent: number, mip = 0): Tile {
  const texels = new Uint32Array(64 * 64).fill(encodeRgb9e5(value, value / 2, value / 4));
  return { header: { mip, x, y, width: 64, height: 64 } as Tile['header'], texels, exponent };
}

const ALWAYS = Infinity;

it('stores rows anew in the order of the levels, each once', () => {
  const mips = [
    { width: 40, height: 30, texels: Uint32Array.from({ length: 1200 }, (_, i) => encodeRgb9e5(i, i / 3, 7)) },
    { width: 20, height: 15, texels: Uint32Array.from({ length: 300 }, (_, i) => encodeRgb9e5(1, i, i / 9)) },
  ];
  const expected = mips.map(({ texels }) => texels.map((texel) => scaleRgb9e5(texel, -8)));
  const rescale = new PageRescale(mips, -8, 7 * 40);
  expect(rescale.has(0, 0)).toBe(false);
  const slabs: number[][] = [];
  for (let slab = rescale.next(); slab; slab = rescale.next()) {
    slabs.push([slab.level, slab.row, slab.rows]);
    expect(rescale.has(slab.level, slab.row + slab.rows - 1)).toBe(true);
    if (slab.row + slab.rows < mips[slab.level]!.height)
      expect(rescale.has(slab.level, slab.row + slab.rows)).toBe(false);
  }
  expect(slabs).toEqual([
    [0, 0, 7], [0, 7, 7], [0, 14, 7], [0, 21, 7], [0, 28, 2],
    [1, 0, 14], [1, 14, 1],
  ]); // prettier-ignore
  expect(mips.map(({ texels }) => texels)).toEqual(expected);
});

it('grows its exponent some rows at a time, and is drawn and read as it was until then', () => {
  const card = new Card();
  // More than one slab of texels.
  const page = new LightmapPage(card.renderer, { width: 1024, height: 1024, mips: 11 }, 0);
  const first = tile(64, 128, 100, 0);
  expect(page.makeRoom(first, ALWAYS)).toBe(true);
  expect(page.put(first)).toBe(true);
  const old = [...card.textures][0]!;
  const [u, v] = [(64 + 32) / 1024, (128 + 32) / 1024];
  const before = page.sample(u, v)!;
  expect(before[0]).toBe(100);

  const bright = tile(0, 0, 59_904, 3);
  let calls = 1;
  for (; !page.makeRoom(bright, -1); ++calls) {
    expect(page.texture.sourceTexture).toBe(old);
    expect(page.scale).toBe(1);
    expect(page.sample(u, v)).toEqual(before);
  }
  expect(calls).toBeGreaterThan(4);
  expect(page.put(bright)).toBe(true);

  expect(page.scale).toBe(256);
  expect(page.sample(u, v)).toEqual(before);
  expect(page.sample(32 / 1024, 32 / 1024)![0]).toBe(59_904 * 8);
  // The new texture alone is left, and holds what the memory holds.
  expect([...card.textures]).toEqual([page.texture.sourceTexture]);
  const texel = [...card.textures][0]!.levels[0]!.texels[(128 + 32) * 1024 + 64 + 32]!;
  expect(decodeRgb9e5(texel)[0] * 256).toBe(100);
});

it('finishes what it had begun when the context comes back', () => {
  const card = new Card();
  const page = new LightmapPage(card.renderer, { width: 1024, height: 1024, mips: 11 }, 0);
  const first = tile(64, 128, 100, 0);
  page.makeRoom(first, ALWAYS);
  page.put(first);
  const bright = tile(0, 0, 59_904, 3);
  expect(page.makeRoom(bright, -1)).toBe(false);
  card.textures.clear(); // all are gone
  page.restore();
  expect(page.makeRoom(bright, -1)).toBe(true);
  expect(page.sample((64 + 32) / 1024, (128 + 32) / 1024)![0]).toBe(100);
  expect(card.textures.size).toBe(1);
  page.dispose();
  expect(card.textures.size).toBe(0);
});

describe('a set of pages', () => {
  const note = { layout: 1, revision: 1, quantity: 'irradiance', pages: [{ width: 64, height: 64, mips: 7 }], uvs: '' };
  const dark = tile(0, 0, 0, 0);
  const lit = tile(0, 0, 5, 0);

  it('takes black for no light yet, until some has come', () => {
    const set = new LightmapSet(new Card().renderer, note, 'irradiance', () => undefined);
    set.enqueue({ ...dark, header: { ...dark.header, page: 0, revision: 3 } }, 1);
    set.complete = true;
    expect(set.takeUp(ALWAYS)).toBe(1);
    expect([set.lit, set.covered, set.revision]).toEqual([false, false, 3]);
    set.showLight();
    expect(set.showsLight).toBe(false);
    set.enqueue({ ...lit, header: { ...lit.header, page: 0, revision: 2 } }, 1);
    set.takeUp(ALWAYS);
    expect([set.lit, set.covered, set.revision]).toEqual([true, true, 3]);
    expect(set.showsLight).toBe(false); // not before it is known how brightly
    set.showLight();
    expect(set.pages[0]!.uniforms.pageLightShown.value).toBe(true);
  });

  it('is whole when all of it shows light as finely as it is kept', () => {
    const wide = { ...note, pages: [{ width: 128, height: 128, mips: 8 }] };
    const set = new LightmapSet(new Card().renderer, wide, 'irradiance', () => undefined);
    const put = (x: number, y: number, mip: number) => {
      const { header, ...rest } = tile(x, y, 5, 0, mip);
      set.enqueue({ ...rest, header: { ...header, page: 0 } }, 1);
      set.takeUp(ALWAYS);
    };
    put(0, 0, 1);
    set.showLight();
    expect([set.covered, set.whole]).toEqual([true, false]);
    for (const [x, y] of [[0, 0], [0, 0], [64, 0], [0, 64]] as const) put(x, y, 0); // prettier-ignore
    expect(set.whole).toBe(false);
    put(64, 64, 0);
    expect(set.whole).toBe(true);
    put(0, 0, 1); // a coarser one that comes late takes nothing away
    expect(set.whole).toBe(true);
  });

  it('expects more until the server says that this is all, and that is taken up', () => {
    const set = new LightmapSet(new Card().renderer, note, 'irradiance', () => undefined);
    expect(set.expectsMore).toBe(false);
    set.enqueue({ ...lit, header: { ...lit.header, page: 0 } }, 1);
    set.close();
    expect([set.expectsMore, set.complete]).toEqual([true, true]);
    set.takeUp(ALWAYS);
    expect(set.expectsMore).toBe(false);
    set.enqueue({ ...lit, header: { ...lit.header, page: 0 } }, 1);
    set.takeUp(ALWAYS);
    expect(set.expectsMore).toBe(true);
  });

  it('takes black for black when the solve is over', () => {
    const set = new LightmapSet(new Card().renderer, note, 'irradiance', () => undefined);
    set.settle();
    set.complete = true;
    expect(set.covered).toBe(true);
  });

  it('takes up some tiles a frame though its time is over, so that slow frames need not be many', () => {
    const set = new LightmapSet(new Card().renderer, note, 'irradiance', () => undefined);
    for (let i = 0; i < 20; ++i) set.enqueue({ ...lit, header: { ...lit.header, page: 0 } }, 1);
    expect(set.takeUp(-1)).toBe(8);
    expect(set.waiting).toBe(12);
    expect(set.takeUp(ALWAYS)).toBe(12);
  });

  it('keeps tiles back while their page makes room', () => {
    const large = { ...note, pages: [{ width: 1024, height: 1024, mips: 11 }] };
    let used = 0;
    const set = new LightmapSet(new Card().renderer, large, 'irradiance', (bytes) => (used += bytes));
    for (const [i, each] of [lit, tile(0, 0, 59_904, 3), tile(64, 0, 7, 0)].entries())
      set.enqueue({ ...each, header: { ...each.header, page: 0 } }, 10 ** i);
    set.takeUp(-1);
    let frames = 1;
    for (; set.waiting > 0; ++frames) {
      expect(used % 10 ** (3 - set.waiting)).toBe(used); // in their order
      set.takeUp(-1);
    }
    expect(frames).toBeGreaterThan(4);
    expect(used).toBe(111);
    expect(set.pages[0]!.sample(100 / 1024, 32 / 1024)![0]).toBe(7);
    expect(set.pages[0]!.sample(32 / 1024, 32 / 1024)![0]).toBe(59_904 * 8);
  });
});

it('spans a factor of two at least, however alike all values are, and nothing where none is above nothing', () => {
  const note = { layout: 1, revision: 1, pages: [{ width: 64, height: 64, mips: 7 }], uvs: '' };
  const set = new LightmapSet(new Card().renderer, note, 'irradiance', () => undefined);
  expect(set.range()).toBeUndefined();
  const header = { page: 0, mip: 0, x: 0, y: 0, width: 64, height: 64, revision: 1, error: 0.01 };
  for (const value of [0, 100]) {
    set.enqueue({ ...tile(0, 0, value, 0), header: header as Tile['header'] }, 1);
    set.takeUp(ALWAYS);
  }
  const [low, high] = set.range()!;
  expect(high).toBeCloseTo(0.2126 * 100 + 0.7152 * 50 + 0.0722 * 25, -1);
  expect(high / low).toBeCloseTo(2, 10);
});
