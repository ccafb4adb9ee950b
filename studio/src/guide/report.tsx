import { useEffect, useRef, type ReactNode } from 'react';
import { axisPath } from '../commands';
import type { Difference } from '../model/parameters';
import { showValue } from '../model/objects';
import { Button, Toggle } from '../parts/controls';
import { saveText } from '../parts/save';
import { useResource } from '../resource';
import { useLine } from '../store';
import { machines, type Scale } from './mechanics';
import { figure } from './parts';
import './report.css';
import css from './report.css?inline';
import { changeStep, stepOf, type Found, type Guide } from './state';
import { keptOf, positionText, shownUnit, standingIn, toShown, type Facts, type Field, type Step } from './step';
import { checkOf, fieldsOf, identify, objectsOf, openOf, steps } from './steps';
import { Figures, Plots, wiresOf, type ViewProps } from './views';

// The report of a commissioning. The page shows it; the file is the same elements with the style sheet and the figures as JSON.

interface Statement {
  product: string;
  axis: string;
  made: string;
  units: Scale['drive'] | null;
  cycle: Stated | null;
  step: Stated | null;
}

type Stated = { rise_ms: number | null; settling_ms: number | null; overshoot_percent: number | null } & Record<string, number | null>;

// The figures of the report, in the drive's units, so that a program can compare them with a measurement on the bus.
function statedOf(found: Found): Stated | null {
  const measured = found.last ?? found.first;
  return measured ? { ...measured.request, rise_ms: measured.rise_ms, settling_ms: measured.settling_ms, overshoot_percent: measured.overshoot_percent } : null;
}

const title = (facts: Facts) => `Commissioning of ${facts.axis.name}`;

export function ReportView({ facts, guide, state, step }: ViewProps) {
  const paper = useRef<HTMLDivElement>(null);
  const { axis } = facts;
  const answers = axis.powered && !axis.problem;
  const compared = useResource<{ differences: Difference[] }>(answers ? `${axisPath(axis.name)}/parameters/diff` : null);
  // A write of the guide, an undo or a power cut changes the differences.
  const written = JSON.stringify(guide.journal.map(({ object, after }) => [object, after, facts.values[object]]));
  const { again } = compared;
  useEffect(again, [again, written]);
  const setSaved = (saved: boolean) => changeStep(axis.name, axis.product, step.id, (now) => ({ ...now, found: { ...now.found, saved } }));
  // A report that is saved before its values are read would not show them.
  const waits = answers && (Object.keys(facts.values).length === 0 || (compared.value ?? compared.problem) === undefined);
  const save = () => {
    const { scale } = facts;
    const stated: Statement = {
      product: axis.product, axis: axis.name, made: new Date().toISOString(), units: scale?.drive ?? null,
      cycle: statedOf(stepOf(guide, 'cycle').found), step: statedOf(stepOf(guide, 'velocity').found),
    };
    const data = JSON.stringify(stated).replaceAll('<', '\\u003c');
    saveText(
      `<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n<meta name="viewport" content="width=device-width">\n<title>${text(title(facts))}</title>\n<style>\nbody { margin: 24px; }\n${css}\n@media print { body { margin: 0; } }\n</style>\n</head>\n<body>\n${paper.current?.outerHTML ?? ''}\n<script type="application/json" id="stated">${data}</script>\n</body>\n</html>\n`,
      `commissioning-${axis.name}.html`,
    );
    setSaved(true);
  };
  return (
    <>
      <div className="buttons no-print">
        <Button kind="main" isDisabled={waits} onPress={save}>Save as a file</Button>
        <Button isDisabled={waits} onPress={() => print()}>Print or save as PDF</Button>
        {waits && <span className="quiet" role="status">The values of the drive are being read.</span>}
      </div>
      <div className="no-print"><Toggle isSelected={state.found.saved ?? false} onChange={setSaved}>The report is saved with the machine's papers</Toggle></div>
      <div className="paper" ref={paper}><Paper facts={facts} guide={guide} differences={compared.value?.differences} /></div>
    </>
  );
}

const text = (plain: string) => plain.replaceAll('&', '&amp;').replaceAll('<', '&lt;');

