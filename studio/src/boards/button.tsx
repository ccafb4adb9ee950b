import { useState } from 'react';
import { haltAnd, isHalt, runJob } from '../commands';
import { jobs, type Widget } from '../model/boards';
import { motionHindrance } from '../model/cia402';
import { Button, HaltButton } from '../parts/controls';
import { JogButton } from '../parts/jog';
import { useHindrance } from '../parts/reach';
import { StateChip } from '../parts/state';
import { useAxis, useLine } from '../store';

const motions = ['home', 'move', 'jog'];
const numbers = ['by', 'to', 'velocity', 'acceleration', 'method'];

// Every motion is a job of the server, as on the page of the axis.
export function ButtonWidget({ widget }: { widget: Widget }) {
  const name = String(widget.axis);
  const what = String(widget.do);
  const axis = useAxis(name);
  const job = useLine((line) => line.jobs[name]);
  const [busy, setBusy] = useState(false);
  const { by, to } = widget;
  const far = useHindrance(name, what !== 'move' ? null : typeof by === 'number' ? { by } : typeof to === 'number' ? { to } : null);
  const given = Object.fromEntries(numbers.flatMap((key) => (widget[key] === undefined ? [] : [[key, widget[key]] as const])));
  const { acceleration } = given;
  const request = { ...given, ...(acceleration === undefined || what !== 'move' ? {} : { deceleration: acceleration }), units: 'revolutions' };
  const text = widget.title || `${jobs.find(([id]) => id === what)?.[1] ?? what} ${name}`;
  const press = () => {
    setBusy(true);
    const run = motions.includes(what) ? haltAnd(name, { do: what, ...request }) : runJob(name, { do: what });
    void run.finally(() => setBusy(false));
  };
  if (!axis) return <p className="refusal" role="status">There is no axis "{name}".</p>;
  const reason = motions.includes(what) ? motionHindrance(axis) : '';
  const isEnabled = axis.state === 'operation enabled';
  return (
    <>
      {what === 'jog' ? (
        <JogButton axis={name} velocity={{ velocity: widget.velocity, units: 'revolutions', ...(acceleration === undefined ? {} : { acceleration, deceleration: acceleration }) }} isDisabled={reason !== '' || !isEnabled} title={reason || (isEnabled ? '' : 'Enable the axis first.')} label={text}>
          {text}
        </JogButton>
      ) : isHalt(what) ? (
        <HaltButton kind={what === 'disable' ? 'main' : 'bad'} onHalt={press}>{text}</HaltButton>
      ) : (
        <Button kind="main" title={reason} isDisabled={busy || reason !== '' || far !== ''} onPress={press}>{text}</Button>
      )}
      {far && <p className="refusal" role="status">{far}</p>}
      <p className="job">
        <span className="quiet">{name}</span> <StateChip axis={axis} />
        {job?.state === 'running' && <span className="busy">{job.do.replaceAll('_', ' ')}</span>}
      </p>
    </>
  );
}
