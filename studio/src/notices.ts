import { useSyncExternalStore } from 'react';
import { ApiError, axisOf, problemOf } from './api/client';
import type { Problem } from './api/types';
import { shownOf } from './model/problem';

// Notices at the foot of the page, about errors and successes. They disappear when dismissed, or after some seconds.

export interface Notice extends Problem {
  id: number;
  bad: boolean;
  axis?: string | undefined; // of the request that failed
  path?: string | undefined; // of the same request
}

let notices: Notice[] = [];
let next = 1;
const listeners = new Set<() => void>();

function set(to: Notice[]) {
  notices = to;
  listeners.forEach((listener) => listener());
}

export const dismiss = (id: number) => set(notices.filter((notice) => notice.id !== id));

function add(notice: Omit<Notice, 'id'>, seconds: number) {
  const id = next++;
  set([...notices.filter(({ what, where }) => what !== notice.what || where !== notice.where), { ...notice, id }].slice(-4));
  setTimeout(() => dismiss(id), seconds * 1000);
}

// Removes the notices about an axis, since a new command of the axis makes them out of date. The text of a notice about a job
// begins with its axis.
export const forget = (axis: string) => set(notices.filter((notice) => notice.axis !== axis && !notice.what.startsWith(`${axis}: `)));

// Removes the notices about the requests with this path; about all below it, if it ends with a slash.
export function forgetRequests(path: string) {
  const isOver = (notice: Notice) => notice.path === path || (path.endsWith('/') && notice.path?.startsWith(path));
  if (notices.some(isOver)) set(notices.filter((notice) => !isOver(notice)));
}

export function complain(error: unknown) {
  const path = error instanceof ApiError ? error.path : undefined;
  add({ ...shownOf(problemOf(error)), bad: true, path, axis: path && axisOf(path) }, 15);
}
export const complainOf = (problem: Problem) => add({ ...problem, bad: true }, 15);
export const tell = (what: string) => add({ what, bad: false }, 4);

// Runs the action of a button, and shows a notice if it fails.
export function attempt(action: () => Promise<unknown>): void {
  action().catch(complain);
}

export const useNotices = () =>
  useSyncExternalStore(
    (listener) => {
      listeners.add(listener);
      return () => {
        listeners.delete(listener);
      };
    },
    () => notices,
  );
