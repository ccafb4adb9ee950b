import { fields } from './token';
import { Turns } from './turns';
import type { Problem } from './types';

// A request that the server refused or did not answer. `problem` has the text for the user: what, where, what to do.
export class ApiError extends Error {
  constructor(
    readonly status: number,
    readonly problem: Problem,
    readonly path: string,
  ) {
    super(problem.what);
  }
}

const root = '/api/v1';
const patience_ms = 10_000;

export const segment = encodeURIComponent;

// The axis of a request; undefined: it is not for one axis.
export function axisOf(path: string): string | undefined {
  const name = /^\/axes\/([^/?]+)/.exec(path)?.[1];
  return name === undefined ? undefined : decodeURIComponent(name);
}

export async function call<T = unknown>(method: string, path: string, body?: unknown, signal?: AbortSignal): Promise<T> {
  const text = await send(method, path, (response) => response.text(), body, 'application/json', signal);
  return (text === '' ? undefined : JSON.parse(text)) as T;
}

export const get = <T>(path: string) => call<T>('GET', path);
export const put = <T = unknown>(path: string, body: unknown, signal?: AbortSignal) => call<T>('PUT', path, body, signal);
export const post = <T = unknown>(path: string, body: unknown = {}, signal?: AbortSignal) => call<T>('POST', path, body, signal);
export const remove = <T = unknown>(path: string, body?: unknown) => call<T>('DELETE', path, body);

// Sends `text` as text/plain, for example a parameter file.
export async function callText<T>(method: string, path: string, text: string): Promise<T> {
  return send(method, path, (response) => response.json() as Promise<T>, text, 'text/plain');
}

export async function getBytes(path: string): Promise<ArrayBuffer> {
  return send('GET', path, (response) => response.arrayBuffer());
}

// A browser opens at most 6 connections to a server and queues further requests. Reads use at most 4 of them, so that a
// STOP or a halt is sent at once.
const reads = new Turns(4);

// `signal` aborts the request.
async function send<T>(method: string, path: string, read: (response: Response) => Promise<T>, body?: unknown, type = 'application/json', signal?: AbortSignal): Promise<T> {
  const patience = AbortSignal.timeout(patience_ms);
  const until = signal ? AbortSignal.any([signal, patience]) : patience;
  const exchange = async () => {
    const response = await fetch(root + path, {
      method,
      signal: until,
      headers: { ...fields(), ...(body === undefined ? {} : { 'Content-Type': type }) },
      ...(body === undefined ? {} : { body: typeof body === 'string' ? body : JSON.stringify(body) }),
    });
    if (response.ok) return read(response);
    const answer = (await response.json().catch(() => ({}))) as { error?: Problem };
    throw new ApiError(response.status, answer.error ?? { what: `the server answered with HTTP status ${response.status}`, where: path }, path);
  };
  try {
    return await (method === 'GET' ? reads.run(exchange, until) : exchange());
  } catch (error) {
    if (error instanceof ApiError) throw error;
    if (signal?.aborted) throw new ApiError(0, { what: 'the command was taken back by a later halt, controlword or STOP', where: path }, path);
    throw new ApiError(0, { what: 'the server does not answer', where: path, hint: 'check that it still runs and that the network is connected' }, path);
  }
}

export function problemOf(error: unknown): Problem {
  if (error instanceof ApiError) return error.problem;
  return { what: error instanceof Error ? error.message : String(error) };
}
