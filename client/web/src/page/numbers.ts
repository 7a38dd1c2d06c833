// Numbers as people read and write them. Pure functions.

/** At least `digits` significant digits, with thousands set apart. Very small and large numbers get a power of ten. */
export function readable(value: number, digits = 3): string {
  if (!Number.isFinite(value)) return '–';
  if (value !== 0 && (Math.abs(value) < 1e-3 || Math.abs(value) >= 1e7)) return scientific(value, digits);
  return value.toLocaleString('en', {
    maximumSignificantDigits: Math.max(digits, 1 + Math.floor(Math.log10(Math.abs(value) || 1))),
  });
}

function scientific(value: number, digits: number): string {
  const [units, power] = value.toExponential(digits - 1).split('e');
  return `${units} × 10${superscript(Number(power))}`;
}

/** A measured number to three digits. Zeros at its end were measured, too, so they are written. */
export function measured(value: number): string {
  const text = readable(value);
  if (!/^-?[\d.]+$/.test(text)) return text; // no zeros are missing from large numbers and powers of ten
  return value.toLocaleString('en', { minimumSignificantDigits: 3, maximumSignificantDigits: 3 });
}

/** Most digits of a measured value, however small its error. */
const MOST_DIGITS = 5;

/** Place of the first digit; 0: units. It forgives rounding in the last bits, as in 999.9999999999999. */
function firstDigit(value: number): number {
  return value === 0 ? -Infinity : Number(value.toExponential(8).split('e')[1]);
}

/**
 * A measured value and its error, both to the second significant digit of the error; if either would be long, both are
 * multiples of the same power of ten. The caller writes " ± " between them, and the unit after them.
 */
export function withError(value: number, error: number): [string, string] {
  const roundedError = Number(Math.abs(error).toPrecision(2));
  const largest = Math.max(Math.abs(Number(value.toPrecision(MOST_DIGITS))), roundedError);
  if (!(largest > 0 && Number.isFinite(largest))) return [readable(value), readable(error)];
  const last = Math.max(firstDigit(roundedError), firstDigit(largest) + 2 - MOST_DIGITS) - 1;
  const v = Math.round(value / 10 ** last) + 0; // -0 would be written with its sign
  // An error below the last digit is written as one unit of that digit.
  const e = Math.max(roundedError > 0 ? 1 : 0, Math.round(roundedError / 10 ** last));
  // Of the rounded numbers, as rounding may have added a digit.
  const first = firstDigit(Math.max(Math.abs(v), e)) + last;
  const power = first < -3 || first >= 7 ? first : 0;
  const decimals = Math.max(0, power - last);
  const format = { minimumFractionDigits: decimals, maximumFractionDigits: decimals };
  const write = (units: number) => (units * 10 ** (last - power)).toLocaleString('en', format);
  return power === 0 ? [write(v), write(e)] : [`(${write(v)}`, `${write(e)}) × 10${superscript(power)}`];
}

function superscript(n: number): string {
  return [...String(n)].map((c) => (c === '-' ? '⁻' : '⁰¹²³⁴⁵⁶⁷⁸⁹'[Number(c)]!)).join('');
}

/**
 * The number that somebody wrote; NaN: it is none. A point or a comma begins the fraction, but commas between groups of
 * three digits, as readable() writes them, set thousands apart: "1,500" is 1500, while "1,5" and "0,125" are fractions.
 */
export function parseNumber(text: string): number {
  const plain = text.trim().replace(/\s+/g, '');
  if (/^[-+]?[1-9]\d{0,2}(,\d{3})+(\.\d*)?$/.test(plain)) return Number(plain.replaceAll(',', ''));
  if (!/^[-+]?(\d+[.,]?\d*|[.,]\d+)(e[-+]?\d+)?$/i.test(plain)) return NaN;
  const value = Number(plain.replace(',', '.'));
  return Number.isFinite(value) ? value : NaN; // no message could carry "1e999"
}

/** Three digits, as somebody would type them. */
export function inField(value: number): string {
  return String(Number(value.toPrecision(3)));
}

export function percent(fraction: number): string {
  return Number.isFinite(fraction) ? `${readable(100 * fraction, 2)} %` : '–';
}
