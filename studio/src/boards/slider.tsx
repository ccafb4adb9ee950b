import { useEffect, useId, useRef, useState } from 'react';
import { problemOf } from '../api/client';
import type { Problem } from '../api/types';
import { onTakenBack, writeObject } from '../commands';
import { useLiveValue } from '../live_values';
import type { Widget } from '../model/boards';
import { Paced } from '../model/paced';
import { shownOf } from '../model/problem';
import { channelOf } from '../model/scope';
import { significant } from '../model/units';
import { Trouble } from '../parts/controls';
import { NumberInput } from '../parts/number_input';
import { useObject } from './object';

export const writesPerSecond = 10;

// Writes "AXIS/6083:00".
export function writeTo(text: string, value: number): Promise<unknown> {
  const { axis, object = '' } = channelOf(text)!;
  const [index, sub] = object.split(':').map((digits) => parseInt(digits, 16));
  return writeObject(axis, index, sub, value);
}

export function SliderWidget({ widget }: { widget: Widget }) {
  const text = String(widget.object);
  const [minimum, maximum, step] = [widget.minimum, widget.maximum, widget.step].map(Number);
  const { value } = useLiveValue(text);
  const about = useObject(text);
  const [wanted, setWanted] = useState<number | null>(null); // the value that the user chose, until the drive accepts or refuses it
  const [problem, setProblem] = useState<Problem>();
  const paced = useRef<Paced>();
  useEffect(() => {
    const made = new Paced(writesPerSecond, {
      write: (to) => writeTo(text, to),
      done: () => setProblem(undefined),
      // The drive keeps its value, and the slider goes back to it.
      failed: (error, to) => {
        const { what, hint } = shownOf(problemOf(error));
        setProblem({ what: `${significant(to)}: ${what}`, ...(hint ? { hint } : {}) });
        setWanted(null);
      },
    });
    paced.current = made;
    // At STOP, and at a halt of its axis, the waiting value is not written, and the slider goes back to the value of the drive.
    const forget = onTakenBack((axis) => {
      if (axis !== null && axis !== channelOf(text)?.axis) return;
      made.drop();
      setWanted(null);
    });
    return () => {
      forget();
      made.drop();
    };
  }, [text]);
  useEffect(() => {
    if (wanted !== null && value === wanted) setWanted(null);
  }, [value, wanted]);
  const set = (to: number) => {
    setWanted(to);
    paced.current?.push(to);
  };
  const present = typeof value === 'number' ? value : NaN;
  const shown = wanted ?? present;
  const id = useId();
  const label = `${text.replace('/', ' ')} ${about?.name ?? ''}`.trim();
  const isKnown = Number.isFinite(shown);
  return (
    <>
      <label className="quiet" htmlFor={id}>{label}</label>
      <input
        id={id} className="slider" type="range" min={minimum} max={maximum} step={step} value={isKnown ? shown : minimum} disabled={!isKnown}
        aria-valuetext={isKnown ? `${significant(shown)} ${about?.unit ?? ''}`.trim() : 'not known'} onChange={(event) => set(Number(event.target.value))}
      />
      <div className="written">
        <NumberInput whenLeft hideLabel label={`Value of ${label}`} value={shown} minimum={minimum} maximum={maximum} step={step} unit={about?.unit || undefined} isDisabled={!isKnown} onChange={set} />
        <span className="quiet" role="status">drive: {Number.isFinite(present) ? significant(present) : '–'}</span>
      </div>
      <Trouble problem={problem} />
    </>
  );
}
