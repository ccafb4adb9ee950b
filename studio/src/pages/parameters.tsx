import { useState, type ReactNode } from 'react';
import { callText, get, post, problemOf } from '../api/client';
import type { Problem } from '../api/types';
import { axisPath } from '../commands';
import { Button, Link, Panel, Scroll, Toggle, Trouble } from '../parts/controls';
import { textOf, type Difference } from '../model/parameters';
import { attempt } from '../notices';
import { useAxis } from '../store';

interface Comparison {
  compared: number;
  differences: Difference[];
}

interface Named {
  object: string;
  name: string;
}

interface LoadReport {
  compared: number;
  written: Named[];
  skipped: Named[];
  stored: boolean;
  keeps_at_once: boolean;
  after_restart: Named[];
  lost_with_power: Named[];
}

interface StoreReport {
  stored: boolean;
  keeps_at_once: boolean;
  lost_with_power: Named[];
}

interface Text {
  name: string;
  text: string;
}

// The result of the last action: a comparison, a load, or an error.
interface Outcome {
  comparison?: Comparison & { left: string };
  report?: LoadReport;
  storing?: StoreReport;
  problem?: Problem;
}

export function ParametersView({ name }: { name: string }) {
  const product = useAxis(name)?.product ?? '';
  const path = `${axisPath(name)}/parameters`;
  const [file, setFile] = useState<Text | null>(null);
  const [store, setStore] = useState(false);
  const [force, setForce] = useState(false);
  const [outcome, setOutcome] = useState<Outcome>({});
  const [busy, setBusy] = useState(false);

  const run = (action: () => Promise<Outcome>) => {
    setBusy(true);
    void action()
      .catch((error: unknown) => ({ problem: problemOf(error) }))
      .then(setOutcome)
      .finally(() => setBusy(false));
  };
  const compareWithin = async (left: string) => ({ comparison: { ...(await get<Comparison>(`${path}/diff?with=${left}`)), left } });
  const compareWith = async ({ name: left, text }: Text) => ({ comparison: { ...(await callText<Comparison>('POST', `${path}/diff`, text)), left } });
  const load = async (text: string, query = '') => ({ report: await callText<LoadReport>('PUT', `${path}${query}`, text) });
  const again = (left: string) => (left === 'factory' || left === 'stored' ? compareWithin(left) : file ? compareWith(file) : Promise.resolve({}));
  // Loads the left side's values of a comparison into the drive, and compares again.
  const take = (left: string, differences: Difference[]) =>
    run(async () => {
      const { report } = await load(textOf(product, differences));
      return { report, ...(await again(left)) };
    });
  const options = [store && 'store=true', force && 'force=true'].filter(Boolean).join('&');

  return (
    <div className="column">
      <Panel title="Parameters" aside={<span className="quiet" role="status">{busy ? 'working' : ''}</span>}>
        <p className="note">
          All writable parameters as a text file. Loading checks the whole file first and writes only the values that differ. If the drive
          rejects a value, the previous values are restored.
        </p>
        <div className="toolbar">
          <a className="button" href={`/api/v1${path}`} download={`${name}.par`}>Save as a file</a>
          <Button isDisabled={busy} onPress={() => run(() => compareWithin('factory'))}>Compare with factory defaults</Button>
          <Button isDisabled={busy} onPress={() => run(() => compareWithin('stored'))}>Compare with stored values</Button>
          <Button isDisabled={busy} onPress={() => run(async () => ({ storing: await post<StoreReport>(`${path}/store`) }))}>Store in the drive</Button>
        </div>
        <div className="toolbar">
          <label className="field file">
            <span>Parameter file</span>
            <input
              className="input"
              type="file"
              accept=".par,.txt,text/plain"
              onChange={(event) => {
                const chosen = event.target.files?.[0];
                setOutcome({});
                if (chosen) attempt(async () => setFile({ name: chosen.name, text: await chosen.text() }));
                else setFile(null);
              }}
            />
          </label>
          <Button isDisabled={busy || !file} onPress={() => file && run(() => compareWith(file))}>Compare with file</Button>
          <Button kind="main" isDisabled={busy || !file} onPress={() => file && run(() => load(file.text, options && `?${options}`))}>Load file</Button>
          <Toggle isSelected={store} onChange={setStore}>store after loading</Toggle>
          <Toggle isSelected={force} onChange={setForce}>accept a file of another product</Toggle>
        </div>
        <Trouble problem={outcome.problem} />
        {outcome.report && <Report report={outcome.report} />}
        {outcome.storing && <Stored storing={outcome.storing} />}
      </Panel>
      {outcome.comparison && <Differences axis={name} comparison={outcome.comparison} onTake={(some) => take(outcome.comparison!.left, some)} busy={busy} />}
    </div>
  );
}

