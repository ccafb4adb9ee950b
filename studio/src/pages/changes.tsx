import { useEffect, useRef, useState } from 'react';
import { get, post, problemOf, segment } from '../api/client';
import type { ObjectValue, Problem } from '../api/types';
import { authorsOf, type Change, type ChangesAnswer, foretold, matches, said, type UndoReport, withAnswer } from '../model/changes';
import { showValue } from '../model/objects';
import { Button, Choice, Link, Panel, Scroll, Search, Toggle, Trouble } from '../parts/controls';
import { fixed } from '../model/units';
import { complain } from '../notices';
import { keep, useRoute } from '../route';
import { useProject } from '../storage';
import { useLine } from '../store';

const ask_every_ms = 500;
const most_per_answer = 1000;
const most_shown = 300; // rows of the table

type Undo = { axis: string; who?: string } | { all: true; who?: string };

// What an undo of several changes would write, and the request that writes it.
interface Plan {
  report: UndoReport;
  request: Undo & { until: number; only: number[] };
}

// The page shows the change log of a drive or of all drives with the author of each write, follows it live, and undoes
// changes.
export function ChangesView({ name }: { name: string }) {
  const { query } = useRoute();
  const text = query.get('q') ?? '';
  const who = query.get('who') ?? '';
  const all = query.get('drives') === 'all';
  const axis = all ? null : name;
  const epoch = useLine((line) => line.epoch);
  const { changes: present, dropped, problem } = useChanges(axis);
  const earlier = useEarlierChanges(axis);
  const changes = [...earlier, ...present];
  const [plan, setPlan] = useState<Plan>();
  const [report, setReport] = useState<UndoReport>();
  const [refused, setRefused] = useState<Problem>();
  const [busy, setBusy] = useState(false);
  const shown = changes.filter((change) => matches(change, text, who)).reverse();

  useEffect(() => setPlan(undefined), [axis, who, epoch]);

  const ask = (what: object, then: (report: UndoReport) => void) => {
    setBusy(true);
    setPlan(undefined);
    setReport(undefined);
    setRefused(undefined);
    post<UndoReport>('/changes/undo', what)
      .then(then, (error: unknown) => setRefused(problemOf(error)))
      .finally(() => setBusy(false));
  };
  // Nothing is written that the user has not seen in the list.
  const propose = () => {
    const what: Undo = { ...(all ? { all } : { axis: name }), ...(who === '' ? {} : { who }) };
    ask({ ...what, preview: true }, (found) =>
      found.undone.length === 0 ? setReport(found) : setPlan({ report: found, request: { ...what, until: found.until, only: found.undone.map(({ number }) => number) } }),
    );
  };
  return (
    <Panel title="Changes" aside={<span className="quiet" role="status">{shown.length} of {changes.length}</span>}>
      <p className="note">
        Every object that this page, a job, a program or a master on a bus wrote, with the value before and after. A message on a bus does not
        contain its sender, so the log then names the bus: that may be a PLC or <code>servodrome set</code>. The words of a motion (controlword,
        targets) and process data are left out. <Link to={`/objects/${segment(name)}?view=parameters`}>Parameters</Link> compares the drive
        with the factory values, the stored values or a file.
      </p>
      <div className="toolbar">
        <Search label="Filter by object, name or author" value={text} onChange={(q) => keep({ q })} />
        <Choice label="Author" value={who} options={[['', 'all'], ...authorsOf(changes).map((each) => [each, each] as const)]} onChange={(to) => keep({ who: to })} />
        <Toggle isSelected={all} onChange={(on) => keep({ drives: on ? 'all' : null })}>all drives</Toggle>
        <Button isDisabled={busy || present.length === 0} onPress={propose}>
          Undo all{all && ' of all drives'}{who !== '' && ' by this author'}
        </Button>
      </div>
      <Trouble problem={refused ?? problem} />
      {plan && (
        <Planned plan={plan} changes={present} isDisabled={busy} onWrite={() => ask(plan.request, setReport)} onKeep={() => setPlan(undefined)} />
      )}
      {report && <Undone report={report} />}
      {shown.length === 0 ? (
        <p className="empty">{changes.length === 0 ? 'Nothing was written yet.' : 'No change fits the filter.'}</p>
      ) : (
        <Scroll label="Table of changes">
          <table className="table">
            <thead>
              <tr>
                <th scope="col">no.</th><th scope="col">time</th>{all && <th scope="col" className="wide">drive</th>}<th scope="col">object</th><th scope="col" className="wide">name</th>
                <th scope="col">before</th><th scope="col">after</th><th scope="col" className="wide">unit</th><th scope="col" className="wide">who</th>
                <th scope="col"><span className="unseen">undo</span></th>
              </tr>
            </thead>
            <tbody>
              {shown.slice(0, most_shown).map((change) => (
                <Row key={change.number} change={change} withDrive={all} isDisabled={busy} {...(change.number < (present[0]?.number ?? Infinity) ? {} : { onUndo: () => ask({ number: change.number }, setReport) })} />
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

function Row({ change, withDrive, isDisabled, onUndo }: { change: Change; withDrive: boolean; isDisabled: boolean; onUndo?: () => void }) {
  const { number, wall, time_ns, axis, object, name, before, after, unit, who } = change;
  return (
    <tr>
      <td className="text">{number}</td>
      <td title={`${wall}, ${(time_ns / 1e9).toFixed(3)} s of the line`}>{timeOf(wall, !onUndo)}</td>
      {withDrive && <td className="text">{axis}</td>}
      <th scope="row" className="mono"><Link to={`/objects/${segment(axis)}?object=${object}&q=${object}`}>{object}</Link></th>
      <td className="text">{name}</td>
      <td>{textOf(before, change)}</td>
      <td>{textOf(after, change)}</td>
      <td className="text">{unit}</td>
      <td className="text">{who}</td>
      <td>{onUndo && <Button kind="bare" isDisabled={isDisabled} aria-label={`Undo change ${number}`} onPress={onUndo}>Undo</Button>}</td>
    </tr>
  );
}

// The list of what an undo would write, with the question whether to write it.
function Planned({ plan: { report }, changes, isDisabled, onWrite, onKeep }: {
  plan: Plan;
  changes: readonly Change[];
  isDisabled: boolean;
  onWrite: () => void;
  onKeep: () => void;
}) {
  const changeOf = new Map(changes.map((change) => [change.number, change]));
  const shown = (value: ObjectValue | null, number: number) => {
    const change = changeOf.get(number);
    return change ? textOf(value, change) : String(value);
  };
  return (
    <section className="report" aria-label="What the undo writes">
      <p role="alert">{foretold(report)} Nothing is written yet.</p>
      <Scroll label="Table of what the undo writes">
        <table className="table">
          <thead>
            <tr><th scope="col">drive</th><th scope="col">object</th><th scope="col" className="wide">name</th><th scope="col">now</th><th scope="col">then</th></tr>
          </thead>
          <tbody>
            {report.undone.map(({ number, axis, object, name, from, to }) => (
              <tr key={number}>
                <td className="text">{axis}</td>
                <th scope="row" className="mono">{object}</th>
                <td className="text">{name}</td>
                <td>{shown(from, number)}</td>
                <td>{shown(to, number)}</td>
              </tr>
            ))}
          </tbody>
        </table>
      </Scroll>
      <KeptList report={report} />
      <div className="toolbar">
        <Button kind="main" isDisabled={isDisabled} onPress={onWrite}>Write these values</Button>
        <Button onPress={onKeep}>Leave all as it is</Button>
      </div>
    </section>
  );
}

function Undone({ report }: { report: UndoReport }) {
  return (
    <div className="report" role="status">
      <p>{said(report)}</p>
      <KeptList report={report} />
    </div>
  );
}

function KeptList({ report: { kept } }: { report: UndoReport }) {
  if (kept.length === 0) return null;
  return (
    <ul className="plain-list">
      {kept.map(({ number, axis, object, name, what, hint }) => (
        <li key={number}>{axis} <span className="mono">{object}</span> {name} stays: {what}; {hint}</li>
      ))}
    </ul>
  );
}

// The part of an address that selects an axis; null: all axes.
const queryOf = (axis: string | null) => (axis === null ? '' : `axis=${segment(axis)}&`);

// The changes of earlier runs of the server, which are in the project if there is one.
function useEarlierChanges(axis: string | null): readonly Change[] {
  const project = useProject();
  const epoch = useLine((line) => line.epoch);
  const folder = project?.folder;
  const [changes, setChanges] = useState<readonly Change[]>([]);
  useEffect(() => {
    let over = false;
    setChanges([]);
    if (folder === undefined) return;
    get<{ changes: Change[] }>(`/project/changes?${queryOf(axis)}`).then((answer) => !over && setChanges(answer.changes), complain);
    return () => {
      over = true;
    };
  }, [axis, epoch, folder]);
  return changes;
}

function useChanges(axis: string | null) {
  const epoch = useLine((line) => line.epoch);
  const source = `${epoch} ${axis ?? ''}`;
  const [state, setState] = useState<{ source: string; changes: readonly Change[]; dropped: number }>({ source, changes: [], dropped: 0 });
  const [problem, setProblem] = useState<Problem>();
  const next = useRef(0);

  useEffect(() => {
    let over = false;
    let timer: ReturnType<typeof setTimeout>;
    next.current = 0;
    const ask = () => {
      get<ChangesAnswer>(`/changes?${queryOf(axis)}since=${next.current}&limit=${most_per_answer}&newest=${next.current === 0}`)
        .then(
          (answer) => {
            if (over) return;
            next.current = answer.next;
            setProblem(undefined);
            setState((before) => {
              const changes = withAnswer(before.source === source ? before.changes : [], answer);
              const same = before.source === source && changes === before.changes && before.dropped === answer.dropped;
              return same ? before : { source, changes, dropped: answer.dropped };
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
  }, [axis, source]);
  return { ...state, changes: state.source === source ? state.changes : [], problem };
}
