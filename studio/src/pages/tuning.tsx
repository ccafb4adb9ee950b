import { useCallback, useEffect, useMemo, useRef, useState } from 'react';
import type { Job, ObjectEntry, ObjectValue } from '../api/types';
import { axisPath, cancelJob, haltAnd, readValues, untilHalted, writeObject } from '../commands';
import { at, type BodePoint } from '../model/bode';
import { addressOf } from '../model/objects';
import { figuresOf, missingForTune, placeOf, setsOf, type GainLine, type Gains, type StepMeasured, type Tuned } from '../model/tuning';
import { fixed, significant } from '../model/units';
import { attempt, tell } from '../notices';
import { AxisTabs, usePageAxis } from '../parts/axis_tabs';
import { Button, HaltButton, Link, Panel, Readout, Scroll, Trouble } from '../parts/controls';
import { JobLine } from '../parts/job_line';
import { NumberForm, NumberInput, NumbersButton } from '../parts/number_input';
import { Lanes, type Curve } from '../parts/lanes';
import { useResource } from '../resource';
import { useRoute } from '../route';
import { useAxis, useIsBusy, useIsOutdated, useLine, useMotionHindrance, usePowered } from '../store';

const tunes = ['tune', 'tune_itself'];

export function TuningPage() {
  const { name: asked } = useRoute();
  const name = usePageAxis(asked);
  const powered = usePowered(name);
  const { value: gains, problem } = useResource<Gains>(`${axisPath(name)}/gains`);
  const job = useTuningJob(name);
  const product = useAxis(name)?.product ?? '';
  const objects = useResource<{ objects: ObjectEntry[] }>(powered ? `${axisPath(name)}/objects` : null).value?.objects;
  const found = job?.found as Tuned | undefined;
  return (
    <>
      <AxisTabs page="tuning" name={name} />
      {!powered && <p className="empty">The drive has no power or does not answer: it cannot be tuned.</p>}
      <Trouble problem={problem} />
      {powered && gains && objects && (
        <div className="column">
          <NumberForm><Tune axis={name} gains={gains} missing={missingForTune(gains, product, (object) => objects.some((entry) => addressOf(entry) === object))} job={job} /></NumberForm>
          {found && job && <Found axis={name} found={found} />}
          <GainTable axis={name} gains={gains.gains} objects={objects} changed={`${job?.id} ${job?.state}`} />
        </div>
      )}
    </>
  );
}

// The axis's latest tuning job: from the server's list, or from the stream if it began later.
function useTuningJob(axis: string): Job | undefined {
  const known = useResource<{ jobs: Job[] }>('/jobs').value?.jobs.filter((job) => job.axis === axis && tunes.includes(job.do)).at(-1);
  const latest = useLine((line) => line.jobs[axis] as Job | undefined);
  const [seen, setSeen] = useState<Job | undefined>();
  useEffect(() => {
    if (latest && tunes.includes(latest.do)) setSeen(latest);
  }, [latest]);
  const job = seen?.axis === axis && seen.id >= (known?.id ?? 0) ? seen : known;
  // The list of jobs does not contain `found`, so the job is requested by itself.
  const whole = useResource<Job>(job?.state === 'done' && job.found === undefined ? `/jobs/${job.id}` : null).value;
  return whole !== undefined && whole.id === job?.id ? whole : job;
}

