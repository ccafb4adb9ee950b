import { useState, type ReactNode } from 'react';
import type { Job } from '../api/types';
import { objectTip } from '../model/meanings';
import { hexValue, namedOf, showValue } from '../model/objects';
import { hindrance } from '../model/plan';
import { fixed } from '../model/units';
import { attempt } from '../notices';
import { Button, Choice, HaltButton, Link, Scroll, Trouble } from '../parts/controls';
import { NumberInput, NumbersButton } from '../parts/number_input';
import { useLine } from '../store';
import { abort, leaveAsItIs, runMotion, undo, undoHindrance, writeAgain } from './actions';
import { lost } from './journal';
import { changeStep, stepOf, type Guide } from './state';
import { fromShown, reachOf, positionText, refusalOf, shownUnit, standingIn, toShown, type Facts, type Field, type Motion, type Numbers, type PlanRow, type Step } from './step';
import { steps } from './steps';

// The parts that every step can have: the objects that it reads, the numbers, the plan of the writes, the motions, and the
// journal.

export function Readings({ facts, shown, absent }: { facts: Facts; shown: string[]; absent: string[] }) {
  if (shown.length === 0 && absent.length === 0) return null;
  return (
    <>
      {shown.length > 0 && (
        <Scroll label="Values read">
          <table className="table" aria-label="Values read from the drive">
            <thead><tr><th scope="col">object</th><th scope="col" className="wide">name</th><th scope="col">value</th><th scope="col" className="wide">unit</th></tr></thead>
            <tbody>
              {shown.map((object) => {
                const entry = facts.entries.get(object);
                const value = facts.values[object];
                const meaning = namedOf(entry?.enumeration).find((each) => each.value === value)?.name;
                return (
                  <tr key={object}>
                    <th scope="row" className="mono"><ObjectLink facts={facts} object={object} /></th>
                    <td className="text">{entry?.name}</td>
                    <td>{value === null ? 'cannot be read' : showValue(value, entry)} <span className="quiet mono">{entry && hexValue(entry, value)}</span>{meaning && ` ${meaning}`}</td>
                    <td className="text">{entry?.unit}</td>
                  </tr>
                );
              })}
            </tbody>
          </table>
        </Scroll>
      )}
      {absent.length > 0 && facts.entries.size > 0 && <p className="quiet note">{facts.axis.product} does not have {absent.map((object) => `${object}h`).join(', ')}.</p>}
    </>
  );
}

function ObjectLink({ facts: { axis, entries }, object }: { facts: Facts; object: string }) {
  const entry = entries.get(object);
  return <Link to={`/objects/${encodeURIComponent(axis.name)}?object=${object}&q=${object}`} {...(entry ? { 'data-tip': objectTip(entry, axis.product) } : {})}>{object}</Link>;
}

export function Form({ facts, step, fields, numbers }: { facts: Facts; step: Step; fields: Field[]; numbers: Numbers }) {
  const { name, product } = facts.axis;
  const type = (field: Field, shown: number) =>
    changeStep(name, product, step.id, (state) => {
      const kept = fromShown(facts, field.kind, shown);
      const others = Object.entries(state.typed).filter(([key]) => key !== field.key);
      return { ...state, typed: Object.fromEntries(Number.isFinite(kept) ? [...others, [field.key, kept]] : others) };
    });
  if (fields.length === 0) return null;
  return (
    <div className="form guide-form">
      {fields.flatMap((field) => {
        const value = numbers(field.key);
        const heading = field.group ? [<h3 key={`group ${field.group}`}>{field.group}</h3>] : [];
        if (field.options) return [...heading, <Choice key={field.key} label={field.label} isLong={field.options.length > 4} value={value} options={field.options} onChange={(to) => type(field, to)} />];
        return [
          ...heading,
          <NumberInput
            key={field.key} label={field.label} unit={shownUnit(facts, field)} value={round(toShown(facts, field.kind, value))}
            mayBeEmpty={field.mayBeEmpty ?? false} check={(shown) => refusalOf(facts, field, shown)} onChange={(to) => type(field, to)}
          />,
        ];
      })}
    </div>
  );
}

