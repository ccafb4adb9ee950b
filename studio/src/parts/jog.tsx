import { useEffect, useRef, type KeyboardEvent, type ReactNode } from 'react';
import { post } from '../api/client';
import type { Job } from '../api/types';
import { endJob, startJob } from '../commands';
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
    start: () => startJob(axis, { do: 'jog', ...request.current }),
    alive: (job) => post(`/jobs/${job.id}/alive`),
    stop: endJob,
    failed: complain,
  });
  // A browser may report presses of a disabled button.
  const press = () => {
    if (!isDisabled) jog.current?.press();
  };
  const release = () => jog.current?.release();

  useEffect(() => {
    const onHide = () => jog.current?.release();
    const events = ['blur', 'pagehide', 'pointerup', 'pointercancel'] as const;
    events.forEach((event) => addEventListener(event, onHide));
    document.addEventListener('visibilitychange', onHide);
    return () => {
      onHide();
      events.forEach((event) => removeEventListener(event, onHide));
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
      onPointerDown={(event) => {
        if (event.button === 0) press();
      }}
      onPointerLeave={release}
      onBlur={release}
      onContextMenu={(event) => event.preventDefault()}
      onKeyDown={(event) => {
        if (!isPress(event)) return;
        event.preventDefault();
        if (!event.repeat && !event.ctrlKey) press();
      }}
      onKeyUp={(event) => isPress(event) && release()}
    >
      {children}
    </button>
  );
}