function Tune({ axis, gains, missing, job }: { axis: string; gains: Gains; missing: string; job: Job | undefined }) {
  const [bandwidth, setBandwidth] = useState(NaN);
  const [travel, setTravel] = useState(4);
  const [torque, setTorque] = useState(60);
  const [seconds, setSeconds] = useState(4);
  const isBusy = useIsBusy(axis);
  const reason = useMotionHindrance(axis);
  const cannot = isBusy || reason !== '';
  const tuning = job?.state === 'running' ? job : undefined;
  const isOutdated = useIsOutdated(job);
  // The job that this page has seen running. One that was over when the page was opened is not announced as news.
  const watched = useRef<number>();
  if (tuning) watched.current = tuning.id;
  const start = (apply: boolean) =>
    attempt(async () => {
      const request = { do: 'tune', apply, travel, torque_percent: torque, seconds, ...(Number.isFinite(bandwidth) ? { bandwidth_hz: bandwidth } : {}) };
      const over = await haltAnd(axis, request);
      if (over?.state === 'done') tell(apply ? `${axis}: the new gains are written, not stored` : `${axis}: nothing was written`);
    });
  return (
    <Panel title="Tune the velocity loop" aside={tuning && <HaltButton onHalt={() => attempt(() => cancelJob(tuning))}>End</HaltButton>}>
      {missing === '' ? (
        <>
          <p className="note">
            The axis moves slowly forward and back and is excited with a small test signal. Its response gives the velocity loop, the inertia, the resonances, and gains
            for the target bandwidth. The axis is disabled at the end. If the new gains do not reach the predicted result, the old gains are restored.
          </p>
          <div className="form">
            <NumberInput mayBeEmpty label="Target bandwidth (blank: at least 60 % of maximum)" unit="Hz" value={bandwidth} minimum={1} maximum={1000} onChange={setBandwidth} />
            <NumberInput label="Maximum forward travel" unit="rev" value={travel} minimum={0.5} maximum={1000} onChange={setTravel} />
            <NumberInput label="Torque limit" unit={`% of ${gains.full_torque}`} value={torque} minimum={1} maximum={300} onChange={setTorque} />
            <NumberInput label="Duration of each measurement" unit="s" value={seconds} minimum={4} maximum={600} onChange={setSeconds} />
          </div>
          <div className="buttons">
            <NumbersButton title={reason} isDisabled={cannot} onPress={() => start(false)}>Measure and propose</NumbersButton>
            {gains.writes && <NumbersButton kind="main" title={reason} isDisabled={cannot} onPress={() => start(true)}>Tune</NumbersButton>}
            {gains.tunes_itself && <NumbersButton title={reason} isDisabled={cannot} onPress={() => attempt(() => haltAnd(axis, { do: 'tune_itself', travel }))}>Let the drive tune itself</NumbersButton>}
          </div>
          {!gains.writes && <p className="note quiet">The gain objects of this drive are not known: gains are proposed in SI units.</p>}
        </>
      ) : (
        <>
          <p className="note">{missing}</p>
          {gains.tunes_itself && (
            <div className="buttons">
              <Button title={reason} isDisabled={cannot} onPress={() => attempt(() => haltAnd(axis, { do: 'tune_itself', travel }))}>Let the drive tune itself</Button>
            </div>
          )}
        </>
      )}
      {tuning && (
        <p className="progress" role="status">
          <progress max={1} value={tuning.progress?.share ?? 0} aria-label="Progress of the tuning" /> {tuning.progress?.doing ?? 'enabling'}
        </p>
      )}
      {!isOutdated && (job?.state === 'failed' || job?.state === 'cancelled') && (job.id === watched.current ? <Trouble problem={job.error} /> : <JobLine job={job} />)}
    </Panel>
  );
}

