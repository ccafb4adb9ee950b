import { get, getBytes, post, problemOf, remove } from '../api/client';
import { decodeFrame } from '../api/frame';
import type { AxisView, Clock, Job, Problem, Recording } from '../api/types';
import { cancelJob, finish, following, readValues, startJob, untilHalted, writeObject } from '../commands';
import { hasPowerStage } from '../model/motion_objects';
import { samplesOf, span } from '../model/scope';
import { shownOf } from '../model/problem';
import type { LoopMeasured, Tuned } from '../model/tuning';
import { significant } from '../model/units';
import { complainOf, tell } from '../notices';
import { snapshot } from '../store';
import { entryOf, noted, notedMode, toUndo, undoing, without, type Written } from './journal';
import { measuredOf } from './measured';
import { fromDrive } from './mechanics';
import { change, changeStep, guideOf, noStep, stepOf, type Found, type LoopFound, type Proposed, type Run } from './state';
import { placeOf, type Facts, type Motion, type Numbers, type Order, type PlanRow, type Records, type Step } from './step';
import { steps } from './steps';

// The actions of the guide on a drive. Each write is recorded in the journal before it is sent, so the journal is complete
// after an interruption.

const later = (ms: number) => new Promise((resolve) => setTimeout(resolve, ms));

// Writes a plan as shown. Refuses if the drive's values have changed since the page showed them.
export async function writePlan(axis: AxisView, step: string, plan: PlanRow[]): Promise<void> {
  const { name, product } = axis;
  const now = await readValues(name, plan.map(({ object }) => object));
  const moved = plan.filter(({ object, before }) => now[object] !== before);
  if (moved.length > 0) {
    complainOf({ what: `${name}: ${moved.map(({ object }) => object).join(', ')} changed meanwhile: nothing was written`, hint: 'compare the new values, then write again' });
    return;
  }
  let failed = false;
  await untilHalted(name, plan, async ({ object, name: title, unit, before, after }) => {
    if (failed) return;
    const written: Written = { step, object, name: title, unit, before, after };
    change(name, product, (guide) => ({ ...guide, journal: noted(guide.journal, written) }));
    let problem: Problem | undefined;
    try {
      await writeObject(name, ...placeOf(object), after);
    } catch (error) {
      problem = shownOf(problemOf(error));
    }
    const kept = (await readValues(name, [object]).catch(() => ({}) as Record<string, unknown>))[object];
    if (typeof kept === 'number' && kept !== after) {
      change(name, product, (guide) => ({ ...guide, journal: noted(guide.journal, { ...written, after: kept }) }));
      problem ??= { what: `the drive keeps ${kept} instead of ${after}`, where: object, hint: 'the drive limits this value' };
    }
    if (!problem) return;
    failed = true;
    complainOf({ ...problem, what: `${name}, ${object}: ${problem.what}` });
  });
  forgetStored(axis);
  // The direction of the last move says nothing about another polarity.
  if (plan.some(({ object }) => object === '607E:00')) changeStep(name, product, step, ({ typed }) => ({ typed, found: {} }));
  if (!failed) tell(`${name}: ${plan.length} ${plan.length === 1 ? 'value' : 'values'} written`);
}

// After a write, the values that the drive has stored and a report that was saved before are out of date.
function forgetStored({ name, product }: AxisView) {
  if (stepOf(guideOf(name, product), 'report').found.saved) changeStep(name, product, 'report', () => noStep);
  if (stepOf(guideOf(name, product), 'store').found.stored) changeStep(name, product, 'store', () => noStep);
}

// Called after the drive has stored its objects: notes the values with which it starts from now on.
export async function noteStored({ name, product }: AxisView): Promise<void> {
  const { journal } = guideOf(name, product);
  const values = journal.length > 0 ? await readValues(name, [...new Set(journal.map(({ object }) => object))]) : {};
  const stored = Object.fromEntries(Object.entries(values).flatMap(([object, value]) => (typeof value === 'number' ? [[object, value] as const] : [])));
  change(name, product, (guide) => ({ ...guide, stored }));
}

