import { useSyncExternalStore } from 'react';
import { get } from './api/client';
import { poll } from './api/poll';
import { Stream, type ServerEvent } from './api/stream';
import type { AxisView, Clock, Job } from './api/types';

// What the page knows of the line, in one place: filled from the stream, read by every part.

export interface State {
  link: 'connecting' | 'up' | 'lost';
  version: string;
  start: string; // of the server's run
  epoch: number; // counts the server's runs that this page has seen: what was fetched before is old
  restarted: boolean; // and nobody has read the banner yet
  order: string[];
  axes: Record<string, AxisView>;
  clock: Clock | null;
  jobs: Record<string, Job>; // the latest of each axis
  lastEvent: (ServerEvent & { serial: number }) | null;
}

let state: State = {
  link: 'connecting', version: '', start: '', epoch: 0, restarted: false, order: [], axes: {}, clock: null, jobs: {}, lastEvent: null,
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

export function noteJob(job: Job) {
  update({ jobs: { ...state.jobs, [job.axis]: job } });
}

let serial = 0;

function takeAxes(views: AxisView[], clock?: Clock) {
  const axes = { ...state.axes };
  for (const view of views) axes[view.name] = view;
  const order = views.some((view) => !state.order.includes(view.name)) ? Object.keys(axes) : state.order;
  update({ axes, order, ...(clock ? { clock } : {}) });
}

// A new run of the server: everything is asked for again.
async function begin(start: string) {
  const restarted = state.start !== '' && state.start !== start;
  const [{ axes }, clock, version, jobs] = await Promise.all([
    get<{ axes: AxisView[] }>('/axes'),
    get<Clock>('/clock'),
    get<{ version: string }>('/version'),
    get<{ jobs: Job[] }>('/jobs').catch(() => ({ jobs: [] as Job[] })),
  ]);
  update({
    link: 'up',
    start,
    version: version.version,
    clock,
    order: axes.map(({ name }) => name),
    axes: Object.fromEntries(axes.map((axis) => [axis.name, axis])),
    jobs: Object.fromEntries(jobs.jobs.map((job) => [job.axis, job])),
    restarted: restarted || state.restarted,
    epoch: state.epoch + (restarted ? 1 : 0),
  });
}

export let stream: Stream;
let polling = false;

export function connect() {
  const address = `${location.protocol === 'https:' ? 'wss' : 'ws'}://${location.host}/api/v1/stream`;
  stream = new Stream(address, 20, {
    connected: ({ start }) => void begin(start).catch(() => update({ link: 'lost' })),
    lost: () => {
      if (state.start === '' && !polling) {
        polling = true;
        poll((axes, clock) => (state.version === '' ? void begin('').catch(() => undefined) : takeAxes(axes, clock)), () => update({ link: 'lost' }));
      }
    },
    axes: takeAxes,
    event: (event) => {
      update({ lastEvent: { ...event, serial: ++serial } });
      if (event.kind === 'job' && event.axis) {
        void get<{ jobs: Job[] }>('/jobs').then(({ jobs }) => {
          update({ jobs: Object.fromEntries(jobs.map((job) => [job.axis, job])) });
        }, () => undefined);
      }
    },
  });
}
