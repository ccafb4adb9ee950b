import { get, post, put, remove, segment } from './api/client';
import type { Job, ObjectValue } from './api/types';
import { commandsMotion } from './model/motion_objects';
import { shownOf } from './model/problem';
import { complain, complainOf, forget, forgetRequests, tell } from './notices';
import { interruptions, noteJob, outdate, overWithin, snapshot } from './store';

export const axisPath = (axis: string) => `/axes/${segment(axis)}`;

export interface ObjectAnswer {
  value: ObjectValue;
}

const objectPath = (axis: string, index: number, sub: number) => `${axisPath(axis)}/objects/${index.toString(16).padStart(4, '0')}/${sub.toString(16)}`;

export const readObject = async (axis: string, index: number, sub = 0) => (await get<ObjectAnswer>(objectPath(axis, index, sub))).value;
// Reads many objects, by address ("60FD:00"). A value is null if it cannot be read now.
export const readValues = async (axis: string, objects: string[]) =>
  (await get<{ values: Record<string, ObjectValue> }>(`${axisPath(axis)}/values?objects=${objects.join(',')}`)).values;
export const writeObject = async (axis: string, index: number, sub: number, value: ObjectValue) => {
  if (index === 0x6040) takeBack(axis); // the controlword
  const path = objectPath(axis, index, sub);
  const answer = await put(path, { value }, commandsMotion(index, value) ? untilTakenBack(axis) : undefined);
  forgetRequests(path); // notices about earlier writes of this object are out of date
  return answer;
};

export const power = (axis: string, action: 'on' | 'off' | 'cycle') => {
  takeBack(axis);
  return post(`${axisPath(axis)}/power`, { action });
};

// The AbortController of each axis: it aborts ("takes back") the requests of jobs and of writes that can move the axis
// that are not answered yet: a later halt, controlword or STOP uses another connection and may reach the server first.
const takingBack = new Map<string, AbortController>();

function untilTakenBack(axis: string): AbortSignal {
  const known = takingBack.get(axis) ?? new AbortController();
  takingBack.set(axis, known);
  return known.signal;
}

// Callbacks of the parts of this page that hold a value and write it later, for example a slider. `axis` null: STOP of
// all axes.
type TakenBack = (axis: string | null) => void;
const waiting = new Set<TakenBack>();

// The callback runs at each halt, controlword, power switch and STOP of this page, before its request is sent.
export function onTakenBack(callback: TakenBack): () => void {
  waiting.add(callback);
  return () => void waiting.delete(callback);
}

// Acts on the items one after the other. After a halt, controlword, power switch or STOP for the axis it finishes the
// present item, and then throws an error with the number of items that are done.
export async function untilHalted<T>(axis: string, items: readonly T[], act: (item: T) => Promise<unknown>): Promise<void> {
  let isHalted = false;
  const forget = onTakenBack((each) => {
    isHalted ||= each === null || each === axis;
  });
  try {
    for (const [done, item] of items.entries()) {
      if (isHalted) throw new Error(`${axis}: a halt came: ${done} of ${items.length} values are written`);
      await act(item);
    }
  } finally {
    forget();
  }
}

// Every command of this page calls it first: what is shown about the axis's earlier commands is out of date.
function beginCommand(axis: string) {
  forget(axis);
  outdate(axis);
}

function abortRequests(axis: string) {
  takingBack.get(axis)?.abort();
  takingBack.delete(axis);
}

export function takeBack(axis: string) {
  beginCommand(axis);
  abortRequests(axis);
  waiting.forEach((each) => each(axis));
}

// The latest job of each axis, with the signal that takes back its request. The next job of a sequence (`after`) has
// the same signal, so a controlword that was written between the two takes it back as well. The next job is also
// refused if the server was restarted in between, or if this page slept or lost its connection.
interface Begun {
  id: number;
  signal: AbortSignal;
  start: string;
  interruptions: number;
}
const latest = new Map<string, Begun>();

// The keys of a job that is to follow this one. The server refuses it if another command came, or if it arrives too late.
// `pause_s`: time that the page waits between the two.
export const following = (job: Job, pause_s = 0) => ({ after: job.id, after_within_s: 10 + pause_s });

export function takeBackAll() {
  snapshot().order.forEach(beginCommand);
  [...takingBack.keys()].forEach(abortRequests);
  waiting.forEach((each) => each(null));
}