// The reason why no value is written back now; empty: none. With the power stage on, an old mode of operation moves the axis at
// once if the target of that mode is not zero, and an old limit acts on a motion.
export const undoHindrance = ({ state }: Pick<AxisView, 'state'>) => (hasPowerStage(state) ? 'Disable the axis first: a value that is written back acts on the shaft at once.' : '');

async function refuseWhilePowered(axis: AxisView) {
  const reason = undoHindrance(await latest(axis));
  if (reason) throw new Error(`${axis.name}: ${reason}`);
}

// Writes the old values back in reverse order. A value that another client has changed is not written, and its entry stays in the journal.
export async function undo({ axis, powerOn }: Facts, step: string | null): Promise<void> {
  const { name, product } = axis;
  await refuseWhilePowered(axis);
  const entries = toUndo(guideOf(name, product).journal, step);
  const now = await readValues(name, [...new Set(entries.map(({ object }) => object))]);
  const strange: string[] = [];
  await untilHalted(name, entries, async (entry) => {
    const { journal } = guideOf(name, product);
    const present = entryOf(journal, entry.step, entry.object);
    if (!present) return;
    const undone = without(journal, present);
    const how = undoing(journal, present, now[entry.object], powerOn);
    if (how === null) {
      strange.push(entry.object);
      return;
    }
    if (how === 'write' && undone.write !== null) {
      await refuseWhilePowered(axis); // another client may have enabled it
      await writeObject(name, ...placeOf(entry.object), undone.write);
      now[entry.object] = undone.write;
    }
    change(name, product, (guide) => {
      const same = entryOf(guide.journal, entry.step, entry.object);
      return same ? { ...guide, journal: without(guide.journal, same).journal } : guide;
    });
  });
  forgetStored(axis);
  // Measurements with the old values are no longer valid, and neither is the mark.
  for (const id of new Set(entries.map((entry) => entry.step))) changeStep(name, product, id, ({ typed }) => ({ typed, found: {} }));
  if (strange.length > 0) complainOf({ what: `${name}: ${strange.join(', ')} was changed by another and stays`, hint: 'take it out of the list, or write it on the page Objects' });
  else tell(`${name}: undone`);
}

export const leaveAsItIs = ({ name, product }: AxisView, entry: Written) => change(name, product, (guide) => {
  const same = entryOf(guide.journal, entry.step, entry.object); // an undo may have changed its `before`
  return { ...guide, journal: guide.journal.filter((each) => each !== same) };
});

// Writes a value again that the drive has lost, for example at a power cut.
export async function writeAgain(axis: AxisView, { object, after }: Written): Promise<void> {
  await refuseWhilePowered(axis);
  await writeObject(axis.name, ...placeOf(object), after);
  forgetStored(axis);
}

// ---- Motions ----

const mine = new Set<string>(); // runs of this tab
const aborted = new Set<string>(); // runs that begin no further job, even if the abort came between two jobs

const setRun = ({ name, product }: AxisView, to: (run: Run) => Run) => change(name, product, (guide) => (guide.run ? { ...guide, run: to(guide.run) } : guide));

const place = (axis: AxisView, facts: Facts) => {
  const turn = facts.geometry?.index_every;
  return { drive: axis.position_actual ?? axis.position_counts, shaft: turn && axis.position_actual !== undefined ? axis.position_counts / turn : null };
};

const latest = ({ name }: AxisView) => get<AxisView>(`/axes/${encodeURIComponent(name)}`);

const hasNoPower = (axis: AxisView) => latest(axis).then(({ powered }) => !powered, () => false);

// Reads the position from the drive: the server's view of a drive on a bus may be older than the end of the last job.
async function placeNow(axis: AxisView, facts: Facts) {
  const [view, values] = await Promise.all([latest(axis), readValues(axis.name, ['6064:00'])]);
  const seen = place(view, facts);
  const actual = values['6064:00'];
  return typeof actual === 'number' ? { ...seen, drive: actual } : seen;
}

