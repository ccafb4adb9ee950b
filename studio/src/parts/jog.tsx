import { useEffect, useRef, type KeyboardEvent, type ReactNode } from 'react';
import { post } from '../api/client';
import type { Job } from '../api/types';
import { endJob, finish, finishAloud, following, startJob } from '../commands';
import { Jog } from '../model/jog';
import { complain } from '../notices';

// Jogs while it is pressed with the pointer, Space or Enter.
export function JogButton({ axis, velocity, isDisabled, title, children, label }: {
  axis: string;
  velocity: Record<string, unknown>;
  isDisabled: boolean;
  title?: string | undefined;
  children: ReactNode;
  label: string;
}) {
  const request = useRef(velocity);
  request.current = velocity;
  const jog = useRef<Jog<Job>>();
  jog.current ??= new Jog<Job>({
    // The halt is not taken back: the axis rests at the end of each press. It makes the server refuse a jog that comes late.
    start: async (released) => {
      const halted = await finish(await startJob(axis, { do: 'stop' }));
      if (halted.state !== 'done') throw new Error(`${axis}: ${halted.error?.what ?? `the halt is ${halted.state}`}`);
      released.throwIfAborted();
      try {
        const job = await startJob(axis, { do: 'jog', ...request.current, ...following(halted) }, released);
        finishAloud(job).catch(() => undefined); // a lost connection is reported by `alive`
        return job;
      } catch (error) {
        if (released.aborted) await startJob(axis, { do: 'stop' }).catch(complain); // the server may have begun the jog
        throw error;
      }
    },
    alive: async (job) => {
      const now = await post<Job>(`/jobs/${job.id}/alive`);
      return now.state === 'running' && now.ending !== true;
    },
    stop: endJob,
    failed: complain,
  });
  // A browser may report presses of a disabled button.
  const press = () => {
    if (!isDisabled) jog.current?.press();
  };
  const release = () => jog.current?.release();
  // A browser need not report the release of a disabled button.
  useEffect(() => {
    if (isDisabled) jog.current?.release();
  }, [isDisabled]);

  useEffect(() => {
    const onHide = () => jog.current?.release();
    const events = ['blur', 'pagehide', 'pointerup', 'pointercancel', 'stopall'] as const;
    events.forEach((event) => addEventListener(event, onHide));
    // In the capture phase: another listener may take the release of the key from this button. Another key also ends the jog.
    const onKey = (event: globalThis.KeyboardEvent) => {
      if (event.type === 'keyup' || !(event.key === ' ' || event.key === 'Enter')) onHide();
    };
    const keys = ['keydown', 'keyup'] as const;
    keys.forEach((event) => addEventListener(event, onKey, true));
    document.addEventListener('visibilitychange', onHide);
    return () => {
      onHide();
      events.forEach((event) => removeEventListener(event, onHide));
      keys.forEach((event) => removeEventListener(event, onKey, true));
      document.removeEventListener('visibilitychange', onHide);
    };
  }, []);

  const isPress = (event: KeyboardEvent) => event.key === ' ' || event.key === 'Enter';
  return (
    <button
      type="button"
      className="button jog"
      aria-label={label}
      disabled={isDisabled}
      title={title}
      // The press ends when the focus is lost, so the button takes it itself: a browser need not focus a button that is pressed.
      onPointerDown={(event) => {
        if (event.button !== 0) return;
        event.currentTarget.focus();
        press();
      }}
      onMouseDown={(event) => event.preventDefault()}
      onPointerLeave={release}
      onBlur={release}
      onContextMenu={(event) => event.preventDefault()}
      onKeyDown={(event) => {
        if (!isPress(event)) return;
        event.preventDefault();
        if (!event.repeat && !event.ctrlKey) press();
      }}
    >
      {children}
    </button>
  );
}
