import { useSyncExternalStore } from 'react';
import { ApiError, get, put, remove, segment } from './api/client';
import type { Problem } from './api/types';
import { complain, complainOf } from './notices';

// The storage of the page's state (dashboards, layouts, the guide): JSON texts by key. They are in the project of the server if
// it has one (docs/project.md), otherwise in the storage of this browser.

export interface Project {
  name: string;
  folder: string;
  problem: Problem | null; // why the server cannot write its files at present
}

const retry_ms = 1000;
let project: Project | null | undefined; // undefined: not known yet
const texts = new Map<string, string>(); // of the project, by name
const unsent = new Map<string, string | null>(); // writes that the server has not got yet; null: removed
const sending = new Set<string>();
const listeners = new Set<() => void>();
const tell = () => listeners.forEach((listener) => listener());

// "servodrome.boards" is the state "boards" of the project.
const nameOf = (key: string) => key.replace(/^servodrome\./, '');

export const readText = (key: string): string | null => (project ? (texts.get(nameOf(key)) ?? null) : localStorage.getItem(key));

// Null removes the text.
export function writeText(key: string, text: string | null): void {
  if (project) {
    const name = nameOf(key);
    if (text === null) texts.delete(name);
    else texts.set(name, text);
    unsent.set(name, text);
    void send(name);
  } else {
    try {
      if (text === null) localStorage.removeItem(key);
      else localStorage.setItem(key, text);
    } catch {
      complainOf({ what: 'the browser did not save it: its storage is full or switched off', where: key, hint: 'export it as a file, or delete data of other pages in the browser' });
    }
  }
  tell();
}

// Sends one request at a time for each name; the last text wins. If the server does not answer, the text waits for the next
// greeting of the server.
async function send(name: string) {
  if (sending.has(name)) return;
  sending.add(name);
  for (let text = unsent.get(name); text !== undefined; text = unsent.get(name)) {
    const path = `/project/state/${segment(name)}`;
    try {
      await (text === null ? remove(path) : put(path, { value: JSON.parse(text) as unknown }));
    } catch (error) {
      complain(error);
      if (error instanceof ApiError && error.status === 0) break;
    }
    if (unsent.get(name) === text) unsent.delete(name);
  }
  sending.delete(name);
}

const isBusy = (name: string) => unsent.has(name) || sending.has(name);

// Calls back when a text has changed: in this page, in another tab or on the server.
export function listenToTexts(listener: () => void) {
  listeners.add(listener);
  addEventListener('storage', listener);
  return () => {
    listeners.delete(listener);
    removeEventListener('storage', listener);
  };
}

// Requests the project of the server. Needed once for each connection; later the stream reports changes.
export async function openProject(): Promise<void> {
  let found: Project | null = null;
  let state: Record<string, unknown> = {};
  try {
    found = (await get<{ project: Project | null }>('/project')).project;
    if (found) state = (await get<{ state: Record<string, unknown> }>('/project/state')).state;
  } catch (error) {
    if (!(error instanceof ApiError) || error.status === 0 || project) {
      if (project === undefined) setTimeout(() => void openProject(), retry_ms); // the page waits for it
      return; // otherwise the next greeting repeats it
    }
  }
  // What was typed while another server ran is not written into this project.
  if (found?.folder !== project?.folder) unsent.clear();
  project = found;
  for (const name of [...texts.keys()]) if (!isBusy(name) && !(name in state)) texts.delete(name);
  for (const [name, value] of Object.entries(state)) if (!isBusy(name)) texts.set(name, JSON.stringify(value));
  for (const name of unsent.keys()) void send(name);
  tell();
}

export interface ProjectEvent {
  state?: string; // name of the text that this or another page has written
  removed?: boolean;
  problem?: Problem | null;
}

export async function noteProject({ state: name, removed, problem }: ProjectEvent): Promise<void> {
  if (!project) return;
  if (problem !== undefined) project = { ...project, problem };
  if (name !== undefined && !isBusy(name)) {
    const before = texts.get(name);
    const text = removed ? undefined : JSON.stringify((await get<{ value: unknown }>(`/project/state/${segment(name)}`)).value);
    if (isBusy(name) || texts.get(name) !== before) return; // this page has changed it meanwhile
    if (text === undefined) texts.delete(name);
    else texts.set(name, text);
  }
  tell();
}

// Undefined until the server has answered.
export const useProject = () => useSyncExternalStore(listenToTexts, () => project);

// For sentences such as "kept in this browser".
export const placeOf = (of: Project | null | undefined) => (of ? `the project "${of.name}"` : 'this browser');
