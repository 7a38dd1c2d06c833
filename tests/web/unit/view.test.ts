import { execFileSync } from 'node:child_process';
import { exposureOf } from '../../../client/web/src/view/exposure/exposure';
import { editCommand } from '../../../client/web/src/scenes/share';
import { encodeRgb9e5, scaleRgb9e5 } from '../../../client/web/src/protocol/rgb9e5';
import { pageExponent } from '../../../client/web/src/view/light/lightmap_page';
import { baseMipFor } from '../../../client/web/src/view/light/lightmap_set';
import { fromHex, toHex } from '../../../client/web/src/page/colours';
import { measured, parseNumber, percent, readable, withError } from '../../../client/web/src/page/numbers';
import type { Patch } from '../../../client/web/src/protocol/messages';

describe('automatic exposure', () => {
  it('brings an even picture to middle grey', () => {
    expect(exposureOf(new Array<number>(100).fill(2.5))).toBeCloseTo(0.18 / 2.5, 10);
  });

  it('does not look at lamps and dark outsides', () => {
    const room = Array.from({ length: 900 }, (_, i) => 1 + (i % 3));
    const mean = Math.exp(room.reduce((sum, v) => sum + Math.log(v), 0) / room.length);
    const picture = [...room, ...new Array<number>(5).fill(5000), ...new Array<number>(80).fill(1e-5), 0, NaN];
    expect(exposureOf(picture)).toBeCloseTo(0.18 / mean, 10);
  });

  it.each([
    ['a lamp close by of a twelfth of the picture', 0.08, 1800],
    ['a dark outside of four fifths', 0.8, 1e-3],
  ])('does not take for what one looks at %s', (_, part, times) => {
    const room = Array.from({ length: 1000 * (1 - part) }, () => 0.8);
    const other = Array.from({ length: 1000 * part }, () => 0.8 * times);
    expect(exposureOf([...room, ...other])).toBeCloseTo(0.18 / 0.8, 10);
  });

  it('is undefined where nothing is lit', () => {
    expect(exposureOf([0, 0])).toBeUndefined();
    expect(exposureOf([])).toBeUndefined();
  });
});

describe('memory', () => {
  const page = (side: number) => ({ width: side, height: side, mips: 13 });

  it('keeps one page of 4096 and 40 of 1024 whole', () => {
    expect(baseMipFor([page(4096)])).toBe(0);
    expect(baseMipFor(new Array(40).fill(page(1024)))).toBe(0);
  });

  it('asks for coarser mips where pages would not fit', () => {
    const base = baseMipFor(new Array(40).fill(page(4096)));
    expect(base).toBe(2);
    // 40 pages of 4096 x 4096 texels of 4 bytes, with mips, are 3.3 GiB; a sixteenth fits.
    expect((40 * 4096 ** 2 * 16) / 3 / 4 ** base).toBeLessThan(512 * 2 ** 20);
  });
});

it('a page grows its exponent in steps that hold what comes', () => {
  for (let exponent = -40; exponent <= 40; ++exponent) {
    const page = pageExponent(exponent);
    expect(page).toBeGreaterThanOrEqual(exponent);
    expect(page - exponent).toBeLessThan(8);
    // Nothing is lost of a texel that is 2^-21 of the brightest that a tile of this exponent may hold.
    const dim = encodeRgb9e5(2 ** -6, 2 ** -7, 0.75 * 2 ** -6);
    expect(scaleRgb9e5(scaleRgb9e5(dim, exponent - page), page - exponent)).toBe(dim);
  }
  expect(pageExponent(0)).toBe(0);
});

it('colours keep their bytes through hexadecimal', () => {
  for (const hex of ['#000000', '#ffffff', '#123456', '#0a0b0c', '#fe8001']) expect(toHex(fromHex(hex))).toBe(hex);
});

it('numbers are readable', () => {
  expect([1234567, 1234.5, 0.01234, 0, 1e-7, NaN].map((v) => readable(v))).toEqual([
    '1,234,567',
    '1,235',
    '0.0123',
    '0',
    '1.00 × 10⁻⁷',
    '–',
  ]);
  expect(percent(0.0183)).toBe('1.8 %');
});

