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

const forgotten: string[] = [];
vi.mock('./notices', async (original) => ({ ...(await original<object>()), forget: (axis: string) => forgotten.push(axis) }));

const { cancelJob, power, startJob, takeBack, takeBackAll, untilHalted, writeObject } = await import('./commands');
const { noteJob, snapshot, update } = await import('./store');

const job = (id: number, what: string, state: Job['state'], axis = 'x'): Job => ({ id, axis, do: what, state });
const halt = 'POST /axes/x/jobs {"do":"stop"}';

beforeEach(() => {
  sent.splice(0);
  forgotten.splice(0);
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

it('every command makes what is shown about earlier commands of the axis out of date', async () => {
  const commands: (() => unknown)[] = [() => power('x', 'cycle'), () => writeObject('x', 0x6040, 0, 6), () => takeBackAll(), () => startJob('x', { do: 'enable' }), () => cancelJob(job(1, 'move', 'running'))];
  answers = { ...answers, 'DELETE /jobs/1': () => job(1, 'move', 'cancelled'), 'POST /axes/x/power': () => ({}), 'PUT /axes/x/objects/6040/0': () => ({}) };
  for (const [i, act] of commands.entries()) {
    update({ order: ['x', 'y'], jobs: { x: job(i + 1, 'move', 'failed') }, outdated: {} });
    forgotten.splice(0);
    await act();
    expect(forgotten).toContain('x');
    expect(snapshot().outdated).toMatchObject({ x: i + 1 });
  }
  // A job that runs has its outcome later; the write of a parameter is no command.
  update({ jobs: { x: job(7, 'move', 'running') }, outdated: {} });
  await power('x', 'cycle');
  expect(snapshot().outdated).toEqual({});
  noteJob(job(7, 'move', 'failed'));
  forgotten.splice(0);
  answers['PUT /axes/x/objects/6081/0'] = () => ({});
  await writeObject('x', 0x6081, 0, 5);
  expect(forgotten).toEqual([]);
});
