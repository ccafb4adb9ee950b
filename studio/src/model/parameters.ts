// Parameters as `servodrome params` writes them (docs/params.md), as far as the page makes such a text itself.

export interface Difference {
  object: string; // "6083:00"
  name: string;
  unit: string;
  type: string; // as the text has it: u32
  left: string | null; // null: it is not there
  right: string | null;
}

// A text with the left side's values of some differences, for a drive of `product`.
export function textOf(product: string, differences: Difference[]): string {
  const lines = differences.filter(({ left }) => left !== null).map(({ object, type, left }) => `${object} ${type} ${left}`);
  return ['# servodrome parameters 1', `product: ${product}`, ...lines, 'end', ''].join('\n');
}
