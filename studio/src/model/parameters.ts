// The part of the parameter file format of `servodrome params` (docs/params.md) that the page writes itself.

export interface Difference {
  object: string; // "6083:00"
  name: string;
  unit: string;
  type: string; // type as in the file, for example u32
  left: string | null; // null: the left side does not have the object
  right: string | null;
}

// A parameter file with the left side's values of these differences, for a drive of `product`.
export function textOf(product: string, differences: Difference[]): string {
  const lines = differences.filter(({ left }) => left !== null).map(({ object, type, left }) => `${object} ${type} ${left}`);
  return ['# servodrome parameters 1', `product: ${product}`, ...lines, 'end', ''].join('\n');
}
