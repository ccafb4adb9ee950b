import { useEffect, useRef, useState, type ComponentType, type ReactNode } from 'react';
import type { AxisView } from '../api/types';
import { adopt, undoHindrance, writePlan } from '../guide/actions';
import { useFacts } from '../guide/facts';
import '../guide/guide.css';
import { canUndo, Form, JournalPanel, markOf, MotionBox, Plan, Readings, undoStep } from '../guide/parts';
import { ReportView } from '../guide/report';
import { changeStep, forgetGuide, stepOf, useGuide, type Guide, type StepState } from '../guide/state';
import { keptOf, lostGains, planOf, type Facts, type PlanRow, type Step } from '../guide/step';
import { checkOf, fieldsOf, objectsOf, openOf, refusedBy, steps } from '../guide/steps';
import { DirectionView, FindView, HomingView, IdentifyView, InputsView, LoopView, releaseInputs, ResponseView, StoreView, UnitsView, type ViewProps } from '../guide/views';
import { motionHindrance } from '../model/cia402';
import { attempt, complain } from '../notices';
import { AxisTabs, usePageAxis } from '../parts/axis_tabs';
import { Button, Link } from '../parts/controls';
import { NumberForm, useNumberIsRefused } from '../parts/number_input';
import { StateChip } from '../parts/state';
import { Travel } from '../parts/travel';
import { go, useRoute } from '../route';
import { useAxis, useLine } from '../store';
import { Commands } from './line';

// The guided commissioning of an axis: a step of the table (guide/steps.ts) at a time, in any order.

export function CommissionPage() {
  const { name: asked } = useRoute();
  const name = usePageAxis(asked);
  const axis = useCalmAxis(name);
  if (!axis) return null;
  return (
    <>
      <AxisTabs page="commission" name={name} />
      <GuideOf key={`${name} ${axis.product}`} axis={axis} />
    </>
  );
}

const calm_ms = 300;

// Updates of the axis a few times a second, which is enough for the tables of the guide; a change of its state at once.
function useCalmAxis(name: string): AxisView | undefined {
  const shown = useRef<{ axis: AxisView | undefined; at: number; key: string }>({ axis: undefined, at: -Infinity, key: '' });
  return useLine((line) => {
    const axis = line.axes[name] as AxisView | undefined;
    const key = JSON.stringify([axis?.name, axis?.powered, axis?.state, axis?.mode, axis?.homed, axis?.in_motion, axis?.faults, axis?.problem]);
    const now = performance.now();
    if (key !== shown.current.key || (axis !== shown.current.axis && now - shown.current.at > calm_ms)) shown.current = { axis, at: now, key };
    return shown.current.axis;
  });
}

function LiveTravel({ name, facts }: { name: string; facts: Facts }) {
  const axis = useAxis(name);
  return axis ? <Travel axis={axis} geometry={facts.geometry} /> : null;
}

const views: Record<NonNullable<Step['view']>, ComponentType<ViewProps>> = {
  find: FindView, identify: IdentifyView, units: UnitsView, inputs: InputsView, direction: DirectionView, loop: LoopView, response: ResponseView, homing: HomingView, store: StoreView, report: ReportView,
};

const addressOf = (axis: AxisView, step: Step | undefined) => `/commission/${encodeURIComponent(axis.name)}?step=${step?.id ?? ''}`;

function GuideOf({ axis }: { axis: AxisView }) {
  const guide = useGuide(axis.name, axis.product);
  const { query } = useRoute();
  const asked = steps.find(({ id }) => id === query.get('step'));
  // Without a step in the address the guide continues at the step where the user left it.
  const [lost, setLost] = useState(''); // steps whose gains are not in the drive any more
  const step = asked ?? steps.find((each) => markOf(guide, each) === undefined) ?? steps[0];
  return (
    <div className="guide">
      <StepList axis={axis} guide={guide} step={step} lost={lost} />
      <StepPanel key={step.id} axis={axis} guide={guide} step={step} onLost={setLost} />
    </div>
  );
}