function Found({ axis, found }: { axis: string; found: Tuned }) {
  const figures = figuresOf(found);
  const loop = found.after ?? found.before;
  const changed = found.gains.filter(({ before, after }) => before !== after);
  const write = (which: 'before' | 'after', done: string) =>
    attempt(async () => {
      await untilHalted(axis, changed, (gain) => writeObject(axis, ...placeOf(gain.object), gain[which]));
      tell(`${axis}: ${done}`);
    });
  const text = (value: number | null | undefined, digits: number) => (typeof value === 'number' ? fixed(value, digits) : '–');
  return (
    <Panel
      title="Tuning results"
      aside={
        changed.length > 0 && (
          <>
            <Button onPress={() => write('after', 'the new gains are written')}>Write the new gains</Button>
            <Button onPress={() => write('before', 'the old gains are restored')}>Restore the old gains</Button>
          </>
        )
      }
    >
      {loop && (
        <dl className="readouts" aria-label="Mechanics">
          <Readout label="Inertia" value={significant(loop.inertia)} unit={loop.inertia_unit.replace('kg m2', 'kg·m²')} />
          <Readout label="Friction" value={significant(loop.friction)} unit={loop.torque_unit} title="at the speed of the measurement" />
          <Readout label="Constant load" value={significant(loop.constant_load)} unit={loop.torque_unit} />
          <Readout label="Loop delay" value={fixed(loop.loop_delay_ms, 2)} unit="ms" />
          {loop.resonance_hz !== undefined && <Readout label="Resonance" value={fixed(loop.resonance_hz, 0)} unit="Hz" title={`antiresonance ${fixed(loop.antiresonance_hz ?? 0, 0)} Hz`} />}
        </dl>
      )}
      {[found.changes, found.note].map((text) => text && <p key={text} className="note" role="note">{text}</p>)}
      {figures.length > 0 && (
        <Scroll label="Before and after">
          <table className="table" aria-label="Before and after">
            <thead><tr><th scope="col" className="wide">loop</th><th scope="col">before</th><th scope="col">predicted</th><th scope="col">after</th><th scope="col" className="wide">unit</th></tr></thead>
            <tbody>
              {figures.map(({ label, unit, digits, before, promised, after }) => (
                <tr key={label}>
                  <th scope="row">{label}</th>
                  <td>{text(before, digits)}</td>
                  <td>{text(promised, digits)}</td>
                  <td>{text(after, digits)}</td>
                  <td className="text">{unit}</td>
                </tr>
              ))}
            </tbody>
          </table>
        </Scroll>
      )}
      {found.gains.length > 0 ? (
        <Scroll label="Gains before and after">
          <table className="table" aria-label="Gains before and after">
            <thead><tr><th scope="col">object</th><th scope="col" className="wide">gain</th><th scope="col">before</th><th scope="col">{found.result === 'proposed' ? 'proposed' : 'after'}</th><th scope="col" className="wide">unit</th></tr></thead>
            <tbody>
              {found.gains.map(({ object, name, unit, before, after }) => (
                <tr key={object}>
                  <th scope="row" className="mono">{object}</th>
                  <td className="text">{name}</td>
                  <td>{before}</td>
                  <td>{before === after ? <span className="quiet">unchanged</span> : after}</td>
                  <td className="text">{unit}</td>
                </tr>
              ))}
            </tbody>
          </table>
        </Scroll>
      ) : (
        found.si && (
          <p className="note">
            Proposed: velocity loop {significant(found.si.velocity_kp)} {loop?.torque_unit} s/rad and {significant(found.si.velocity_ki)} {loop?.torque_unit}/rad, position loop {significant(found.si.position_kp)} /s.
          </p>
        )
      )}
      {found.before && <LoopPlot before={found.before.open_loop} after={found.after?.open_loop} />}
      {found.step_before && <StepPlot before={found.step_before} after={found.step_after} />}
    </Panel>
  );
}

function LoopPlot({ before, after }: { before: BodePoint[]; after: BodePoint[] | undefined }) {
  const shown = after ?? before;
  const x = useMemo(() => shown.map(({ hz }) => hz), [shown]);
  const curves = useMemo(() => {
    const two = (name: string, unit: string, tone: number, of: (point: BodePoint) => number): Curve[] => [
      { name: after ? `${name} after` : name, unit, tone, values: shown.map(of) },
      ...(after ? [{ name: `${name} before`, unit, tone, values: x.map((hz) => at(before, hz)).map((point) => (point ? of(point) : NaN)), faint: true }] : []),
    ];
    return [...two('gain', 'dB', 0, (point) => point.gain_db), ...two('phase', '°', 1, (point) => point.phase_deg)];
  }, [shown, before, after, x]);
  if (x.length < 2) return null;
  return <Lanes label="Open velocity loop" x={x} curves={curves} range={null} unit="Hz" logarithmic />;
}

