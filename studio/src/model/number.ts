// Reads numbers that a user types. An invalid number gives an error text; it is never replaced by another number.

export interface Limits {
  minimum?: number | undefined;
  maximum?: number | undefined;
  above?: number | undefined; // the number must be greater
}

export type Typed = { value: number } | { problem: string };

const shape = /^[+-]?(\d+([.,]\d*)?|[.,]\d+)(e[+-]?\d+)?$/i;
// For example 1,500: in English one thousand five hundred, in German one and a half.
const ambiguous = /^[+-]?[1-9]\d{0,2},\d{3}$/;

const hexadecimal = /^(?:0x)?([0-9a-f]+)h?$/i;

export function readNumber(text: string, limits: Limits = {}, isHexadecimal = false): Typed {
  const plain = text.trim().replace('\u2212', '-');
  if (plain === '') return { problem: 'Enter a number.' };
  if (isHexadecimal) {
    const digits = hexadecimal.exec(plain)?.[1];
    if (digits === undefined) return { problem: 'Not a hexadecimal number: enter for example 181h.' };
    return within(parseInt(digits, 16), limits, true);
  }
  if (ambiguous.test(plain)) {
    return { problem: `${plain} is ambiguous: enter ${plain.replace(',', '')} or ${String(Number(plain.replace(',', '.')))}.` };
  }
  if (!shape.test(plain)) return { problem: 'Not a number: enter for example 12 or 0.5.' };
  const value = Number(plain.replace(',', '.'));
  if (!Number.isFinite(value)) return { problem: 'This number is too large.' };
  return within(value, limits, false);
}

function within(value: number, { minimum, maximum, above }: Limits, isHexadecimal: boolean): Typed {
  const isLow = (minimum !== undefined && value < minimum) || (above !== undefined && !(value > above));
  if (!isLow && !(maximum !== undefined && value > maximum)) return { value };
  const show = (limit: number) => showNumber(limit, isHexadecimal);
  if (minimum !== undefined && maximum !== undefined) return { problem: `From ${show(minimum)} to ${show(maximum)}.` };
  const least = above !== undefined ? `more than ${show(above)}` : minimum !== undefined ? `at least ${show(minimum)}` : '';
  const most = maximum !== undefined ? `at most ${show(maximum)}` : '';
  const range = [least, most].filter(Boolean).join(', ');
  return { problem: `${range[0].toUpperCase()}${range.slice(1)}.` };
}

// The text of a number in a field. Empty for NaN and infinity.
export function showNumber(value: number, isHexadecimal = false): string {
  if (!Number.isFinite(value)) return '';
  if (isHexadecimal) return `${value.toString(16).toUpperCase()}h`;
  if (Math.abs(value) >= 1e15 || (value !== 0 && Math.abs(value) < 1e-6)) return String(value);
  return value.toLocaleString('en', { maximumFractionDigits: 6, useGrouping: false });
}
