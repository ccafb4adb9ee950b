import type { ObjectEntry, ObjectValue } from '../api/types';

// The dictionary on the page: groups of objects, search, and the conversion of values from and to text.

export const groups = ['All', 'Changed', 'Communication', 'Manufacturer-specific', 'CiA 402', 'Storage'] as const;
export type Group = (typeof groups)[number];

export const addressOf = ({ index, sub }: Pick<ObjectEntry, 'index' | 'sub'>) =>
  `${index.replace('0x', '').toUpperCase()}:${sub.toString(16).toUpperCase().padStart(2, '0')}`;

export function inGroup(entry: ObjectEntry, group: Group, isChanged: (entry: ObjectEntry) => boolean): boolean {
  const index = Number(entry.index);
  switch (group) {
    case 'All': return true;
    case 'Changed': return isChanged(entry);
    case 'Communication': return index >= 0x1000 && index < 0x2000;
    case 'Manufacturer-specific': return index >= 0x2000 && index < 0x6000;
    case 'CiA 402': return index >= 0x6000 && index < 0xa000;
    case 'Storage': return index === 0x1010 || index === 0x1011;
  }
}

// True if the entry's address, name, unit and explanation together contain every word of the search.
export function matches(entry: ObjectEntry, search: string): boolean {
  const text = `0x${addressOf(entry)} ${entry.index.replace('0x', '')}h ${entry.name} ${entry.unit} ${entry.text ?? ''}`.toLowerCase();
  return search.toLowerCase().split(/\s+/).every((word) => text.includes(word));
}

// How well an entry fits a search: 0 its address, 1 a name that begins so, 2 a name that contains it, 3 unit or explanation.
export function rankOf(entry: ObjectEntry, search: string): number {
  const text = search.trim().toLowerCase();
  const name = entry.name.toLowerCase();
  if (text === '') return 0;
  if (addressOf(entry).toLowerCase().startsWith(text.replace(/^0x|h$/g, ''))) return 0;
  if (name.startsWith(text)) return 1;
  return text.split(/\s+/).every((word) => name.includes(word)) ? 2 : 3;
}

export const isReadable = ({ access }: ObjectEntry) => access !== 'wo';
export const isWritable = ({ access }: ObjectEntry) => access.includes('w');
// True for a readable and writable entry with a default value, so that a comparison with the default is possible.
export const hasDefault = (entry: ObjectEntry) => isWritable(entry) && isReadable(entry) && entry.default !== undefined && entry.default !== null && Number(entry.index) >= 0x1000;
export const differs = (entry: ObjectEntry, value: ObjectValue | undefined) => value !== undefined && hasDefault(entry) && value !== entry.default;

const isText = (type: string) => type === 'VISIBLE_STRING' || type === 'OCTET_STRING' || type === 'DOMAIN';

// Converts typed text to a value of the object's type: decimal, or hexadecimal as 0x1F or 1Fh. If it is none, gives the reason.
// The range of the object itself is checked by the drive.
export function parseValue(entry: ObjectEntry, typed: string): { value: ObjectValue } | { problem: string } {
  if (isText(entry.type)) return { value: typed };
  const text = typed.trim().replace('\u2212', '-');
  const hexadecimal = /^(?:0x([0-9a-f]+)|([0-9a-f]+)h)$/i.exec(text);
  const value = hexadecimal ? parseInt(hexadecimal[1] ?? hexadecimal[2], 16) : Number(text);
  if (text === '') return { problem: 'Enter a number.' };
  if (/^[+-]?\d*,\d+$/.test(text)) return { problem: `The decimal separator is a point: ${text.replace(',', '.')}.` };
  if (Number.isNaN(value)) return { problem: 'Not a number: enter for example 12, 0x1F or 1Fh.' };
  if (entry.type.startsWith('REAL')) return Number.isFinite(value) ? { value } : { problem: `Too ${value > 0 ? 'high' : 'low'} for ${entry.type}.` };
  const [least, most] = rangeOf(entry.type);
  if (value > most) return { problem: `Too high: ${entry.type} is at most ${most}.` };
  if (value < least) return { problem: `Too low: ${entry.type} is at least ${least}.` };
  return Number.isInteger(value) ? { value } : { problem: `${entry.type} is a whole number.` };
}

function rangeOf(type: string): [number, number] {
  const [, kind, bits] = /^(INTEGER|UNSIGNED)(\d+)$/.exec(type) ?? [];
  if (kind === 'INTEGER') return [-(2 ** (Number(bits) - 1)), 2 ** (Number(bits) - 1) - 1];
  return kind === 'UNSIGNED' ? [0, 2 ** Number(bits) - 1] : [-Infinity, Infinity];
}

type Typed = Pick<ObjectEntry, 'name' | 'type'>;

const digits: Record<string, number> = { UNSIGNED8: 2, UNSIGNED16: 4, UNSIGNED32: 8 };

// CAN identifiers are hexadecimal, as everywhere in CANopen.
const isCanId = ({ name, type }: Typed) => type === 'UNSIGNED32' && /\bCOB-?ID\b/i.test(name);

export function showValue(value: ObjectValue | undefined, entry?: Typed): string {
  if (entry && isCanId(entry) && typeof value === 'number') return hexValue(entry, value);
  return value === undefined ? '' : value === null ? 'no value' : String(value);
}

export function hexValue(entry: Pick<ObjectEntry, 'type'>, value: ObjectValue | undefined): string {
  const width = digits[entry.type];
  return width && typeof value === 'number' ? `${value.toString(16).toUpperCase().padStart(width, '0')}h` : '';
}

export interface Named {
  value: number;
  name: string;
}

// Names of bits or of values. Accepts each form that the server uses: {"3": "name"}, [{"bit"|"value": 3, "name": ".."}],
// ["name of 0", ..].
export function namedOf(source: unknown): Named[] {
  if (Array.isArray(source)) {
    return source.flatMap((each: unknown, i) => {
      if (typeof each === 'string') return [{ value: i, name: each }];
      if (typeof each !== 'object' || each === null) return [];
      const { bit, value = bit, name, text = name } = each as { bit?: number; value?: number; name?: string; text?: string };
      return typeof value === 'number' && typeof text === 'string' ? [{ value, name: text }] : [];
    });
  }
  if (typeof source !== 'object' || source === null) return [];
  return Object.entries(source).flatMap(([value, name]) => (typeof name === 'string' ? [{ value: Number(value), name }] : []));
}