// Runs the jobs of a motion one after the other. Each begins only if nothing else commanded the axis since the one before. The
// first is a halt, sent at the press: a STOP of any client from then on keeps the others from beginning, also during the reads.
export async function runMotion(facts: Facts, step: Step, motion: Motion, numbers: Numbers, keys: string[]): Promise<void> {
  const { axis } = facts;
  const { name, product } = axis;
  const begins = ['stop', ...motion.begins];
  const orders: Order[] = [...begins.map((each) => ({ do: each })), ...motion.orders(numbers, facts)];
  const id = `${Date.now()}-${Math.random()}`;
  mine.add(id);
  const begun: Run = {
    id, step: step.id, motion: motion.id, jobs: [], of: orders.length, state: 'running', start: snapshot().start, from: place(axis, facts),
    mode: motion.mode(facts), values: Object.fromEntries(keys.map((key) => [key, numbers(key)])),
  };
  change(name, product, (guide) => ({ ...guide, run: begun }));
  try {
    const records = motion.records?.(numbers, facts);
    let before: Job | undefined;
    for (const [i, order] of orders.entries()) {
      if (i === 1) {
        const from = await placeNow(axis, facts); // at rest
        setRun(axis, (run) => ({ ...run, from }));
        await noteMode(facts, step.id, motion.mode(facts));
      }
      if (records && i === begins.length) await record(axis, records);
      const { run } = guideOf(name, product);
      if (run?.state !== 'running') return;
      if (aborted.has(id) || !isOfThisServer(run)) break;
      const job = await startJob(name, { ...order, ...(before ? following(before, (records?.duration_ms ?? 0) / 1000) : {}) });
      setRun(axis, (run) => ({ ...run, jobs: [...run.jobs, job.id] }));
      before = await finish(job);
      if (before.state !== 'done') break;
      if (records && i === begins.length && i + 1 < orders.length) await recorded(axis);
    }
    await complete(facts, before);
  } catch (error) {
    await endRecording(axis);
    await noteModeLeft(facts);
    const hadNoPower = await hasNoPower(axis);
    setRun(axis, (run) => ({ ...run, state: 'failed', error: shownOf(problemOf(error)), hadNoPower }));
  } finally {
    mine.delete(id);
  }
}

const mode = '6060:00';
const modeWritten = ({ entries }: Facts, step: string, before: number, after: number): Written => ({ step, object: mode, name: entries.get(mode)?.name ?? '', unit: '', before, after });

// The jobs set the mode of operation: it is noted like every other write, before they begin.
async function noteMode(facts: Facts, step: string, after: number) {
  const { name, product } = facts.axis;
  const before = (await readValues(name, [mode]))[mode];
  if (typeof before !== 'number') return;
  setRun(facts.axis, (run) => ({ ...run, modeBefore: before }));
  if (before === after) return;
  change(name, product, (guide) => ({ ...guide, journal: noted(guide.journal, modeWritten(facts, step, before, after)) }));
}

// A job may end before it sets the mode, may set another mode for some time, or may restore the mode. So the journal
// gets the mode that is in the drive at the end.
async function noteModeLeft(facts: Facts) {
  const { name, product } = facts.axis;
  const { run } = guideOf(name, product);
  const motion = steps.find(({ id }) => id === run?.step)?.motions?.find(({ id }) => id === run?.motion);
  if (run?.modeBefore === undefined || !motion) return;
  const { step, modeBefore: before } = run;
  const now = (await readValues(name, [mode]).catch(() => ({}) as Record<string, unknown>))[mode];
  if (typeof now === 'number') change(name, product, (guide) => ({ ...guide, journal: notedMode(guide.journal, modeWritten(facts, step, before, now), [run.mode ?? motion.mode(facts), ...(motion.passes ?? [])]) }));
}

