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

const { cancelJob, takeBack, untilHalted } = await import('./commands');

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

it('Cancel of a job that is over begins no halt: the server ends the next jobs of its sequence', async () => {
  answers['DELETE /jobs/3'] = () => job(3, 'move', 'done');
  await cancelJob(job(3, 'move', 'running'));
  expect(sent).toEqual(['DELETE /jobs/3']);
});

it('Cancel halts an axis whose motion continues when its job is done', async () => {
  answers['DELETE /jobs/3'] = () => job(3, 'velocity', 'done');
  await cancelJob(job(3, 'velocity', 'running'));
  expect(sent).toEqual(['DELETE /jobs/3', halt]);
});

it('Cancel halts the axis if the server does not end the job', async () => {
  await cancelJob(job(3, 'move', 'running'));
  expect(sent).toEqual(['DELETE /jobs/3', halt]);
});

it('a halt ends a series of writes after the present one', async () => {
  const written: number[] = [];
  const series = untilHalted('x', [1, 2, 3], async (value) => {
    written.push(value);
    if (value === 2) takeBack('x');
    await Promise.resolve();
  });
  await expect(series).rejects.toThrow('2 of 3 values are written');
  expect(written).toEqual([1, 2]);
  await untilHalted('x', [1], () => {
    takeBack('y');
    return Promise.resolve();
  });
});
