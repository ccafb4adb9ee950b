import type { ObjectEntry } from '../api/types';

const order = ['Inputs', 'Functions of the inputs', 'Outputs', 'Functions of the outputs', 'Touch probes'];

// Groups objects by their set of terminals. The sets are in the order of `order`, unknown ones last.
export function setsOfTerminals(entries: ObjectEntry[]): [string, ObjectEntry[]][] {
  const sets = new Map<string, ObjectEntry[]>();
  for (const entry of entries) {
    if (entry.terminal !== undefined) sets.set(entry.terminal, [...(sets.get(entry.terminal) ?? []), entry]);
  }
  const place = (set: string) => (order.includes(set) ? order.indexOf(set) : order.length);
  return [...sets].sort(([a], [b]) => place(a) - place(b));
}
