import { useState } from 'react';
import { problemOf } from '../api/client';
import type { Problem } from '../api/types';
import { useLiveValue } from '../live_values';
import type { Widget } from '../model/boards';
import { Toggle, Trouble } from '../parts/controls';
import { useObject } from './object';
import { writeTo } from './slider';

// Shows the value that the drive has, so a switch that the drive refuses stays where it was.
export function SwitchWidget({ widget }: { widget: Widget }) {
  const text = String(widget.object);
  const { value } = useLiveValue(text);
  const about = useObject(text);
  const [problem, setProblem] = useState<Problem>();
  const [busy, setBusy] = useState(false);
  const set = (on: boolean) => {
    setBusy(true);
    setProblem(undefined);
    writeTo(text, Number(on ? widget.on : widget.off))
      .catch((error: unknown) => setProblem(problemOf(error)))
      .finally(() => setBusy(false));
  };
  const known = value === widget.on || value === widget.off;
  return (
    <>
      <Toggle isSelected={value === widget.on} isDisabled={busy || typeof value !== 'number'} onChange={set}>{text.replace('/', ' ')} {about?.name}</Toggle>
      {typeof value === 'number' && !known && <p className="quiet">the drive has {value}</p>}
      <Trouble problem={problem} />
    </>
  );
}
