// The table of a bus's traffic: decoded frames, and gap rows where frames are missing.

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
  left_out: number; // matching rows that are not in the answer because of its limit
  lost: number; // frames after `since` whose rows the server no longer has
  missed: number; // since the server's start: frames that it did not decode, because they came too fast
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
  keys: number; // number of keys assigned so far
  trimmed: number; // rows removed at the top, because the table was full
  absent: number; // missing frames of all gaps, including gaps removed at the top
  next: number;
  missed: number | null;
}

export const emptyTable = (next = 0, missed: number | null = null): Table => ({ rows: [], keys: 0, trimmed: 0, absent: 0, next, missed });

const count = (n: number, what: string) => `${n.toLocaleString('en')} ${what}`;

// The table with an answer's rows added. Gap rows for missing frames come before the new rows.
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

// The kinds of frames on each type of bus, with the server's names.
export const kindsOf: Record<'can' | 'ethercat' | 'rs485', string[]> = {
  can: ['nmt', 'sync', 'time', 'emcy', 'pdo', 'sdo', 'heartbeat', 'guarding', 'lss', 'can', 'error'],
  ethercat: ['state', 'register', 'mailbox', 'sdo', 'emcy', 'process-data', 'garbage'],
  rs485: ['modbus', 'serial10', 'garbage'],
};
