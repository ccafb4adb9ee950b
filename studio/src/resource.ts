import { useCallback, useEffect, useRef, useState } from 'react';
import { get, problemOf } from './api/client';
import type { Problem } from './api/types';
import { useLine } from './store';

export interface Resource<T> {
  value: T | undefined;
  problem: Problem | undefined;
  again: () => void;
}

const retry_ms = 5000;

// The answer of a GET. The request is repeated every `every_ms` if that is given, after again(), after a restart of the
// server, and as long as it fails, so that a problem disappears when its cause is gone. A part of `path` behind # is not sent:
// with another such part the request is repeated, and the earlier answer does not count.
export function useResource<T>(path: string | null, every_ms = 0): Resource<T> {
  const epoch = useLine((line) => line.epoch);
  const [answer, setAnswer] = useState<{ path: string; value?: T; problem?: Problem }>();
  const [asked, setAsked] = useState(0);
  const latest = useRef('');

  useEffect(() => {
    if (path === null) return;
    let over = false;
    let timer: ReturnType<typeof setTimeout>;
    const ask = () => {
      get<T>(path)
        .then(
          (value) => {
            // An unchanged answer causes no rendering.
            const text = path + JSON.stringify(value);
            if (!over && text !== latest.current) {
              latest.current = text;
              setAnswer({ path, value });
            }
          },
          (error: unknown) => {
            latest.current = '';
            if (!over) setAnswer((before) => ({ path, problem: problemOf(error), ...(before?.path === path && before.value !== undefined ? { value: before.value } : {}) }));
          },
        )
        .finally(() => {
          const wait_ms = every_ms > 0 ? every_ms : latest.current === '' ? retry_ms : 0;
          if (!over && wait_ms > 0) timer = setTimeout(ask, document.hidden ? 4 * wait_ms : wait_ms);
        });
    };
    ask();
    return () => {
      over = true;
      clearTimeout(timer);
    };
  }, [path, every_ms, asked, epoch]);

  const again = useCallback(() => setAsked((n) => n + 1), []);
  const present = answer?.path === path ? answer : undefined;
  return { value: present?.value, problem: present?.problem, again };
}
