import { useState } from 'react';
import { put, remove } from '../api/client';
import type { Recording } from '../api/types';
import { isOver } from '../model/scope';
import { fixed } from '../model/units';
import { attempt } from '../notices';
import { keep, keepHere } from '../route';
import { Button, Panel } from './controls';

const nameOf = ({ name, fault, channels }: Recording) =>
  name || (fault ? `fault ${fault.code.slice(2)}h of ${fault.axis}` : channels.map((channel) => channel.name).slice(0, 3).join(', '));

export function Recordings({ recordings, shown, overlays, memory, again }: {
  recordings: Recording[];
  shown: Recording | undefined;
  overlays: string[];
  memory: { bytes?: number } | undefined;
  again: () => void;
}) {
  const lay = (id: string, on: boolean) => keep({ with: (on ? [...overlays, id] : overlays.filter((each) => each !== id)).join(',') });
  const drop = (recording: Recording) =>
    attempt(async () => {
      const keepRecording = keepHere();
      await remove(`/recordings/${recording.id}`);
      if (recording === shown) keepRecording({ rec: null });
      again();
    });
  return (
    <Panel title="Recordings" aside={memory?.bytes !== undefined && <span className="quiet">{fixed(memory.bytes / 1048576, 1)} MiB</span>}>
      {recordings.length === 0 && <p className="empty">None yet.</p>}
      <ul className="recordings">
        {[...recordings].reverse().map((recording) => {
          const id = String(recording.id);
          return (
            <li key={id} className={recording === shown ? 'now' : ''}>
              <button type="button" className="name" title={recording.note} aria-pressed={recording === shown} onClick={() => keep({ rec: id, a: null, b: null, from: null, to: null })}>
                {recording.id} · {nameOf(recording)}
              </button>
              {recording.state !== 'done' && <span className="chip plain">{recording.state}</span>}
              {shown && recording !== shown && isOver(recording) && (
                <label className="over"><input type="checkbox" checked={overlays.includes(id)} onChange={(event) => lay(id, event.target.checked)} /> overlay</label>
              )}
              <Button kind="bare" aria-label={`Delete recording ${id}`} onPress={() => drop(recording)}>×</Button>
            </li>
          );
        })}
      </ul>
      {shown && <About key={shown.id} recording={shown} again={again} />}
    </Panel>
  );
}

// Name and note of the shown recording. The server stores them with the recording, and another page may change them as well. So
// this form writes only the fields that the user has changed.
function About({ recording, again }: { recording: Recording; again: () => void }) {
  const [typed, setTyped] = useState<{ name?: string; note?: string }>({});
  const name = typed.name ?? recording.name;
  const note = typed.note ?? recording.note ?? '';
  const save = () => {
    if (Object.keys(typed).length === 0) return;
    attempt(async () => {
      await put(`/recordings/${recording.id}`, typed);
      again();
      // Text that the user has typed meanwhile stays.
      setTyped((now) => Object.fromEntries(Object.entries(now).filter(([key, text]) => text !== typed[key as keyof typeof typed])));
    });
  };
  return (
    <form className="about" onSubmit={(event) => { event.preventDefault(); save(); }}>
      <label className="field"><span>Name</span><input className="input" value={name} maxLength={100} onChange={(event) => setTyped({ ...typed, name: event.target.value })} onBlur={save} /></label>
      <label className="field"><span>Note</span><textarea className="input" rows={2} value={note} maxLength={4000} onChange={(event) => setTyped({ ...typed, note: event.target.value })} onBlur={save} /></label>
    </form>
  );
}