async function record(axis: AxisView, records: Records) {
  const channels = records.channels.map(({ object, signal }) => ({ axis: axis.name, ...(object ? { object } : { signal: signal! }) }));
  const { id } = await post<Recording>('/recordings', {
    name: `guide, ${axis.name}`, channels, rate_hz: records.rate_hz, duration_ms: records.duration_ms, pre_ms: records.pre_ms,
    trigger: { kind: 'edge', channel: 0, level: records.level, slope: records.sign < 0 ? 'falling' : 'rising' },
  });
  setRun(axis, (run) => ({ ...run, recording: id }));
  // A recording has nothing from before its request: the motion begins when the time before the trigger is recorded.
  const begin_ms = await lineTime();
  while ((await lineTime()) < begin_ms + records.pre_ms + 5 && guideOf(axis.name, axis.product).run?.state === 'running') await later(20);
}

// The move back begins when the recording of the move there has ended.
async function recorded({ name, product }: AxisView) {
  for (;;) {
    const { run } = guideOf(name, product);
    if (run?.state !== 'running' || run.recording === undefined) return;
    if ((await get<Recording>(`/recordings/${run.recording}`)).state !== 'running') return;
    await later(50);
  }
}

const lineTime = async () => (await get<Clock>('/clock')).time_ms;

// A restarted server counts jobs and recordings from 1 again, so the numbers of a run are then those of others.
const isOfThisServer = (run: Run) => run.start === snapshot().start;

async function endRecording({ name, product }: AxisView) {
  const { run } = guideOf(name, product);
  if (run?.recording !== undefined && isOfThisServer(run)) await remove(`/recordings/${run.recording}`).catch(() => undefined);
}

// The end of a run: its last job is over. Reads the recording and the measurements.
async function complete(facts: Facts, last: Job | undefined): Promise<void> {
  const { axis } = facts;
  const { name, product } = axis;
  if (guideOf(name, product).run?.state !== 'running') return;
  await noteModeLeft(facts);
  const { run } = guideOf(name, product);
  if (run?.state !== 'running') return;
  if (!isOfThisServer(run)) {
    setRun(axis, (now) => ({ ...now, state: 'interrupted', error: { what: 'the server was restarted before the sequence was complete' } }));
    return;
  }
  if (!last || last.state !== 'done' || run.jobs.length < run.of) {
    await endRecording(axis);
    const interrupted = last ? last.state === 'done' : aborted.has(run.id);
    const error = last?.error ? shownOf(last.error) : { what: interrupted ? `${aborted.has(run.id) ? 'aborted' : 'the page was left'} before the sequence was complete` : `${last?.do.replaceAll('_', ' ') ?? 'motion'}: ${last?.state ?? 'not begun'}` };
    const hadNoPower = await hasNoPower(axis);
    setRun(axis, (now) => ({ ...now, state: interrupted ? 'interrupted' : 'failed', error, hadNoPower }));
    return;
  }
  const step = steps.find(({ id }) => id === run.step);
  const motion = step?.motions?.find(({ id }) => id === run.motion);
  if (!step || !motion) return;
  const numbers: Numbers = (key) => run.values[key];
  const found: Found = {};
  const records = motion.records?.(numbers, facts);
  // Only the address of the job itself has the result of a measurement.
  const whole = last.do === 'tune' ? await get<Job>(`/jobs/${last.id}`) : last;
  if (last.do === 'tune') Object.assign(found, tuned(whole.found as Tuned, stepOf(guideOf(name, product), step.id).found));
  if (last.do === 'home') found.homedBy = run.values.method;
  if (records && run.recording !== undefined && facts.scale) {
    const measured = await measure(run.recording, records, facts);
    if (measured) Object.assign(found, stepOf(guideOf(name, product), step.id).found.first ? { last: measured } : { first: measured });
  }
  if (last.do === 'move' && facts.scale) {
    const now = await placeNow(axis, facts);
    const turns = (value: number) => fromDrive(facts.scale!, 'position', value);
    found.moved = { asked: numbers('distance'), drive: turns(now.drive - run.from.drive), shaft: now.shaft === null || run.from.shaft === null ? null : now.shaft - run.from.shaft };
  }
  changeStep(name, product, step.id, ({ found: { way, ...before }, ...state }) => ({ ...state, found: { ...before, ...(way && !found.moved ? { way } : {}), ...found } }));
  setRun(axis, (present) => ({ ...present, state: 'done' }));
}

