import { useSyncExternalStore } from 'react';
import { ApiError, get, post } from './api/client';
import { Stream, type ServerEvent } from './api/stream';
import { setToken, subprotocols, token } from './api/token';
import { motionHindrance } from './model/cia402';
import { watch_hz } from './rates';
import { noteProject, openProject, type ProjectEvent } from './storage';
import type { AxisView, Clock, Job, LineView, Missing } from './api/types';

// The state of the line as the page knows it. The stream updates it, and all parts of the page read it.

export interface State {
  // 'locked': the server requires its token; 'full': the server answers, but has no stream left for this page
  link: 'connecting' | 'up' | 'lost' | 'locked' | 'full';
  wrongToken: boolean; // the server did not accept the token
  version: string;
  start: string; // identifies this run of the server
  epoch: number; // number of restarts of the server that this page has seen; data of an earlier run are out of date
  restarted: boolean; // the server has restarted, and the user has not dismissed the banner yet
  order: string[];
  axes: Record<string, AxisView>;
  clock: Clock | null;
  line: LineView | null;
  jobs: Record<string, Job>; // the latest job of each axis
  outdated: Record<string, number>; // by axis: the outcomes of this job and of earlier ones are out of date
  lastEvent: (ServerEvent & { serial: number }) | null;
}

let state: State = {
  link: 'connecting', wrongToken: false, version: '', start: '', epoch: 0, restarted: false, order: [], axes: {}, clock: null, line: null, jobs: {}, outdated: {}, lastEvent: null,
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

// `select` must return the same value (===) as long as nothing in it has changed.
export function useLine<T>(select: (state: State) => T): T {
  return useSyncExternalStore(listen, () => select(state));
}

export const useAxis = (name: string) => useLine((line) => line.axes[name] as AxisView | undefined);

// Only this value of an axis, so that a component that needs nothing else is not rendered at every motion.
export const usePowered = (name: string) => useLine((line) => line.axes[name]?.powered ?? false);

// The reason why no motion of the axis may begin now; empty: none.
export const useMotionHindrance = (name: string) => useLine(({ axes }) => motionHindrance(axes[name]));

export const useIsBusy = (name: string) => useLine(({ jobs }) => (jobs[name] as Job | undefined)?.state === 'running');

// The reason why the server does not have `what`; undefined: it has it; null: not known yet.
export const useMissing = (what: Missing) => useLine(({ line }) => (line === null ? null : line.missing[what]));

// Jobs arrive by the stream and by requests, so an older state may arrive later. It is ignored.
export function noteJob(job: Job) {
  const known = state.jobs[job.axis];
  if (known && (known.id > job.id || (known.id === job.id && known.state !== 'running'))) return;
  update({ jobs: { ...state.jobs, [job.axis]: job } });
}

// A new command of the axis makes the outcome of its latest job out of date. A job that still runs will have a new outcome.
export function outdate(axis: string) {
  const job = state.jobs[axis] as Job | undefined;
  if (job && job.state !== 'running') update({ outdated: { ...state.outdated, [axis]: job.id } });
}

// True if the job is over and a later command, of this page or a later job of any client, makes its outcome out of date.
export const useIsOutdated = (job: Job | undefined) =>
  useLine(({ outdated, jobs }) => job !== undefined && job.state !== 'running' && (job.id <= (outdated[job.axis] ?? 0) || job.id < ((jobs[job.axis] as Job | undefined)?.id ?? 0)));

// Waits until the stream reports that the job is over. Null: after `ms`, or if another job has replaced it.
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
let fresh = true; // the next views are the first of a run of the server and replace all earlier ones

function takeAxes(views: AxisView[], clock?: Clock) {
  const axes = fresh ? {} : { ...state.axes };
  for (const view of views) axes[view.name] = view;
  const same = !fresh && views.every((view) => view.name in state.axes);
  fresh = false;
  update({ link: 'up', axes, order: same ? state.order : Object.keys(axes), ...(clock ? { clock } : {}) });
}

// Requests the latest job of each axis, including jobs of other pages and of scripts. Needed once for each connection; later
// the stream reports jobs.
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
  if (other || state.line === null) takeLine().catch(() => undefined); // requested again with the next greeting
  update({
    link: 'up',
    start,
    version,
    ...(other ? { restarted: true, epoch: state.epoch + 1, jobs: {}, outdated: {}, lastEvent: null } : {}),
  });
  void openProject();
  takeJobs().catch(() => undefined); // if this fails, the banner already reports the lost connection
}

// Finds out why the stream was refused, since the browser does not report the reason. It sends a request that needs the same
// permission as the stream.
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
    // The token is wrong: mistyped, or of an earlier run of the server. The server may accept the page without one.
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

// See Stream.interruptions; 0 before the first connection.
export const interruptions = () => (state.start === '' ? 0 : stream.interruptions());

export function connect() {
  const address = `${location.protocol === 'https:' ? 'wss' : 'ws'}://${location.host}/api/v1/stream`;
  stream = new Stream(address, watch_hz, {
    connected: begin,
    lost: (wasOpen) => {
      if (wasOpen) update({ link: 'lost' });
      else void explain();
    },
    axes: takeAxes,
    event: (event) => {
      if (event.kind === 'job' && event.job) noteJob(event.job);
      else if (event.kind === 'project') noteProject(event as ProjectEvent).catch(() => undefined); // the next greeting repeats it
      else update({ lastEvent: { ...event, serial: ++serial } });
    },
  }, subprotocols);
}
