// What the table of a bus's traffic shows: rows in words, and gaps where there is less than there was.

export interface TrafficRow {
  number: number;
  time_ns: number;
  from: string;
  kind: string;
  node: number | null;
  about: string;
  bytes: string;
  text: string;
  error: boolean;
  values: { object: string; name: string; value: string }[];
}

export interface TrafficAnswer {
  rows: TrafficRow[];
  next: number;
  left_out: number; // fit the filter, but are more than were asked for
  lost: number; // were not there any more
  missed: number; // of all, since the server was started: came faster than they were put into words
  frames: number;
  recording: boolean;
}

export interface Gap {
  gap: string;
}
export type Shown = (TrafficRow | Gap) & { key: number };

export const isGap = (row: TrafficRow | Gap): row is Gap => 'gap' in row;

export interface TrafficFilter {
  text: string;
  kind: string; // '': all
  node: string;
  errors: boolean;
}

export const mostShown = 10_000;

export interface Table {
  rows: Shown[];
  keys: number; // given so far
  trimmed: number; // rows that have gone at the top
  absent: number; // what the gaps stand for, also those that have gone at the top
  next: number;
  missed: number | null;
}

export const emptyTable = (next = 0, missed: number | null = null): Table => ({ rows: [], keys: 0, trimmed: 0, absent: 0, next, missed });

const count = (n: number, what: string) => `${n.toLocaleString('en')} ${what}`;

// The table with what an answer brings. Gaps stand where the rows are missing: before those that came.
export function withAnswer(table: Table, answer: TrafficAnswer): Table {
  const gaps: string[] = [];
  const missed = table.missed === null ? 0 : answer.missed - table.missed;
  const gone = answer.lost + missed;
  if (gone > 0) gaps.push(`${count(gone, gone === 1 ? 'frame' : 'frames')} lost: buffer of the server full`);
  if (answer.left_out > 0) gaps.push(`${count(answer.left_out, answer.left_out === 1 ? 'row' : 'rows')} skipped: too many to display`);
  let { keys } = table;
  const added: Shown[] = [...gaps.map((gap) => ({ gap })), ...answer.rows].map((row) => ({ ...row, key: ++keys }));
  if (added.length === 0 && table.next === answer.next && table.missed === answer.missed) return table;
  const all = added.length === 0 ? table.rows : [...table.rows, ...added];
  const over = Math.max(0, all.length - mostShown);
  return { rows: over === 0 ? all : all.slice(over), keys, trimmed: table.trimmed + over, absent: table.absent + gone + answer.left_out, next: answer.next, missed: answer.missed };
}

export function queryOf(filter: TrafficFilter, since: number, limit: number): string {
  const query = new URLSearchParams({ since: String(since), limit: String(limit), newest: 'true' });
  if (filter.text) query.set('text', filter.text);
  if (filter.kind) query.set('kind', filter.kind);
  if (/^\d+$/.test(filter.node)) query.set('node', filter.node);
  if (filter.errors) query.set('errors', 'true');
  return query.toString();
}

// Seconds of line time, to the microsecond.
export const secondsOf = (time_ns: number) => (time_ns / 1e9).toFixed(6);

// The kinds that a bus of a type can have, as the server names them.
export const kindsOf: Record<'can' | 'ethercat' | 'rs485', string[]> = {
  can: ['nmt', 'sync', 'time', 'emcy', 'pdo', 'sdo', 'heartbeat', 'guarding', 'lss', 'can', 'error'],
  ethercat: ['state', 'register', 'mailbox', 'sdo', 'emcy', 'process-data', 'garbage'],
  rs485: ['modbus', 'serial10', 'garbage'],
};