function StepList({ axis, guide, step, lost }: { axis: AxisView; guide: Guide; step: Step; lost: string }) {
  const marked = (each: Step) => (lost.split(' ').includes(each.id) ? undefined : markOf(guide, each));
  const count = steps.filter(marked).length;
  return (
    <nav className="panel guide-steps" aria-label="Steps of the commissioning">
      <header><h2>Commissioning</h2><span className="quiet">{count} of {steps.length}</span></header>
      <ol>
        {steps.map((each, i) => {
          const mark = marked(each);
          return (
            <li key={each.id}>
              <Link to={addressOf(axis, each)} className={mark ?? ''} {...(each === step ? { 'aria-current': 'step' as const } : {})}>
                <span className="number">{mark === 'done' ? '✓' : mark === 'skipped' ? '–' : i + 1}</span> {each.title}
                {mark && <span className="unseen"> ({mark})</span>}
              </Link>
            </li>
          );
        })}
      </ol>
      <Button kind="bare" isDisabled={guide.journal.length > 0 || guide.run?.state === 'running'} onPress={() => { forgetGuide(axis.name); go(addressOf(axis, steps[0])); }}>Begin again</Button>
      {guide.journal.length > 0 && <p className="quiet">To begin again, undo the written values first.</p>}
    </nav>
  );
}