const round = (value: number) => (Number.isFinite(value) ? Number(value.toPrecision(9)) : value);

export function Plan({ facts, plan, label, isBusy, refusal, onWrite }: { facts: Facts; plan: PlanRow[]; label: string; isBusy: boolean; refusal: string; onWrite: () => void }) {
  if (plan.length === 0) return null;
  return (
    <div className="guide-plan">
      <h3>{label}</h3>
      <Scroll label={`Table: ${label}`}>
        <table className="table plan" aria-label={label}>
          <thead><tr><th scope="col">object</th><th scope="col" className="wide">name</th><th scope="col">in the drive</th><th scope="col">new</th><th scope="col" className="wide">unit</th></tr></thead>
          <tbody>
            {plan.map(({ object, name, unit, before, after }) => (
              <tr key={object}>
                <th scope="row" className="mono"><ObjectLink facts={facts} object={object} /></th>
                <td className="text">{name}</td>
                <td data-head="in the drive">{before}</td>
                <td data-head="new" className="differs">{after}</td>
                <td className="text">{unit}</td>
              </tr>
            ))}
          </tbody>
        </table>
      </Scroll>
      <div className="buttons">
        <NumbersButton kind="main" isDisabled={isBusy || refusal !== ''} onPress={onWrite}>
          Write {plan.length === 1 ? 'this value' : `these ${plan.length} values`}
        </NumbersButton>
      </div>
      {refusal && <p className="trouble" role="alert">{refusal}</p>}
    </div>
  );
}

export function MotionBox({ facts, step, motion, numbers, fields, guide, reasonBefore }: {
  facts: Facts;
  step: Step;
  motion: Motion;
  numbers: Numbers;
  fields: Field[];
  guide: Guide;
  reasonBefore: string; // why no motion of this step may start; empty: it may
}) {
  const { axis } = facts;
  const job = useLine((line) => line.jobs[axis.name] as Job | undefined);
  const missing = motion.isMissing?.(facts) ?? '';
  if (missing) return <p className="note">{missing}</p>;
  const orders = motion.orders(numbers, facts);
  const isComplete = orders.every((order) => Object.values(order).every((value) => typeof value !== 'number' || Number.isFinite(value)));
  const far = (motion.reach?.(numbers) ?? []).map((by) => hindrance(axis, reachOf(facts), { by }, (turns) => positionText(facts, turns))).find((text) => text !== '') ?? '';
  const { run } = guide;
  const isMine = run?.step === step.id && run.motion === motion.id;
  const isRunning = isMine && run.state === 'running';
  const reason = isRunning ? '' : far || reasonBefore;
  return (
    <div className="guide-motion" role="group" aria-label={motion.label}>
      <p className="note">{motion.says} Commanded by the job: {motion.commands.map((object) => commandText(object, facts, motion)).join(', ')}.</p>
      <div className="buttons">
        <NumbersButton kind="main" isDisabled={isRunning || reason !== '' || !isComplete} onPress={() => void runMotion(facts, step, motion, numbers, fields.map(({ key }) => key))}>{motion.label}</NumbersButton>
        <HaltButton isDisabled={!isRunning && job?.state !== 'running'} onHalt={() => attempt(() => abort(axis))}>Abort</HaltButton>
        {isRunning && <Progress job={job} done={run.jobs.length} of={run.of} />}
      </div>
      {reason && <p className={far ? 'trouble' : 'quiet note'} role={far ? 'alert' : 'status'}>{reason}</p>}
      {isMine && (run.state === 'failed' || run.state === 'interrupted') && !(run.hadNoPower && axis.powered) && <Trouble problem={run.error} />}
    </div>
  );
}

