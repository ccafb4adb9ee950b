import { afterEach, describe, expect, test, vi } from 'vitest';
import { get, post } from './client';
import { Turns } from './turns';

const never = new AbortController().signal;
const settled = () => new Promise((resolve) => setTimeout(resolve));

describe('turns', () => {
  function tasks(count: number, signals: AbortSignal[] = []) {
    const begun: number[] = [];
    const end: (() => void)[] = [];
    const turns = new Turns(2);
    const all = Array.from({ length: count }, (_, i) =>
      turns.run(() => new Promise<number>((resolve) => {
        begun.push(i);
        end[i] = () => resolve(i);
      }), signals[i] ?? never));
    return { begun, end, all };
  }

  test('begin in their order, as many as are permitted', async () => {
    const { begun, end, all } = tasks(5);
    await settled();
    expect(begun).toEqual([0, 1]);
    end[1]();
    await settled();
    expect(begun).toEqual([0, 1, 2]);
    end[0]();
    end[2]();
    await settled();
    expect(begun).toEqual([0, 1, 2, 3, 4]);
    end[3]();
    end[4]();
    expect(await Promise.all(all)).toEqual([0, 1, 2, 3, 4]);
  });

  test('an aborted task leaves the queue, and does not take the place of another', async () => {
    const given_up = new AbortController();
    const { begun, end, all } = tasks(4, [never, never, given_up.signal]);
    given_up.abort();
    await expect(all[2]).rejects.toThrow();
    end[0]();
    await settled();
    expect(begun).toEqual([0, 1, 3]);
    end[1]();
    end[3]();
    expect(await Promise.all([all[0], all[1], all[3]])).toEqual([0, 1, 3]);
  });

  test('a task that fails gives its place to the next', async () => {
    const turns = new Turns(1);
    await expect(turns.run(() => Promise.reject(new Error('no')), never)).rejects.toThrow('no');
    expect(await turns.run(() => Promise.resolve(1), never)).toBe(1);
  });
});

describe('requests', () => {
  afterEach(() => vi.unstubAllGlobals());

  test('at most four reads are on their way; a STOP waits for none of them', async () => {
    vi.stubGlobal('sessionStorage', { getItem: () => null, setItem: () => undefined });
    vi.stubGlobal('localStorage', { getItem: () => null, setItem: () => undefined });
    const sent: string[] = [];
    const answers: ((response: Response) => void)[] = [];
    vi.stubGlobal('fetch', (path: string, { method }: { method: string }) => {
      sent.push(`${method} ${path}`);
      return new Promise<Response>((resolve) => answers.push(resolve));
    });
    const reads = Array.from({ length: 9 }, (_, i) => get(`/${i}`));
    const stop = post('/stop');
    await settled();
    expect(sent).toEqual([...[0, 1, 2, 3].map((i) => `GET /api/v1/${i}`), 'POST /api/v1/stop']);
    answers[4](new Response('{}'));
    await stop;
    answers[0](new Response('{}'));
    await reads[0];
    await settled();
    expect(sent.at(-1)).toBe('GET /api/v1/4');
    for (let i = 1; i < 10; ++i) {
      await vi.waitFor(() => expect(answers.length).toBeGreaterThan(i));
      answers[i](new Response('{}'));
    }
    await Promise.all(reads);
  });
});