function StepPlot({ before, after }: { before: StepMeasured; after: StepMeasured | undefined }) {
  const shown = after ?? before;
  const x = useMemo(() => shown.velocity.map((_, i) => i * shown.sample_ms), [shown]);
  const curves: Curve[] = useMemo(
    () => [
      { name: after ? 'velocity after' : 'velocity', unit: 'of the step', tone: 2, values: shown.velocity },
      ...(after ? [{ name: 'velocity before', unit: 'of the step', tone: 2, values: before.velocity, faint: true }] : []),
    ],
    [shown, before, after],
  );
  return <Lanes label="Step of the velocity" x={x} curves={curves} range={null} unit="ms" />;
}

const refresh_ms = 2000;

// All gains with their present values, in the drive's units.
function GainTable({ axis, gains, objects, changed }: { axis: string; gains: GainLine[]; objects: ObjectEntry[]; changed: string }) {
  const [values, setValues] = useState<Record<string, ObjectValue>>({});
  const reading = useRef(false);
  const read = useCallback(async () => {
    if (reading.current) return; // one request at a time, for a slow bus
    reading.current = true;
    const now = await readValues(axis, gains.map(({ object }) => object)).catch(() => undefined);
    reading.current = false;
    if (now) setValues((before) => (JSON.stringify(now) === JSON.stringify(before) ? before : now));
  }, [axis, gains]);
  useEffect(() => {
    if (gains.length === 0) return;
    void read();
    const timer = setInterval(() => void (document.hidden || read()), refresh_ms);
    return () => clearInterval(timer);
  }, [read, changed, gains]);
  const entries = useMemo(() => new Map(objects.map((entry) => [addressOf(entry), entry])), [objects]);
  if (gains.length === 0) return <p className="empty">The manual of this drive documents no gains: there are none to set here.</p>;
  const write = (object: string, value: number) =>
    attempt(async () => {
      if (!Number.isFinite(value) || value === values[object]) return;
      try {
        await writeObject(axis, ...placeOf(object), value);
      } finally {
        await read();
      }
    });
  return (
    <Panel title="Gains">
      <p className="note">Present values of the drive. A new value takes effect immediately and is lost at power-off unless it is stored (Objects, Parameters).</p>
      {setsOf(gains).map(([set, lines]) => (
        <Scroll key={set} label={set}>
          <table className="table gains" aria-label={set}>
            <caption>{set}</caption>
            <thead><tr><th scope="col">object</th><th scope="col" className="wide">gain</th><th scope="col">value</th><th scope="col" className="wide">unit</th><th scope="col">default</th><th scope="col" className="wide">effect of a higher value</th></tr></thead>
            <tbody>
              {lines.map(({ object, does }) => {
                const entry = entries.get(object);
                const value = values[object];
                const fixedDefault = typeof entry?.default === 'number' ? entry.default : undefined;
                return (
                  <tr key={object}>
                    <th scope="row" className="mono"><Link to={`/objects/${encodeURIComponent(axis)}?object=${object}&q=${object}`}>{object}</Link></th>
                    <td className="text">{entry?.name ?? ''}</td>
                    <td>
                      <NumberInput
                        whenLeft
                        label={entry?.name ?? object}
                        hideLabel
                        value={typeof value === 'number' ? value : NaN}
                        isDisabled={typeof value !== 'number'}
                        minimum={entry?.minimum ?? undefined}
                        maximum={entry?.maximum ?? undefined}
                        step={1}
                        onChange={(to) => write(object, to)}
                      />
                    </td>
                    <td className="text">{entry?.unit ?? ''}</td>
                    <td className={fixedDefault !== undefined && value !== fixedDefault ? 'differs' : ''}>{fixedDefault ?? '–'}</td>
                    <td className="text">{does}</td>
                  </tr>
                );
              })}
            </tbody>
          </table>
        </Scroll>
      ))}
    </Panel>
  );
}