it('what was measured keeps the zeros at its end', () => {
  expect([0.8, 0.191, 12, 0.37, -5, 100, 1234.5, 2e-7, 0, NaN].map(measured)).toEqual([
    '0.800',
    '0.191',
    '12.0',
    '0.370',
    '-5.00',
    '100',
    '1,235',
    '2.00 × 10⁻⁷',
    '0.00',
    '–',
  ]);
});

describe('a value and its error', () => {
  it.each([
    ['to the second digit of the error', 123.456, 1.234, '123.5 ± 1.2'],
    ['though that rounds up to a digit more', 9.996, 0.0996, '10.00 ± 0.10'],
    ['with thousands set apart', 1_234_567, 12_345, '1,235,000 ± 12,000'],
    ['of nothing, which is as sure as its error', 0, 0.034, '0.000 ± 0.034'],
    ['of nothing that is sure', 0, 0, '0 ± 0'],
    ['that is sure', 12.3456, 0, '12.346 ± 0.000'],
    ['that is less than its error', 0.5, 32, '1 ± 32'],
    ['that is nothing beside its error, and below zero', -0.01, 3.2, '0.0 ± 3.2'],
    ['with five digits at most, the error no less than one of the last', 123_456, 0.0012, '123,460 ± 10'],
    ['in powers of ten where it is small', 1.23e-7, 3e-9, '(1.230 ± 0.030) × 10⁻⁷'],
    ['in powers of ten where both are small', 0, 3e-9, '(0.0 ± 3.0) × 10⁻⁹'],
    ['in powers of ten where it is large', 5e8, 1.2e6, '(5.000 ± 0.012) × 10⁸'],
    ['without a power of ten where rounding makes it large enough', 0.00099999, 1e-5, '0.001000 ± 0.000010'],
    ['in the power of ten that rounding makes of it', 0.000099999, 1e-6, '(1.000 ± 0.010) × 10⁻⁴'],
    ['in powers of ten where rounding makes it large', 9_999_990, 1e3, '(1.0000 ± 0.0001) × 10⁷'],
    ['with five digits though rounding would make six', 99_999.7, 0.1, '100,000 ± 10'],
    ['whose error has a sign', 1, -0.5, '1.00 ± 0.50'],
    ['that is not known', NaN, 1, '– ± 1'],
    ['whose error is not known', 1, Infinity, '1 ± –'],
  ])('is written %s', (_, value, error, text) => {
    expect(withError(value, error).join(' ± ')).toBe(text);
  });
});

it('the command survives a shell', () => {
  const patch = [
    {
      op: 'replace' as const,
      path: "/nodes/@Ann's lamp/translation",
      value: [0, 1, 0],
    },
  ];
  expect(editCommand(patch, 'host:1')).toBe(
    `printf %s '[{"op":"replace","path":"/nodes/@Ann'\\''s lamp/translation","value":[0,1,0]}]' | radiosity edit host:1 -`,
  );
  expect(editCommand([], 'https://host', true)).toBe(
    `printf %s '[]' | radiosity edit https://host - --token-file token`,
  );
  const named: Patch = [{ op: 'replace', path: '/nodes/0/name', value: 'C:\\new\n"100 %"' }];
  const told = execFileSync('sh', ['-c', editCommand(named, 'host').replace(/ \| radiosity .*/s, '')]);
  expect(JSON.parse(told.toString())).toEqual(named);
});

describe('a number that somebody wrote', () => {
  it('has a point or a comma before its fraction', () => {
    for (const [text, value] of [
      ['1.5', 1.5],
      ['1,5', 1.5],
      [' -0,125 ', -0.125],
      ['.5', 0.5],
      [',5', 0.5],
      ['2e-3', 0.002],
      ['12,3456', 12.3456],
    ] as const)
      expect(parseNumber(text), text).toBe(value);
  });

  it('may set thousands apart, as what is shown does', () => {
    for (const value of [1500, 12_345, 1_234_567, 0.002, 33.25])
      expect(parseNumber(readable(value, 7)), readable(value, 7)).toBe(value);
    expect(parseNumber('1,234.5')).toBe(1234.5);
    expect(parseNumber('15 000 000')).toBe(15_000_000);
  });

  it('is none where there is anything else', () => {
    for (const text of ['', ' ', 'abc', '1.5.2', '1,5,2', '2 m', '1,234,5', 'NaN', 'Infinity', '1e999', '0x10', '--1'])
      expect(parseNumber(text), text).toBeNaN();
  });
});
