// A value of an object in decimal, hexadecimal and binary digits, with the width of the object's type.

const bits: Record<string, number> = {
  BOOLEAN: 1, INTEGER8: 8, UNSIGNED8: 8, INTEGER16: 16, UNSIGNED16: 16, INTEGER24: 24, UNSIGNED24: 24, INTEGER32: 32, UNSIGNED32: 32,
};

// The range of a type of whole numbers; undefined: of another type.
export function rangeOf(type: string): [minimum: number, maximum: number] | undefined {
  const [, sign, width] = /^(UNSIGNED|INTEGER)(\d+)$/.exec(type) ?? [];
  if (sign === undefined || width === undefined) return undefined;
  const half = 2 ** (Number(width) - 1);
  return sign === 'UNSIGNED' ? [0, 2 * half - 1] : [-half, half - 1];
}

export interface Bases {
  decimal: string;
  hexadecimal: string; // '' of a value that is no whole number
  binary: string;
}

export const formats = [['decimal', 'Decimal'], ['hexadecimal', 'Hexadecimal'], ['binary', 'Binary']] as const;
export type Format = (typeof formats)[number][0];

// Without a type, the width is the smallest of 8, 16, 32 and 64 bits that holds the value.
export function basesOf(value: number, type = ''): Bases {
  const decimal = Number.isInteger(value) ? String(value) : value.toPrecision(7).replace(/\.?0+$/, '');
  if (!Number.isSafeInteger(value)) return { decimal, hexadecimal: '', binary: '' };
  const whole = BigInt(value);
  const fits = (n: number) => (whole < 0n ? -whole <= 1n << BigInt(n - 1) : whole < 1n << BigInt(n));
  const width = bits[type] ?? [8, 16, 32, 64].find(fits) ?? 64;
  const pattern = BigInt.asUintN(Math.max(width, 1), whole);
  const digits = pattern.toString(2).padStart(width, '0');
  const groups = digits.padStart(Math.ceil(width / 4) * 4, ' ').match(/.{4}/g) ?? [digits];
  return { decimal, hexadecimal: `${pattern.toString(16).toUpperCase().padStart(Math.ceil(width / 4), '0')}h`, binary: groups.join(' ').trim() };
}
