import { useEffect, useRef, useState } from 'react';
import { get, post, problemOf, segment } from '../api/client';
import type { ObjectValue, Problem } from '../api/types';
import { authorsOf, type Change, type ChangesAnswer, matches, said, type UndoReport, withAnswer } from '../model/changes';
import { showValue } from '../model/objects';
import { Button, Choice, Link, Panel, Scroll, Search, Trouble } from '../parts/controls';
import { fixed } from '../model/units';
import { complain } from '../notices';
import { keep, useRoute } from '../route';
import { useProject } from '../storage';
import { useLine } from '../store';

const ask_every_ms = 500;
const most_per_answer = 1000;
const most_shown = 300; // rows of the table

// The page shows the change log of a drive with the author of each write, follows it live, and undoes changes.
export function ChangesView({ name }: { name: string }) {
  const { query } = useRoute();
  const text = query.get('q') ?? '';
  const who = query.get('who') ?? '';
  const { changes: present, dropped, problem } = useChanges(name);
  const earlier = useEarlierChanges(name);
  const changes = [...earlier, ...present];
  const [report, setReport] = useState<UndoReport>();
  const [refused, setRefused] = useState<Problem>();
  const [busy, setBusy] = useState(false);
  const shown = changes.filter((change) => matches(change, text, who)).reverse();

  const undo = (what: { number: number } | { axis: string; who?: string }) => {
    setBusy(true);
    setReport(undefined);
    setRefused(undefined);
    post<UndoReport>('/changes/undo', what)
      .then(setReport, (error: unknown) => setRefused(problemOf(error)))
      .finally(() => setBusy(false));
  };
  const link = `/objects/${segment(name)}`;
  return (
    <Panel title="Changes" aside={<span className="quiet" role="status">{shown.length} of {changes.length}</span>}>
      <p className="note">
        Every object that this page, a job, a script or another master wrote, with the value before and after. The words of a motion
        (controlword, targets) and process data are left out. <Link to={`${link}?view=parameters`}>Parameters</Link> compares the drive with
        the factory values, the stored values or a file.
      </p>
      <div className="toolbar">
        <Search label="Filter by object, name or author" value={text} onChange={(q) => keep({ q })} />
        <Choice label="Author" value={who} options={[['', 'all'], ...authorsOf(changes).map((each) => [each, each] as const)]} onChange={(to) => keep({ who: to })} />
        <Button isDisabled={busy || present.length === 0} onPress={() => undo({ axis: name, ...(who === '' ? {} : { who }) })}>
          {who === '' ? 'Undo all' : 'Undo all of this author'}
        </Button>
      </div>
      <Trouble problem={refused ?? problem} />
      {report && <Undone report={report} />}
      {shown.length === 0 ? (
        <p className="empty">{changes.length === 0 ? 'Nothing was written yet.' : 'No change fits the filter.'}</p>
      ) : (
        <Scroll label="Table of changes">
          <table className="table">
            <thead>
              <tr>
                <th scope="col">no.</th><th scope="col">time</th><th scope="col">object</th><th scope="col" className="wide">name</th>
                <th scope="col">before</th><th scope="col">after</th><th scope="col" className="wide">unit</th><th scope="col" className="wide">who</th>
                <th scope="col"><span className="unseen">undo</span></th>
              </tr>
            </thead>
            <tbody>
              {shown.slice(0, most_shown).map((change) => (
                <Row key={change.number} change={change} link={link} isDisabled={busy} {...(change.number < (present[0]?.number ?? Infinity) ? {} : { onUndo: () => undo({ number: change.number }) })} />
              ))}
            </tbody>
          </table>
        </Scroll>
      )}
      <p className="note">
        {shown.length > most_shown && `The table shows the newest ${most_shown}. `}
        {earlier.length > 0 && 'The changes without "Undo" are from earlier runs of the server; the file changes.jsonl of the project has all. '}
        {dropped > 0 && `The server no longer has the oldest ${fixed(dropped, 0)} changes of the line.`}
      </p>
    </Panel>
  );
}

const timeOf = (wall: string, withDate: boolean) => (withDate ? new Date(wall).toLocaleString('en-GB') : new Date(wall).toLocaleTimeString('en-GB'));
const textOf = (value: ObjectValue | null, change: Change) => (value === null ? <span className="quiet">not known</span> : showValue(value, change));

function Row({ change, link, isDisabled, onUndo }: { change: Change; link: string; isDisabled: boolean; onUndo?: () => void }) {
  const { number, wall, time_ns, object, name, before, after, unit, who } = change;
  return (
    <tr>
      <td className="text">{number}</td>
      <td title={`${wall}, ${(time_ns / 1e9).toFixed(3)} s of the line`}>{timeOf(wall, !onUndo)}</td>
      <th scope="row" className="mono"><Link to={`${link}?object=${object}&q=${object}`}>{object}</Link></th>
      <td className="text">{name}</td>
      <td>{textOf(before, change)}</td>
      <td>{textOf(after, change)}</td>
      <td className="text">{unit}</td>
      <td className="text">{who}</td>
      <td>{onUndo && <Button kind="bare" isDisabled={isDisabled} aria-label={`Undo change ${number}`} onPress={onUndo}>Undo</Button>}</td>
    </tr>
  );
}

function Undone({ report }: { report: UndoReport }) {
  return (
    <div className="report" role="status">
      <p>{said(report)}</p>
      {report.kept.length > 0 && (
        <ul className="plain-list">
          {report.kept.map(({ number, object, name, what, hint }) => (
            <li key={number}><span className="mono">{object}</span> {name} stays: {what}; {hint}</li>
          ))}
        </ul>
      )}
    </div>
  );
}

// The changes of earlier runs of the server, which are in the project if there is one.
function useEarlierChanges(axis: string): readonly Change[] {
  const project = useProject();
  const epoch = useLine((line) => line.epoch);
  const folder = project?.folder;
  const [changes, setChanges] = useState<readonly Change[]>([]);
  useEffect(() => {
    let over = false;
    setChanges([]);
    if (folder === undefined) return;
    get<{ changes: Change[] }>(`/project/changes?axis=${segment(axis)}`).then((answer) => !over && setChanges(answer.changes), complain);
    return () => {
      over = true;
    };
  }, [axis, epoch, folder]);
  return changes;
}

function useChanges(axis: string) {
  const epoch = useLine((line) => line.epoch);
  const [state, setState] = useState<{ epoch: number; changes: readonly Change[]; dropped: number }>({ epoch, changes: [], dropped: 0 });
  const [problem, setProblem] = useState<Problem>();
  const next = useRef(0);

  useEffect(() => {
    let over = false;
    let timer: ReturnType<typeof setTimeout>;
    next.current = 0;
    const ask = () => {
      get<ChangesAnswer>(`/changes?axis=${segment(axis)}&since=${next.current}&limit=${most_per_answer}&newest=${next.current === 0}`)
        .then(
          (answer) => {
            if (over) return;
            next.current = answer.next;
            setProblem(undefined);
            setState((before) => {
              const changes = withAnswer(before.epoch === epoch ? before.changes : [], answer);
              const same = before.epoch === epoch && changes === before.changes && before.dropped === answer.dropped;
              return same ? before : { epoch, changes, dropped: answer.dropped };
            });
          },
          (error: unknown) => !over && setProblem(problemOf(error)),
        )
        .finally(() => {
          if (!over) timer = setTimeout(ask, document.hidden ? 4 * ask_every_ms : ask_every_ms);
        });
    };
    ask();
    return () => {
      over = true;
      clearTimeout(timer);
    };
  }, [axis, epoch]);
  return { ...state, problem };
}