function Stored({ storing }: { storing: StoreReport }) {
  const { stored, lost_with_power } = storing;
  return (
    <div className="report" role="status">
      <p>{stored ? 'Stored in non-volatile memory.' : 'This drive has no store command: it keeps a non-volatile parameter as soon as it is written.'}</p>
      <List objects={lost_with_power} title="This drive cannot store these changed values, they are lost at power-off" />
    </div>
  );
}

function List({ objects, title }: { objects: Named[]; title: string }) {
  if (objects.length === 0) return null;
  return (
    <details>
      <summary>{title}: {objects.length}</summary>
      <ul className="plain-list">{objects.map(({ object, name }) => <li key={object}><span className="mono">{object}</span> {name}</li>)}</ul>
    </details>
  );
}

function Report({ report }: { report: LoadReport }) {
  const lists: [Named[], string][] = [
    [report.written, 'Written'],
    [report.skipped, 'Skipped'],
    [report.after_restart, 'Take effect at the next power-on: restart the drive'],
    [report.lost_with_power, 'Cannot be stored in the drive: lost at power-off'],
  ];
  return (
    <div className="report" role="status">
      <p>
        {report.compared} parameters are as in the file, {report.written.length} of them were written.{' '}
        {report.stored ? 'Stored.' : report.keeps_at_once ? '' : report.written.length > 0 ? 'Not stored: lost at power-off.' : ''}
      </p>
      {lists.map(([objects, title]) => <List key={title} objects={objects} title={title} />)}
    </div>
  );
}

function Differences({ axis, comparison, onTake, busy }: {
  axis: string;
  comparison: Comparison & { left: string };
  onTake: (some: Difference[]) => void;
  busy: boolean;
}) {
  const { left, compared, differences } = comparison;
  const all = differences.filter((each) => each.left !== null);
  const cell = (value: string | null): ReactNode => value ?? <span className="quiet">missing</span>;
  return (
    <Panel
      title={`Compared with ${left}`}
      aside={
        <>
          <span className="quiet" role="status">{differences.length} of {compared} differ</span>
          <Button isDisabled={busy || all.length === 0} onPress={() => onTake(all)}>Write all values of {left}</Button>
        </>
      }
    >
      {differences.length === 0 ? (
        <p className="empty">No differences.</p>
      ) : (
        <Scroll label="Table of differences">
          <table className="table">
            <thead>
              <tr><th scope="col">object</th><th scope="col" className="wide">name</th><th scope="col">{left}</th><th scope="col">drive</th><th scope="col" className="wide">unit</th><th scope="col"><span className="unseen">write</span></th></tr>
            </thead>
            <tbody>
              {differences.map((each) => (
                <tr key={each.object}>
                  <th scope="row" className="mono"><Link to={`/objects/${encodeURIComponent(axis)}?object=${each.object}&q=${each.object}`}>{each.object}</Link></th>
                  <td className="text">{each.name}</td>
                  <td>{cell(each.left)}</td>
                  <td>{cell(each.right)}</td>
                  <td className="text">{each.unit}</td>
                  <td>{each.left !== null && <Button kind="bare" isDisabled={busy} aria-label={`Write ${each.object} of ${left}`} onPress={() => onTake([each])}>Write</Button>}</td>
                </tr>
              ))}
            </tbody>
          </table>
        </Scroll>
      )}
    </Panel>
  );
}
