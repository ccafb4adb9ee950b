import { useSyncExternalStore } from 'react';
import { ApiError, get, post } from './api/client';
import { Stream, type ServerEvent } from './api/stream';
import { setToken, subprotocols, token } from './api/token';
import type { AxisView, Clock, Job, LineView, Missing } from './api/types';

// What the page knows of the line, in one place: filled from the stream, read by every part.

export interface State {
  // 'locked': it takes this page only with its token; 'full': it answers, but has no stream for this page
  link: 'connecting' | 'up' | 'lost' | 'locked' | 'full';
  wrongToken: boolean; // somebody has given one that it does not take
  version: string;
  start: string; // of the server's run
  epoch: number; // counts the server's runs that this page has seen: what was fetched before is old
  restarted: boolean; // and nobody has read the banner yet
  order: string[];
  axes: Record<string, AxisView>;
  clock: Clock | null;
  line: LineView | null;
  jobs: Record<string, Job>; // the latest of each axis
  lastEvent: (ServerEvent & { serial: number }) | null;
}

let state: State = {
  link: 'connecting', wrongToken: false, version: '', start: '', epoch: 0, restarted: false, order: [], axes: {}, clock: null, line: null, jobs: {}, lastEvent: null,
};
const listeners = new Set<() => void>();

export function update(change: Partial<State>) {
  state = { ...state, ...change };
  for (const listener of listeners) listener();
}

export const snapshot = () => state;

function listen(listener: () => void) {
  listeners.add(listener);
  return () => {
    listeners.delete(listener);
  };
}

// `select` answers a value that stays the same (===) while nothing of it changed.
export function useLine<T>(select: (state: State) => T): T {
  return useSyncExternalStore(listen, () => select(state));
}

export const useAxis = (name: string) => useLine((line) => line.axes[name] as AxisView | undefined);

// Of an axis only that: who needs no more is not drawn anew each time that something moves.
export const usePowered = (name: string) => useLine((line) => line.axes[name]?.powered ?? false);

// Why there is no such thing here; undefined: there is; null: not known yet.
export const useMissing = (what: Missing) => useLine(({ line }) => (line === null ? null : line.missing[what]));

// News may come by two ways, and the older one later.
export function noteJob(job: Job) {
  const known = state.jobs[job.axis];
  if (known && (known.id > job.id || (known.id === job.id && known.state !== 'running'))) return;
  update({ jobs: { ...state.jobs, [job.axis]: job } });
}

// The job when the stream has said that it is over; null: not within that time, or another took its place.
export function overWithin(job: Job, ms: number): Promise<Job | null> {
  return new Promise((resolve) => {
    const look = () => {
      const latest = state.jobs[job.axis];
      if (latest?.id === job.id && latest.state !== 'running') end(latest);
      else if (latest && latest.id > job.id) end(null);
    };
    const end = (job: Job | null) => {
      clearTimeout(timer);
      unlisten();
      resolve(job);
    };
    const timer = setTimeout(() => end(null), ms);
    const unlisten = listen(look);
    look();
  });
}

let serial = 0;
let fresh = true; // the next views are of another run of the server: they replace those of the last

function takeAxes(views: AxisView[], clock?: Clock) {
  const axes = fresh ? {} : { ...state.axes };
  for (const view of views) axes[view.name] = view;
  const same = !fresh && views.every((view) => view.name in state.axes);
  fresh = false;
  update({ link: 'up', axes, order: same ? state.order : Object.keys(axes), ...(clock ? { clock } : {}) });
}

// The latest of each axis, those of other pages and of scripts as well. Once a connection; then the stream tells.
async function takeJobs() {
  const { jobs } = await get<{ jobs: Job[] }>('/jobs');
  const latest: Record<string, Job> = {};
  for (const job of jobs) if (!(latest[job.axis]?.id > job.id)) latest[job.axis] = job;
  update({ jobs: latest });
}

async function takeLine() {
  update({ line: await get<LineView>('/line') });
}

function begin({ start, version = '' }: { start: string; version?: string }) {
  const other = state.start !== '' && state.start !== start;
  fresh ||= other;
  if (other || state.line === null) takeLine().catch(() => undefined); // asked again with the next greeting
  update({
    link: 'up',
    start,
    version,
    ...(other ? { restarted: true, epoch: state.epoch + 1, jobs: {}, lastEvent: null } : {}),
  });
  takeJobs().catch(() => undefined); // the banner says it
}

// Why a stream did not even begin, which a browser does not tell: asked by a request that the same people may make.
async function probe(): Promise<State['link']> {
  try {
    await post('/jobs/0/alive');
    return 'full';
  } catch (error) {
    const status = error instanceof ApiError ? error.status : 0;
    return status === 0 ? 'lost' : status === 401 || status === 403 ? 'locked' : 'full';
  }
}

async function explain() {
  let link = await probe();
  if (link === 'locked' && token() !== '') {
    // One of an earlier run of the server, or mistyped. Perhaps none is needed.
    setToken('');
    update({ wrongToken: true });
    link = await probe();
    if (link !== 'locked') update({ wrongToken: false });
  }
  if (state.link === 'up') return;
  update({ link });
  if (link === 'locked') stream.rest();
}

export function unlock(given: string) {
  setToken(given.trim());
  update({ wrongToken: false });
  stream.retry();
}

export let stream: Stream;

export function connect() {
  const address = `${location.protocol === 'https:' ? 'wss' : 'ws'}://${location.host}/api/v1/stream`;
  stream = new Stream(address, 20, {
    connected: begin,
    lost: (wasOpen) => {
      if (wasOpen) update({ link: 'lost' });
      else void explain();
    },
    axes: takeAxes,
    event: (event) => {
      if (event.kind === 'job' && event.job) noteJob(event.job);
      else update({ lastEvent: { ...event, serial: ++serial } });
    },
  }, subprotocols);
}
