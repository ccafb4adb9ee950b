// The PDOs of an axis as the server lists them, and their changes (docs/bench-api.md, "PDOs").

export interface Mapped {
  object: string; // "607A:00"; "0000:00" is padding
  name: string;
  bits: number;
}

export interface Pdo {
  index: string;
  direction: 'receive' | 'transmit';
  number: number;
  fixed: boolean;
  most: number; // greatest number of objects
  objects: Mapped[];
  enabled?: boolean; // this and the following: CAN only
  can_id?: number;
  transmission_type?: number;
  inhibit_time_us?: number;
  event_timer_ms?: number;
  sync_start?: number;
}

export interface Pdos {
  bus: 'can' | 'ethercat';
  receive?: string[]; // EtherCAT only: assigned PDOs, in order
  transmit?: string[];
  receive_fixed?: boolean;
  transmit_fixed?: boolean;
  pdos: Pdo[];
  mappable: { receive: Mapped[]; transmit: Mapped[] };
}

export const bitsOf = (objects: Mapped[]) => objects.reduce((sum, { bits }) => sum + bits, 0);

const settings = ['enabled', 'can_id', 'transmission_type', 'inhibit_time_us', 'event_timer_ms', 'sync_start'] as const;
// Padding needs its length, since it has no object that determines the length.
const textOf = ({ object, bits }: Mapped) => (object.startsWith('0000') ? `${object}/${bits}` : object);
const same = (a: unknown, b: unknown) => JSON.stringify(a) === JSON.stringify(b);

// The body of the request that changes `before` to `after`. Null if nothing differs.
export function changesOf(before: Pdos, after: Pdos): Record<string, unknown> | null {
  const pdos = after.pdos.flatMap((pdo) => {
    const was = before.pdos.find(({ index }) => index === pdo.index);
    if (!was) return [];
    const change: Record<string, unknown> = {};
    if (!same(was.objects, pdo.objects)) change.objects = pdo.objects.map(textOf);
    for (const key of settings) if (was[key] !== pdo[key]) change[key] = pdo[key];
    return Object.keys(change).length > 0 ? [{ index: pdo.index, ...change }] : [];
  });
  const change: Record<string, unknown> = {};
  if (pdos.length > 0) change.pdos = pdos;
  for (const key of ['receive', 'transmit'] as const) if (!same(before[key], after[key])) change[key] = after[key];
  return Object.keys(change).length > 0 ? change : null;
}

// The list with the elements at `from` and `from + step` exchanged; unchanged if the second is outside the list.
export function moved<T>(list: T[], from: number, step: number): T[] {
  const to = from + step;
  if (to < 0 || to >= list.length) return list;
  const result = [...list];
  [result[from], result[to]] = [result[to], result[from]];
  return result;
}
