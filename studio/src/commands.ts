import { get, post, put, remove, segment } from './api/client';
import type { Job, ObjectValue } from './api/types';
import { shownOf } from './model/problem';
import { complain, complainOf, forget, tell } from './notices';
import { noteJob, overWithin } from './store';

export const axisPath = (axis: string) => `/axes/${segment(axis)}`;

export interface ObjectAnswer {
  value: ObjectValue;
}

const objectPath = (axis: string, index: number, sub: number) => `${axisPath(axis)}/objects/${index.toString(16).padStart(4, '0')}/${sub.toString(16)}`;

export const readObject = async (axis: string, index: number, sub = 0) => (await get<ObjectAnswer>(objectPath(axis, index, sub))).value;
// Reads many objects, by address ("60FD:00"). A value is null if it cannot be read now.
export const readValues = async (axis: string, objects: string[]) =>
  (await get<{ values: Record<string, ObjectValue> }>(`${axisPath(axis)}/values?objects=${objects.join(',')}`)).values;
export const writeObject = (axis: string, index: number, sub: number, value: ObjectValue) => {
  if (index === 0x6040) takeBack(axis); // the controlword
  return put(objectPath(axis, index, sub), { value });
};

export const power = (axis: string, action: 'on' | 'off' | 'cycle') => {
  takeBack(axis);
  return post(`${axisPath(axis)}/power`, { action });
};

// Takes back the requests of jobs that have not reached the server, by axis: a later halt, controlword or STOP goes by another
// connection and may arrive before them.
const takingBack = new Map<string, AbortController>();

function untilTakenBack(axis: string): AbortSignal {
  const known = takingBack.get(axis) ?? new AbortController();
  takingBack.set(axis, known);
  return known.signal;
}

// Of a sequence of jobs that has to read something before its first job: taken back by each halt, controlword and STOP from now on.
export const orderOf = untilTakenBack;

function takeBack(axis: string) {
  takingBack.get(axis)?.abort();
  takingBack.delete(axis);
}

// The latest job of each axis, with its signal. A job that is to follow it (`after`) is taken back with it: a controlword that
// was written before it may reach the server after it.
const latest = new Map<string, { id: number; signal: AbortSignal }>();

export const takeBackAll = () => [...takingBack.keys()].forEach(takeBack);

const halts = ['stop', 'quick_stop', 'disable'];

export async function startJob(axis: string, request: { do: string } & Record<string, unknown>): Promise<Job> {
  forget(axis);
  const isHalt = halts.includes(request.do);
  if (isHalt) takeBack(axis);
  const before = latest.get(axis);
  const signal = request.after !== undefined && request.after === before?.id ? before.signal : untilTakenBack(axis);
  const job = await post<Job>(`${axisPath(axis)}/jobs`, request, isHalt ? undefined : signal);
  latest.set(axis, { id: job.id, signal });
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

// Runs a job to its end, and shows a notice if it is refused or fails.
export async function runJob(axis: string, request: { do: string } & Record<string, unknown>): Promise<Job | null> {
  try {
    const job = await finish(await startJob(axis, request));
    if (job.note) tell(`${axis}: ${job.note}`);
    if (job.state === 'failed') {
      const { what, hint } = shownOf(job.error ?? { what: `${job.do.replaceAll('_', ' ')} failed` });
      complainOf({ what: `${axis}: ${what}`, ...(hint ? { hint } : {}) });
    }
    return job;
  } catch (error) {
    complain(error);
    return null;
  }
}

export const cancelJob = (job: Job) => remove(`/jobs/${job.id}`);
