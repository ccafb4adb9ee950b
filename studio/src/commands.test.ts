import { beforeEach, expect, it, vi } from 'vitest';
import type { Job } from './api/types';

// The server: answers by "METHOD path". `sent` has the requests that begin or end something.
const sent: string[] = [];
let answers: Record<string, () => unknown> = {};

vi.stubGlobal('fetch', async (path: string, { method, body }: { method: string; body?: string }) => {
  const request = `${method} ${path.replace('/api/v1', '')}`;
  if (method !== 'GET') sent.push(body ? `${request} ${body}` : request);
  await Promise.resolve();
  const answer = answers[request]?.();
  return answer === undefined ? new Response('{"error": {"what": "no"}}', { status: 500 }) : new Response(JSON.stringify(answer));
});
vi.stubGlobal('localStorage', { getItem: () => null });

const { cancelJob } = await import('./commands');

const job = (id: number, what: string, state: Job['state'], axis = 'x'): Job => ({ id, axis, do: what, state });
const halt = 'POST /axes/x/jobs {"do":"stop"}';

beforeEach(() => {
  sent.splice(0);
  answers = { 'POST /axes/x/jobs': () => job(9, 'stop', 'running') };
});

it('Cancel ends the job that runs', async () => {
  answers['DELETE /jobs/3'] = () => job(3, 'move', 'running');
  await cancelJob(job(3, 'move', 'running'));
  expect(sent).toEqual(['DELETE /jobs/3']);
});

it('Cancel of a job that is over halts the next job of its sequence', async () => {
  answers['DELETE /jobs/3'] = () => job(3, 'enable', 'done');
  for (const next of [job(4, 'move', 'running'), job(4, 'velocity', 'done')]) {
    sent.splice(0);
    answers['GET /jobs'] = () => ({ jobs: [job(3, 'enable', 'done'), next, job(5, 'move', 'running', 'y')] });
    await cancelJob(job(3, 'enable', 'running'));
    expect(sent).toEqual(['DELETE /jobs/3', halt]);
  }
});

it('Cancel of a job that is over begins no halt if the axis has no later job, or is halted already', async () => {
  answers['DELETE /jobs/3'] = () => job(3, 'move', 'done');
  for (const jobs of [[job(3, 'move', 'done')], [job(3, 'move', 'done'), job(4, 'stop', 'running')], [job(3, 'move', 'done'), job(5, 'move', 'running', 'y')]]) {
    sent.splice(0);
    answers['GET /jobs'] = () => ({ jobs });
    await cancelJob(job(3, 'move', 'running'));
    expect(sent).toEqual(['DELETE /jobs/3']);
  }
});

it('Cancel halts the axis if the later jobs are not known', async () => {
  answers['DELETE /jobs/3'] = () => job(3, 'move', 'done');
  await cancelJob(job(3, 'move', 'running'));
  expect(sent).toEqual(['DELETE /jobs/3', halt]);
});