function StepPanel({ axis, guide, step, onLost }: { axis: AxisView; guide: Guide; step: Step; onLost: (steps: string) => void }) {
  const { facts, again } = useFacts(axis, guide, step);
  const state = stepOf(guide, step.id);
  const isBusy = useLine((line) => line.jobs[axis.name]?.state === 'running') || guide.run?.state === 'running';
  const present = useRef(facts);
  present.current = facts;
  const hasScale = facts.scale !== null;
  useEffect(() => (hasScale ? adopt(present.current) : undefined), [hasScale]);

  const lost = steps.filter(({ id }) => lostGains(facts, id) !== '').map(({ id }) => id).join(' ');
  const isRead = Object.keys(facts.values).length > 0; // between two steps the values are not known
  useEffect(() => {
    if (isRead || guide.journal.length === 0) onLost(lost);
  }, [isRead, guide.journal.length, lost, onLost]);
  const fields = fieldsOf(step, facts, state);
  const numbers = keptOf(state, fields);
  const { shown, absent } = objectsOf(step, facts, fields);
  const plan = planOf(facts, fields.filter(({ isGain }) => !isGain), numbers);
  const gains = planOf(facts, fields.filter(({ isGain }) => isGain), numbers);
  const refusal = refusedBy(step, facts, state);
  const lacks = facts.entries.size > 0 ? (step.lacks?.(facts) ?? '') : '';
  // The rows stay until all of them are written: a motion that begins between two of them would use half of them.
  const [writing, setWriting] = useState<{ label: string; rows: PlanRow[] }>();
  // Why writes and motions are not possible now; empty: they are.
  const reason = motionHindrance(axis) || (writing ? 'Values are being written: wait.' : isBusy ? 'The axis is busy: wait until its job has ended.' : '');
  const cannotUndo = undoHindrance(axis);
  const planned = (label: string, rows: PlanRow[]) => ({
    label,
    plan: writing?.label === label ? writing.rows : rows,
    isBusy: reason !== '',
    refusal,
    onWrite: () => {
      setWriting({ label, rows });
      attempt(() => writePlan(axis, step.id, rows).finally(() => {
        setWriting(undefined);
        again();
      }));
    },
  });
  const open = openOf(step, facts, state);
  const View = step.view ? views[step.view] : null;
  const next = steps[steps.indexOf(step) + 1] as Step | undefined;
  const leave = (mark: StepState['mark']) => {
    changeStep(axis.name, axis.product, step.id, (now) => ({ ...now, ...(mark ? { mark } : {}) }));
    if (step.id === 'inputs' && facts.isVirtual) void releaseInputs(axis.name).catch(complain);
    if (next) go(addressOf(axis, next));
  };
  const props: ViewProps = { facts, step, state, numbers, guide };
  return (
    <div className="column guide-step">
      <section className="panel" aria-label={step.title}>
        <header>
          <h2>{step.title}</h2>
          <StateChip axis={axis} />
          <span className="guide-head buttons"><Commands axis={axis} /></span>
        </header>
        <p className="guide-why no-print">{step.why}</p>
        {facts.geometry && step.motions && <LiveTravel name={axis.name} facts={facts} />}
        <FaultLine axis={axis} />
        {lacks && <p className="warning" role="note">{lacks} Go on with the next step.</p>}
        <Readings facts={facts} shown={shown} absent={absent} />
        <NumberForm>
        {lacks === '' && (
          <>
            {step.view === 'inputs' && View && <View {...props} />}
            <Form facts={facts} step={step} fields={fields} numbers={numbers} />
            <Plan facts={facts} {...planned('Values to write', plan)} />
            <Plan facts={facts} {...planned('Gains to write', gains)} />
            {fields.length > 0 && plan.length + gains.length === 0 && facts.entries.size > 0 && <p className="quiet note" role="status">The drive has these values: nothing is to be written.</p>}
            {step.motions?.map((motion) => (
              <MotionBox
                key={motion.id} facts={facts} step={step} motion={motion} numbers={numbers} fields={fields} guide={guide}
                reasonBefore={reason || (plan.length > 0 ? 'Write the values above first, so that the motion uses them.' : '')}
              />
            ))}
            {step.view !== 'inputs' && View && <View {...props} />}
          </>
        )}
        <Check lacks={lacks !== ''} open={open} passed={checkOf(step, facts, state)} />
        {cannotUndo && canUndo(guide, step) && <p className="quiet note no-print" role="status">{cannotUndo}</p>}
        <div className="buttons no-print">
          {canUndo(guide, step) && <Button isDisabled={reason !== '' || cannotUndo !== ''} onPress={() => attempt(() => undoStep(facts, step).finally(again))}>Undo this step</Button>}
          <Button onPress={() => leave('skipped')}>{next ? 'Skip' : 'Skip the report'}</Button>
          {!lacks && <DoneButton isDisabled={open !== '' || isBusy || writing !== undefined} onPress={() => leave('done')}>{next ? 'Done, next step' : 'Done'}</DoneButton>}
        </div>
        </NumberForm>
      </section>
      <JournalPanel facts={facts} guide={guide} isBusy={reason !== ''} again={again} />
    </div>
  );
}

// While a typed number is refused, the last accepted number still counts, but the step is not complete.
function Check({ lacks, open, passed }: { lacks: boolean; open: string; passed: string }) {
  const isRefused = useNumberIsRefused();
  const missing = isRefused ? 'A number of the form is refused: correct it.' : open;
  return <p className={`no-print guide-check ${missing ? '' : 'passed'}`} role="status">{lacks ? 'This step cannot be done with this drive.' : missing || `✓ ${passed}`}</p>;
}

function DoneButton({ isDisabled, ...props }: { isDisabled: boolean; onPress: () => void; children: ReactNode }) {
  const isRefused = useNumberIsRefused();
  return <Button kind="main" isDisabled={isDisabled || isRefused} {...props} />;
}

function FaultLine({ axis }: { axis: AxisView }) {
  const faults = axis.faults ?? [];
  if (faults.length === 0) return null;
  return (
    <p className="trouble" role="alert">
      {faults.map(({ code, name }) => `${code.replace('0x', '')}h ${name}`).join('; ')}
      <span className="hint"><Link to={`/faults/${encodeURIComponent(axis.name)}`}>Cause and remedy</Link></span>
    </p>
  );
}
