// The writes of the guide to a drive, in their order, so that they can be undone step by step.

export interface Written {
  step: string;
  object: string; // "6081:00"
  name: string;
  unit: string;
  before: number; // the value in the drive when the step wrote it first
  after: number;
}

export type Journal = readonly Written[];

const lastOf = (journal: Journal, isWanted: (each: Written) => boolean): Written | undefined => journal.filter(isWanted).at(-1);
const isSame = (a: Written, b: { step: string; object: string }) => a.step === b.step && a.object === b.object;

// Adds a write. A step that writes an object again keeps its first `before`, unless another step wrote the object meanwhile.
export function noted(journal: Journal, written: Written): Journal {
  const last = lastOf(journal, ({ object }) => object === written.object);
  if (!last || last.step !== written.step) return [...journal, written];
  return journal.flatMap((each) => {
    if (each !== last) return [each];
    return each.before === written.after ? [] : [{ ...each, after: written.after }];
  });
}

// Enters the mode of operation that the jobs of a motion left in the drive. `written.before` is the mode before the
// motion, `written.after` the present one. If that is neither `before` nor one of `ofJobs`, another client has set it,
// and the journal stays unchanged.
export function notedMode(journal: Journal, written: Written, ofJobs: readonly number[]): Journal {
  const { step, object, before, after } = written;
  const isNoted = lastOf(journal, (each) => each.object === object)?.step === step;
  return (isNoted || before !== after) && [before, ...ofJobs].includes(after) ? noted(journal, written) : journal;
}

export interface Undone {
  journal: Journal;
  write: number | null; // the value to write back; null: a later step wrote the object, whose value stays
}

// Removes one entry. If a later step wrote the same object, the `before` of that step becomes the `before` of the removed entry.
export function without(journal: Journal, entry: Written): Undone {
  const at = journal.indexOf(entry);
  const later = journal.findIndex(({ object }, i) => i > at && object === entry.object);
  const rest = journal.map((each, i) => (i === later ? { ...each, before: entry.before } : each)).filter((each) => each !== entry);
  return { journal: rest, write: later < 0 ? entry.before : null };
}

// The entries of a step, or all (null), the newest first: the order in which they are undone.
export const toUndo = (journal: Journal, step: string | null) => journal.filter((each) => step === null || each.step === step).reverse();

export const lost = 'not in the drive, as after a power cut';
export type Standing = 'in the drive' | typeof lost | 'changed by another' | 'replaced' | 'not known';

// Values to which a drive returns at power-on, by object, as far as they are known.
export interface PowerOn {
  stored: Record<string, number | undefined>; // by the guide
  factory: Record<string, unknown>;
}
export const noPowerOn: PowerOn = { stored: {}, factory: {} };

// The values that an object may have had before the guide: the one before its first write, and the factory value.
const fromBefore = (journal: Journal, object: string, { factory }: PowerOn) => [journal.find((each) => each.object === object)?.before, factory[object]];

// Compares the value that was written with the drive's present value. After a power cut a drive has its stored values, or those of
// the factory.
export function standingOf(journal: Journal, entry: Written, now: unknown, powerOn = noPowerOn): Standing {
  const { object } = entry;
  const last = lastOf(journal, (each) => each.object === object);
  if (last !== entry) return 'replaced';
  if (typeof now !== 'number') return 'not known';
  if (now === entry.after) return 'in the drive';
  return [entry.before, powerOn.stored[object], ...fromBefore(journal, object, powerOn)].includes(now) ? lost : 'changed by another';
}

// What the undo of an entry does with the value in the drive: nothing, if it is one from before the guide; null: another has set it.
export function undoing(journal: Journal, entry: Written, now: unknown, powerOn: PowerOn): 'write' | 'nothing' | null {
  const { write } = without(journal, entry);
  if (write === null || now === write) return 'nothing';
  if (typeof now !== 'number') return null;
  if (now === entry.after || now === powerOn.stored[entry.object]) return 'write';
  return fromBefore(journal, entry.object, powerOn).includes(now) ? 'nothing' : null;
}

export const entryOf = (journal: Journal, step: string, object: string) => lastOf(journal, (each) => isSame(each, { step, object }));