function Paper({ facts, guide, differences }: { facts: Facts; guide: Guide; differences: Difference[] | undefined }) {
  const { axis, mechanics, scale } = facts;
  const version = useLine((line) => line.version);
  const found = (id: string) => stepOf(guide, id).found;
  const moved = found('direction').moved;
  const lost = guide.journal.filter((entry) => !['in the drive', 'replaced'].includes(standingIn(facts, entry)));
  return (
    <>
      <h2>{title(facts)}</h2>
      <p>{axis.product}, {place(facts)} · {new Date().toLocaleString('en-GB', { dateStyle: 'long', timeStyle: 'short' })} · Servodrome {version}</p>

      <Section title="Steps">
        <Table label="Steps" head={['step', 'result', 'remark']}>
          {steps.filter(({ id }) => id !== 'report').map((step) => {
            const state = stepOf(guide, step.id);
            const lacks = step.lacks?.(facts) ?? '';
            return <tr key={step.id}><th scope="row">{step.title}</th><td>{state.mark === 'done' && openOf(step, facts, state) ? 'open' : (state.mark ?? 'open')}</td><td>{lacks || openOf(step, facts, state) || (state.mark === 'done' ? checkOf(step, facts, state) : '')}</td></tr>;
          })}
        </Table>
        {lost.length > 0 && <p className="warn">{lost.length} of the written values are not in the drive now: {lost.map(({ object }) => object).join(', ')}.</p>}
      </Section>

      <div className="two">
        <Section title="Machine">
          <p>{machines.find(([id]) => id === mechanics.machine)?.[1]}{mechanics.machine === 'spindle' ? `, lead ${mechanics.feed_mm} mm` : mechanics.machine === 'belt' ? `, ${mechanics.feed_mm} mm per revolution` : ''}; gear {mechanics.motor_turns} : {mechanics.load_turns}.</p>
          {scale && <p>One revolution of the motor: {figure(scale.user.position, 4)} {scale.unit.position}, {figure(scale.drive.position, 0)} units of 6064h.</p>}
        </Section>
        <Section title="Direction and encoder">
          {moved ? <p>Commanded {positionText(facts, moved.asked)}, 6064h moved by {positionText(facts, moved.drive)}{moved.shaft === null ? '' : `, the true shaft by ${positionText(facts, moved.shaft)}`}. The machine moved {found('direction').way === 'right' ? 'the right way' : found('direction').way === 'wrong' ? 'the wrong way' : 'in a direction that was not confirmed'}.</p> : <p>Not tried.</p>}
        </Section>
      </div>

      <Identity facts={facts} />
      <Section title="Inputs">
        <Table label="Inputs" head={['input', 'wired to', 'seen at 0', 'seen at 1']}>
          {Object.entries(found('inputs').seen ?? {}).map(([name, [low, high]]) => (
            <tr key={name}><th scope="row">{name}</th><td>{found('inputs').notWired?.includes(name) ? 'not wired' : wiresOf(facts, name)}</td><td>{low ? 'yes' : 'no'}</td><td>{high ? 'yes' : 'no'}</td></tr>
          ))}
        </Table>
      </Section>

      {['velocity', 'position', 'cycle'].map((id) => <Response key={id} facts={facts} guide={guide} id={id} />)}
      <Section title="Homing">
        {found('homing').homedBy === undefined ? <p>Not homed by this guide.</p> : <p>Method {found('homing').homedBy}. {numbersOf(facts, guide, 'homing')}</p>}
      </Section>

      <Section title="Written by this guide">
        {guide.journal.length === 0 ? <p>Nothing.</p> : (
          <Table label="Written by this guide" head={['step', 'object', 'name', 'before', 'written', 'unit', 'now']}>
            {guide.journal.map((entry) => (
              <tr key={`${entry.step} ${entry.object}`}><td>{steps.find(({ id }) => id === entry.step)?.title}</td><th scope="row">{entry.object}</th><td>{entry.name}</td><td className="figure">{entry.before}</td><td className="figure">{entry.after}</td><td>{entry.unit}</td><td>{standingIn(facts, entry)}</td></tr>
            ))}
          </Table>
        )}
        <p>{found('store').stored?.stored ? 'The parameters are stored in the drive.' : 'The parameters are not stored: they are lost at power-off, unless the drive keeps each value when it is written.'}</p>
      </Section>

      <Section title="Differences from the factory values">
        {differences === undefined ? <p>Not known.</p> : differences.length === 0 ? <p>None.</p> : (
          <Table label="Differences from the factory values" head={['object', 'name', 'factory', 'drive', 'unit']}>
            {differences.map(({ object, name, left, right, unit }) => (
              <tr key={object}><th scope="row">{object}</th><td>{name}</td><td className="figure">{left ?? '–'}</td><td className="figure">{right ?? '–'}</td><td>{unit}</td></tr>
            ))}
          </Table>
        )}
      </Section>
    </>
  );
}

const place = ({ axis }: Facts) => [axis.bus, axis.node_id !== undefined && `node ${axis.node_id}`, axis.position !== undefined && `position ${axis.position}`].filter(Boolean).join(' ');

function Identity({ facts }: { facts: Facts }) {
  return (
    <Section title="Drive and motor">
      <Table label="Drive and motor" head={['object', 'name', 'value', 'unit']}>
        {objectsOf(identify, facts, []).shown.map((object) => {
          const entry = facts.entries.get(object);
          return <tr key={object}><th scope="row">{object}</th><td>{entry?.name}</td><td className="figure">{showValue(facts.values[object], entry)}</td><td>{entry?.unit}</td></tr>;
        })}
      </Table>
    </Section>
  );
}

function Response({ facts, guide, id }: { facts: Facts; guide: Guide; id: string }) {
  const step = steps.find((each) => each.id === id);
  const { found } = stepOf(guide, id);
  if (!step) return null;
  return (
    <Section title={step.title}>
      {!found.first && !found.loop ? <p>Not measured.</p> : (
        <>
          <p>{numbersOf(facts, guide, id)}</p>
          <Figures inReport facts={facts} found={found} />
          <Plots title={step.title} found={found} />
        </>
      )}
    </Section>
  );
}

// A number in the drive's units has all its digits, as in the tables of the report.
const toShownText = (facts: Facts, { kind }: Field, kept: number) => (kind === undefined ? String(kept) : String(Number(toShown(facts, kind, kept).toPrecision(6))));

// The numbers of a step's form as a sentence.
function numbersOf(facts: Facts, guide: Guide, id: string): string {
  const step = steps.find((each) => each.id === id) as Step;
  const state = stepOf(guide, id);
  const fields = fieldsOf(step, facts, state);
  const numbers = keptOf(state, fields);
  return fields
    .filter(({ key, options }) => Number.isFinite(numbers(key)) && !options)
    .map((field) => `${field.label} ${toShownText(facts, field, numbers(field.key))} ${shownUnit(facts, field)}`.trim())
    .join('; ');
}

function Section({ title: heading, children }: { title: string; children: ReactNode }) {
  return <section><h3>{heading}</h3>{children}</section>;
}

function Table({ label, head, children }: { label: string; head: string[]; children: ReactNode }) {
  return (
    <table aria-label={label}>
      <thead><tr>{head.map((each) => <th key={each} scope="col">{each}</th>)}</tr></thead>
      <tbody>{children}</tbody>
    </table>
  );
}

