// Numbers as people type them. What is not understood is said, never replaced.

export interface Limits {
  minimum?: number | undefined;
  maximum?: number | undefined;
}

export type Typed = { value: number } | { problem: string };

const shape = /^[+-]?(\d+([.,]\d*)?|[.,]\d+)(e[+-]?\d+)?$/i;
// In English a thousand and a half, in German one and a half.
const ambiguous = /^[+-]?[1-9]\d{0,2},\d{3}$/;

export function readNumber(text: string, { minimum, maximum }: Limits = {}): Typed {
  const plain = text.trim().replace('\u2212', '-');
  if (plain === '') return { problem: 'Give a number.' };
  if (ambiguous.test(plain)) {
    return { problem: `${plain} may be ${plain.replace(',', '')} or ${String(Number(plain.replace(',', '.')))}: write one of them.` };
  }
  if (!shape.test(plain)) return { problem: 'This is no number: write it as 12 or 0.5.' };
  const value = Number(plain.replace(',', '.'));
  if (!Number.isFinite(value)) return { problem: 'This number is too great.' };
  if (minimum !== undefined && value < minimum) return { problem: `At least ${showNumber(minimum)}.` };
  if (maximum !== undefined && value > maximum) return { problem: `At most ${showNumber(maximum)}.` };
  return { value };
}

// As a field shows it; nothing of what is no number.
export function showNumber(value: number): string {
  if (!Number.isFinite(value)) return '';
  if (Math.abs(value) >= 1e15 || (value !== 0 && Math.abs(value) < 1e-6)) return String(value);
  return value.toLocaleString('en', { maximumFractionDigits: 6, useGrouping: false });
}
