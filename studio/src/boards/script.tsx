import { useEffect, useRef, useState } from 'react';
import { problemOf } from '../api/client';
import type { Job } from '../api/types';
import { endJob, finish, startJob, takeBack } from '../commands';
import type { Widget } from '../model/boards';
import { shownOf } from '../model/problem';
import { axesOf, parseSequence, Sequence, type Step } from '../model/sequence';
import { Button, HaltButton, Scroll } from '../parts/controls';
import { hindranceNow } from '../parts/reach';
import { snapshot } from '../store';
import { writeTo } from './slider';

type Outcome = { kind: 'none' | 'running' | 'done'; text: string } | { kind: 'failed'; text: string };

const sleep = (ms: number, signal: AbortSignal) =>
  new Promise<void>((resolve) => {
    const timer = setTimeout(resolve, ms);
    signal.addEventListener('abort', () => {
      clearTimeout(timer);
      resolve();
    });
  });

// A script runs in this page. When the page is closed, it ends before the next command. STOP on any page ends it as well.
export function ScriptWidget({ widget }: { widget: Widget }) {
  const source = String(widget.lines);
  const { steps } = parseSequence(source);
  const [at, setAt] = useState<Step | null>(null);
  const [outcome, setOutcome] = useState<Outcome>({ kind: 'none', text: '' });
  const sequence = useRef<Sequence | null>(null);
  const stop = () => sequence.current?.stop();
  useEffect(() => {
    addEventListener('stopall', stop);
    addEventListener('pagehide', stop);
    return () => {
      stop();
      removeEventListener('stopall', stop);
      removeEventListener('pagehide', stop);
    };
  }, []);
  const run = async () => {
    if (sequence.current) return;
    let line = 0;
    const made = new Sequence(steps, {
      start: startJob,
      hindrance: async (axis, { do: what, by, to }) =>
        what !== 'move' ? '' : typeof by === 'number' ? hindranceNow(axis, { by }) : typeof to === 'number' ? hindranceNow(axis, { to }) : '',
      finish: (job) => finish(job as Job),
      cancel: (job) => endJob(job as Job),
      latest: (axis) => (snapshot().jobs[axis] as Job | undefined)?.id,
      write: (axis, object, value) => writeTo(`${axis}/${object}`, value),
      sleep,
      at: (step) => {
        line = step.line;
        setAt(step);
      },
    });
    sequence.current = made;
    setOutcome({ kind: 'running', text: 'running' });
    try {
      await made.run();
      setOutcome({ kind: 'done', text: 'done' });
    } catch (error) {
      setOutcome({ kind: 'failed', text: `${line > 0 ? `line ${line}: ` : ''}${shownOf(problemOf(error)).what}` });
    } finally {
      sequence.current = null;
      setAt(null);
    }
  };
  const isRunning = outcome.kind === 'running';
  const halt = () => {
    stop();
    axesOf(steps).forEach(takeBack);
  };
  return (
    <>
      <Scroll label="Script" className="script-box">
        <ol className="script">
          {source.split('\n').map((text, i) => (
            <li key={i} aria-current={at?.line === i + 1 ? 'step' : undefined}><code>{text || ' '}</code></li>
          ))}
        </ol>
      </Scroll>
      <div className="buttons">
        <Button kind="main" isDisabled={isRunning} onPress={() => void run()}>Run</Button>
        <HaltButton isDisabled={!isRunning} onHalt={halt}>Stop the script</HaltButton>
        <span className={outcome.kind === 'failed' ? 'refusal' : 'quiet'} role="status">{isRunning && at ? `line ${at.line}` : outcome.text}</span>
      </div>
    </>
  );
}