function commandText(object: string, facts: Facts, motion: Motion): string {
  const now = facts.values[object];
  const mode = motion.mode(facts);
  const name = `${object.slice(0, 4)}h`;
  if (object === '6060:00') return now === mode ? `mode ${name} ${mode}` : `mode ${name} ${String(now ?? '–')} → ${mode}`;
  return object === '6040:00' ? `controlword ${name}` : `target ${name}`;
}

function Progress({ job, done, of }: { job: Job | undefined; done: number; of: number }) {
  return (
    <span className="progress" role="status">
      {job?.progress ? <progress max={1} value={job.progress.share} aria-label="Progress of the measurement" /> : null} {job?.progress?.doing ?? job?.do.replaceAll('_', ' ') ?? 'beginning'}
      {of > 3 && ` (${done} of ${of})`}
    </span>
  );
}

export function JournalPanel({ facts, guide, isBusy, again }: { facts: Facts; guide: Guide; isBusy: boolean; again: () => void }) {
  const { axis } = facts;
  const [asked, setAsked] = useState(false);
  const { journal } = guide;
  const reason = undoHindrance(axis);
  const cannot = isBusy || reason !== '';
  if (journal.length === 0) return null;
  const titleOf = (id: string) => steps.find((step) => step.id === id)?.title ?? id;
  const rows: ReactNode[] = journal.map((entry) => {
    const standing = standingIn(facts, entry);
    return (
      <tr key={`${entry.step} ${entry.object}`}>
        <td className="text">{titleOf(entry.step)}</td>
        <th scope="row" className="mono"><ObjectLink facts={facts} object={entry.object} /></th>
        <td className="text">{entry.name}</td>
        <td>{entry.before}</td>
        <td>{entry.after}</td>
        <td className={standing === 'in the drive' || standing === 'replaced' ? 'text' : 'text differs'}>{standing}</td>
        <td>
          {standing === lost && <Button kind="bare" isDisabled={cannot} aria-label={`Write ${entry.object} again`} onPress={() => attempt(() => writeAgain(axis, entry).finally(again))}>Write again</Button>}
          {(standing === lost || standing === 'changed by another') && <Button kind="bare" aria-label={`Take ${entry.object} out of the list`} onPress={() => leaveAsItIs(axis, entry)}>Take out</Button>}
        </td>
      </tr>
    );
  });
  return (
    <section className="panel guide-journal" aria-label="Written by the guide">
      <header>
        <h2>Written by the guide</h2>
        {asked ? (
          <>
            <span role="alert">All {journal.length} values go back to what they were.</span>
            <Button kind="bad" isDisabled={cannot} onPress={() => { setAsked(false); attempt(() => undo(facts, null).finally(again)); }}>Undo all of them</Button>
            <Button onPress={() => setAsked(false)}>Keep</Button>
          </>
        ) : (
          <Button isDisabled={cannot} onPress={() => setAsked(true)}>Undo all</Button>
        )}
      </header>
      {reason && <p className="quiet note" role="status">{reason}</p>}
      <Scroll label="Table of what the guide has written">
        <table className="table" aria-label="Written by the guide">
          <thead><tr><th scope="col">step</th><th scope="col">object</th><th scope="col" className="wide">name</th><th scope="col">before</th><th scope="col">written</th><th scope="col" className="wide">now</th><th scope="col"><span className="unseen">action</span></th></tr></thead>
          <tbody>{rows}</tbody>
        </table>
      </Scroll>
    </section>
  );
}

export const figure = (value: number | null | undefined, digits: number) => (typeof value === 'number' ? fixed(value, digits) : '–');
export const canUndo = (guide: Guide, step: Step) => guide.journal.some((entry) => entry.step === step.id);
export const markOf = (guide: Guide, step: Step) => stepOf(guide, step.id).mark;
export const undoStep = (facts: Facts, step: Step) => undo(facts, step.id);