async function measure(id: number, records: Records, facts: Facts) {
  let recording = await get<Recording>(`/recordings/${id}`);
  // The recording ends a little after the motion, in the line's time.
  while (recording.state === 'running' || recording.state === 'armed') {
    if (recording.state === 'armed') await post(`/recordings/${id}/stop`);
    await later(100);
    recording = await get<Recording>(`/recordings/${id}`);
  }
  if (recording.trigger_tick === null) {
    complainOf({ what: `${facts.axis.name}: the motion did not reach the level that starts the recording`, hint: 'enter a longer distance or a lower velocity' });
    return null;
  }
  const whole = samplesOf(recording, decodeFrame(await getBytes(`/recordings/${id}/data`)));
  const [from, to] = span(whole.x, -records.pre_ms, records.end_ms ?? Infinity);
  const samples = { ...whole, x: whole.x.slice(from, to), values: whole.values.map((each) => each.slice(from, to)) };
  void remove(`/recordings/${id}`).catch(() => undefined);
  return measuredOf(samples, records.channels, facts.scale!, records.request, new Date().toISOString());
}

const loopOf = (loop: LoopMeasured): LoopFound => ({
  bandwidth_hz: loop.bandwidth_hz, phase_margin_deg: loop.phase_margin_deg, resonance_hz: loop.resonance_hz ?? null,
  inertia: `${significant(loop.inertia)} ${loop.inertia_unit}`, friction: `${significant(loop.friction)} ${loop.torque_unit}`,
});

function tuned(result: Tuned, before: Found): Found {
  if (!result.before) return {};
  const loop = loopOf(result.before);
  const proposed: Proposed = {
    bandwidth_hz: result.promised_bandwidth_hz ?? null, phase_margin_deg: result.predicted?.phase_margin_deg ?? null,
    values: Object.fromEntries(result.gains.map(({ object, after }) => [object, after])),
  };
  // The first measurement makes a proposal; a later one checks it and does not change it.
  return before.loop ? { loopLast: loop } : { loop, ...(result.gains.length > 0 ? { proposed } : {}) };
}

// After a reload: a run that no tab continues. Its present job continues; the guide starts no further job.
export function adopt(facts: Facts): () => void {
  const { name, product } = facts.axis;
  let over = false;
  let quiet = 0;
  let seen = '';
  let busy = false;
  const look = async () => {
    const { run } = guideOf(name, product);
    if (over || busy || run?.state !== 'running' || mine.has(run.id) || snapshot().start === '') return;
    busy = true;
    await judge(run).finally(() => {
      busy = false;
    });
  };
  const judge = async (run: Run) => {
    const id = run.jobs.at(-1);
    const job = id === undefined || !isOfThisServer(run) ? undefined : await get<Job>(`/jobs/${id}`).catch(() => undefined);
    // Another tab may continue the run: it then changes the run or the axis within this time.
    const now = JSON.stringify([run, job?.state, snapshot().jobs[name]?.id]);
    quiet = now === seen && job?.state !== 'running' ? quiet + 1 : 0;
    seen = now;
    if (quiet < 3 || over) return;
    mine.add(run.id);
    await complete(facts, job).catch((error: unknown) => setRun(facts.axis, (present) => ({ ...present, state: 'failed', error: shownOf(problemOf(error)) })));
    mine.delete(run.id);
  };
  const timer = setInterval(() => void look(), 700);
  return () => {
    over = true;
    clearInterval(timer);
  };
}

// Ends the present job of the axis; the sequence does not continue.
export async function abort({ name, product }: AxisView): Promise<void> {
  const { run } = guideOf(name, product);
  if (run) aborted.add(run.id);
  const job = snapshot().jobs[name] as Job | undefined;
  // A halt between two jobs is the last command of the axis, so the server refuses the next job of the sequence.
  if (job?.state === 'running') await cancelJob(job);
  else await startJob(name, { do: 'stop' });
}
