import { useEffect, useState } from 'react';
import { Button } from './controls';
import './tour.css';

// A tour of the page in a minute. It is a row below the page, so it covers nothing; the element that it explains has a frame.
// After the user has dismissed or completed it, this browser does not show it again, unless the user starts it.

interface Stop {
  at: string; // selector of the element
  title: string;
  text: string;
}

const stops: Stop[] = [
  { at: '.top nav a[href="/"]', title: 'Line', text: 'A card or row for each axis: where it is, its state, and the usual commands. Below, the buses.' },
  { at: '.button.stop', title: 'STOP', text: 'Quick stop of all axes, from every page. On the keyboard: Ctrl and space.' },
  { at: '.top nav a[href^="/axis"]', title: 'Axis', text: 'Moves, jogging and homing, the state machine, controlword and statusword bit by bit. Point at a bit or a state to see what the standard says.' },
  { at: '.top nav a[href^="/commission"]', title: 'Commission', text: 'A new axis step by step, from its identity to its first cycle, with a report. Everything is shown before it is written, and can be undone.' },
  { at: '.top nav a[href^="/scope"]', title: 'Scope', text: 'Curves of any object up to 16 kHz, with trigger, cursors and Bode plot.' },
  { at: '.top nav a[href^="/faults"]', title: 'Faults', text: 'Active faults with causes and remedies, and the half second before each one.' },
  { at: '.top nav a[href^="/objects"]', title: 'Objects', text: 'The whole dictionary of a drive, its parameters as a file, and its process data.' },
];

const key = 'servodrome.tour';
const mark = 'tour-here';

function isOver(): boolean {
  try {
    return localStorage.getItem(key) !== null;
  } catch {
    return true; // without storage the browser would show the tour each time
  }
}

const begin = 'servodrome-tour';
export const startTour = () => dispatchEvent(new Event(begin));

export function Tour() {
  const [at, setAt] = useState<number | null>(() => (isOver() ? null : 0));
  useEffect(() => {
    const restart = () => setAt(0);
    addEventListener(begin, restart);
    return () => removeEventListener(begin, restart);
  }, []);
  useEffect(() => {
    if (at === null) return;
    const element = document.querySelector(stops[at].at);
    element?.classList.add(mark);
    element?.scrollIntoView({ block: 'nearest', inline: 'nearest' });
    return () => element?.classList.remove(mark);
  });
  if (at === null) return null;
  const end = () => {
    localStorage.setItem(key, 'over');
    setAt(null);
  };
  const { title, text } = stops[at];
  const isLast = at === stops.length - 1;
  return (
    <aside className="tour" aria-label="Tour of the page">
      <p aria-live="polite"><strong>{title}</strong> {text}</p>
      <span className="quiet">{at + 1} of {stops.length}</span>
      <div className="buttons">
        {at > 0 && <Button onPress={() => setAt(at - 1)}>Back</Button>}
        {!isLast && <Button kind="main" onPress={() => setAt(at + 1)}>Next</Button>}
        <Button kind={isLast ? 'main' : 'bare'} onPress={end}>{isLast ? 'End the tour' : 'No tour'}</Button>
      </div>
    </aside>
  );
}
