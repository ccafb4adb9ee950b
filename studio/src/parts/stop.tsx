import { useEffect } from 'react';
import { post } from '../api/client';
import { takeBackAll } from '../commands';
import { StopChord } from '../model/stop_chord';
import { complain, tell } from '../notices';
import { HaltButton } from './controls';

interface Stopped {
  axes: { name: string; stopped: boolean; error?: { what: string } }[];
}

async function stopAll() {
  takeBackAll();
  dispatchEvent(new Event('stopall')); // scripts of this page end, also between two of their jobs
  const { axes } = await post<Stopped>('/stop');
  const failed = axes.filter(({ stopped }) => !stopped);
  if (failed.length > 0) {
    throw new Error(`not stopped: ${failed.map(({ name, error }) => `${name} (${error?.what ?? 'no reason given'})`).join(', ')}`);
  }
  tell('all axes stopped');
}

// Quick stop of all axes, by the button or by Ctrl+Space anywhere on the page.
export function StopButton() {
  useEffect(() => {
    const chord = new StopChord();
    const onKey = (event: KeyboardEvent) => {
      const { stops, isTaken } = chord.key(event);
      if (isTaken) {
        // The listener runs in the capture phase, before the focused control, which would react to Space and stop the event.
        event.preventDefault();
        event.stopPropagation();
      }
      if (stops) stopAll().catch(complain);
    };
    const onBlur = () => chord.reset();
    const kinds = ['keydown', 'keyup'] as const;
    for (const kind of kinds) addEventListener(kind, onKey, true);
    addEventListener('blur', onBlur);
    return () => {
      for (const kind of kinds) removeEventListener(kind, onKey, true);
      removeEventListener('blur', onBlur);
    };
  }, []);
  return (
    <HaltButton className="stop" aria-keyshortcuts="Control+Space" onHalt={() => void stopAll().catch(complain)}>
      STOP
    </HaltButton>
  );
}
