import { fields } from './token';
import type { Problem } from './types';

// A request that the server refused or did not answer. `problem` has the text for the user: what, where, what to do.
export class ApiError extends Error {
  constructor(
    readonly status: number,
    readonly problem: Problem,
  ) {
    super(problem.what);
  }
}

const root = '/api/v1';
const patience_ms = 10_000;

export const segment = encodeURIComponent;

export async function call<T = unknown>(method: string, path: string, body?: unknown, signal?: AbortSignal): Promise<T> {
  const response = await send(method, path, body, 'application/json', signal);
  const text = await response.text();
  return (text === '' ? undefined : JSON.parse(text)) as T;
}

export const get = <T>(path: string) => call<T>('GET', path);
export const put = <T = unknown>(path: string, body: unknown) => call<T>('PUT', path, body);
export const post = <T = unknown>(path: string, body: unknown = {}, signal?: AbortSignal) => call<T>('POST', path, body, signal);
export const remove = <T = unknown>(path: string, body?: unknown) => call<T>('DELETE', path, body);

// Sends `text` as text/plain, for example a parameter file.
export async function callText<T>(method: string, path: string, text: string): Promise<T> {
  return (await (await send(method, path, text, 'text/plain')).json()) as T;
}

export async function getBytes(path: string): Promise<ArrayBuffer> {
  return (await send('GET', path)).arrayBuffer();
}

// `signal` takes the request back.
async function send(method: string, path: string, body?: unknown, type = 'application/json', signal?: AbortSignal): Promise<Response> {
  const patience = AbortSignal.timeout(patience_ms);
  let response: Response;
  try {
    response = await fetch(root + path, {
      method,
      signal: signal ? AbortSignal.any([signal, patience]) : patience,
      headers: { ...fields(), ...(body === undefined ? {} : { 'Content-Type': type }) },
      ...(body === undefined ? {} : { body: typeof body === 'string' ? body : JSON.stringify(body) }),
    });
  } catch {
    if (signal?.aborted) throw new ApiError(0, { what: 'the command was taken back by a later halt, controlword or STOP', where: path });
    throw new ApiError(0, { what: 'the server does not answer', where: path, hint: 'check that it still runs and that the network is connected' });
  }
  if (response.ok) return response;
  const answer = (await response.json().catch(() => ({}))) as { error?: Problem };
  throw new ApiError(response.status, answer.error ?? { what: `the server answered with HTTP status ${response.status}`, where: path });
}

export function problemOf(error: unknown): Problem {
  if (error instanceof ApiError) return error.problem;
  return { what: error instanceof Error ? error.message : String(error) };
}