const starting = new Map<string, number>(); // requests of jobs on their way, by axis

// Jobs that the server accepts at any time and carries out to their end.
export const isHalt = (job: string) => ['stop', 'quick_stop', 'disable'].includes(job);

// The signal `until` takes the request back, as a halt, a controlword and STOP do.
export async function startJob(axis: string, request: { do: string } & Record<string, unknown>, until?: AbortSignal): Promise<Job> {
  const halts = isHalt(request.do);
  const before = latest.get(axis);
  const isNext = request.after !== undefined && request.after === before?.id;
  if (isNext && !halts && before.interruptions !== interruptions()) {
    throw new Error(`${axis}: the sequence ends, because this page slept or was not connected in the meantime`);
  }
  const followed = isNext ? before.signal : undefined;
  const wasTakenBack = followed?.aborted ?? false;
  if (halts) takeBack(axis);
  // A halt within a sequence begins a new signal, so it does not take back the jobs that follow it. If the user's halt
  // has taken the sequence back before, the aborted signal stays, and takes back the jobs that follow.
  const signal = followed && (!halts || wasTakenBack) ? followed : untilTakenBack(axis);
  starting.set(axis, (starting.get(axis) ?? 0) + 1);
  const begun = { start: snapshot().start, interruptions: interruptions() };
  const body = isNext && before.start !== '' ? { ...request, after_start: before.start } : request;
  const withdrawn = halts ? undefined : until ? AbortSignal.any([signal, until]) : signal;
  if (!withdrawn?.aborted) beginCommand(axis); // else it is no command: the earlier outcome stays
  const job = await post<Job>(`${axisPath(axis)}/jobs`, body, withdrawn).finally(() => starting.set(axis, starting.get(axis)! - 1));
  latest.set(axis, { id: job.id, signal, ...begun });
  noteJob(job);
  return job;
}

const ask_ms = 3000; // interval of polling the job, in case the stream reports nothing

// Waits until the job is over. There is no timeout.
export async function finish(job: Job): Promise<Job> {
  let now = job;
  while (now.state === 'running') {
    const told = await overWithin(job, ask_ms);
    now = told ?? (await get<Job>(`/jobs/${job.id}`));
    noteJob(now);
  }
  return now;
}

// Waits until the job is over, and shows a notice if it fails or has a remark.
export async function finishAloud(begun: Job): Promise<Job> {
  const job = await finish(begun);
  if (job.note) tell(`${job.axis}: ${job.note}`);
  if (job.state === 'failed') {
    const { what, hint } = shownOf(job.error ?? { what: `${job.do.replaceAll('_', ' ')} failed` });
    complainOf({ what: `${job.axis}: ${what}`, ...(hint ? { hint } : {}) });
  }
  return job;
}

// Runs a job to its end, and shows a notice if it is refused or fails.
export async function runJob(axis: string, request: { do: string } & Record<string, unknown>): Promise<Job | null> {
  try {
    return await finishAloud(await startJob(axis, request));
  } catch (error) {
    complain(error);
    return null;
  }
}

// Runs a motion after a halt. If its request is held back on its way, the server refuses it when it arrives.
export async function haltAnd(axis: string, request: { do: string } & Record<string, unknown>): Promise<Job | null> {
  const halted = await runJob(axis, { do: 'stop' });
  return halted?.state === 'done' ? runJob(axis, { ...request, ...following(halted) }) : halted;
}

// Ends the job, and the jobs of its sequence that have begun after it. Another job of the axis goes on.
export const endJob = (job: Job) => remove<Job>(`/jobs/${job.id}`);

// The user's Cancel. The job may have ended just now, so the request of the next job of its sequence is taken back as
// well. The server may have begun that next job already, so the axis then gets a halt. The axis also gets a halt if the
// server does not confirm the end of the job, or if its motion goes on after that end.
export async function cancelJob(job: Job) {
  const isFollowed = (starting.get(job.axis) ?? 0) > 0;
  takeBack(job.axis);
  const ended = endJob(job).catch(() => null);
  if (isFollowed) await startJob(job.axis, { do: 'stop' });
  const over = await ended;
  const movesOn = over === null || (over.state === 'done' && ['velocity', 'torque'].includes(over.do));
  if (!isFollowed && movesOn) await startJob(job.axis, { do: 'stop' });
}
