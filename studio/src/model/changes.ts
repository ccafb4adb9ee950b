import type { ObjectValue } from '../api/types';

// The change log of the server (docs/bench-api.md, "Changes").

export interface Change {
  number: number;
  time_ns: number;
  wall: string; // UTC, "2026-01-31T12:00:00.000Z"
  axis: string;
  object: string; // "6083:00"
  name: string;
  type: string;
  unit: string;
  before: ObjectValue | null; // null: not known
  after: ObjectValue | null;
  who: string;
}

export interface ChangesAnswer {
  changes: Change[];
  next: number; // `since` of the next request
  left_out: number;
  dropped: number; // changes that the server no longer has
  most: number;
}

interface Kept {
  number: number;
  axis: string;
  object: string;
  name: string;
  what: string;
  hint: string;
}

// What an undo wrote, or with `preview` would write.
export interface UndoReport {
  undone: { number: number; axis: string; object: string; name: string; from: ObjectValue | null; to: ObjectValue | null }[];
  kept: Kept[];
  until: number; // the newest change that it looked at
}

export const most_kept = 2000; // rows on the page

// The newest `most_kept` changes, in the order of their numbers.
export function withAnswer(before: readonly Change[], answer: ChangesAnswer): readonly Change[] {
  const last = before.at(-1)?.number ?? 0;
  const added = answer.changes.filter(({ number }) => number > last);
  return added.length === 0 ? before : [...before, ...added].slice(-most_kept);
}

// `text` is looked for in object, name and author.
export function matches(change: Change, text: string, who: string): boolean {
  const wanted = text.trim().toLowerCase();
  return (who === '' || change.who === who) && `${change.object} ${change.name} ${change.who}`.toLowerCase().includes(wanted);
}

export const authorsOf = (changes: readonly Change[]): string[] => [...new Set(changes.map(({ who }) => who))].sort();

// One sentence about what an undo would write.
export function foretold({ undone, kept }: UndoReport): string {
  const drives = new Set(undone.map(({ axis }) => axis)).size;
  const written = `The undo writes ${undone.length} ${undone.length === 1 ? 'value' : 'values'} in ${drives} ${drives === 1 ? 'drive' : 'drives'}`;
  return kept.length === 0 ? `${written}.` : `${written}; ${kept.length} ${kept.length === 1 ? 'object stays' : 'objects stay'}.`;
}

// One sentence about an undo.
export function said({ undone, kept }: UndoReport): string {
  const done = undone.length === 0 ? 'Nothing to undo' : `${undone.length} ${undone.length === 1 ? 'object has' : 'objects have'} the former value`;
  return kept.length === 0 ? `${done}.` : `${done}; ${kept.length} ${kept.length === 1 ? 'stays' : 'stay'}.`;
}
