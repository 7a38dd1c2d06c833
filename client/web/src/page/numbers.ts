// Numbers as people read and write them. Pure functions.

/** Number with `digits` significant digits and thousands set apart; what is very small or large as a multiple of a power of ten. */
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

/** The same for what was measured: a zero at its end was measured, too. */
export function measured(value: number): string {
  const text = readable(value);
  if (!/^-?[\d.]+$/.test(text)) return text; // without a fraction, or as a power of ten: nothing was left out
  return value.toLocaleString('en', { minimumSignificantDigits: 3, maximumSignificantDigits: 3 });
}

/** Digits of a measured value at most, however small its error. */
const MOST_DIGITS = 5;

/** Place of the first digit: 0 is that of units. What rounding took from 1000 in the last bits is not missed. */
function firstDigit(value: number): number {
  return value === 0 ? -Infinity : Number(value.toExponential(8).split('e')[1]);
}

/**
 * A measured value and its error, one written as the other: to the second significant digit of the error, and where
 * either would be long, as multiples of the same power of ten. Between them belongs " ± ", after them the unit.
 */
export function withError(value: number, error: number): [string, string] {
  const roundedError = Number(Math.abs(error).toPrecision(2));
  const largest = Math.max(Math.abs(Number(value.toPrecision(MOST_DIGITS))), roundedError);
  if (!(largest > 0 && Number.isFinite(largest))) return [readable(value), readable(error)];
  const last = Math.max(firstDigit(roundedError), firstDigit(largest) + 2 - MOST_DIGITS) - 1;
  const v = Math.round(value / 10 ** last) + 0; // -0 would be written with its sign
  // An error that is less than the last digit is no more than one of it.
  const e = Math.max(roundedError > 0 ? 1 : 0, Math.round(roundedError / 10 ** last));
  // Of what is written: a value may have got a digit more when it was rounded.
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
 * The number that somebody wrote, with a point or a comma before its fraction; NaN: none. Commas between groups of three
 * digits, as readable() writes them, set thousands apart: "1,500" is 1500, "1,5" and "0,125" are fractions.
 */
export function parseNumber(text: string): number {
  const plain = text.trim().replace(/\s+/g, '');
  if (/^[-+]?[1-9]\d{0,2}(,\d{3})+(\.\d*)?$/.test(plain)) return Number(plain.replaceAll(',', ''));
  if (!/^[-+]?(\d+[.,]?\d*|[.,]\d+)(e[-+]?\d+)?$/i.test(plain)) return NaN;
  const value = Number(plain.replace(',', '.'));
  return Number.isFinite(value) ? value : NaN; // "1e999" is none that a message could carry
}

/** Three digits of a number as somebody would write it. */
export function inField(value: number): string {
  return String(Number(value.toPrecision(3)));
}

export function percent(fraction: number): string {
  return Number.isFinite(fraction) ? `${readable(100 * fraction, 2)} %` : '–';
}
