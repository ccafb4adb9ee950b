import type { Control, Note } from './page_log';
import type { JobEvent, Samples } from './stream';

// What a person has asked for, and whether the shafts do that and nothing else.
//
// A press of a control that asks for motion gives a *leave* for some jobs of an axis. A job that the server accepts uses up
// a leave of its page. Later commands to the axis, and STOP, take the leaves back. A job without a leave is a violation.
//
// A shaft may turn while a job with a leave moves it: until the job is over, for `velocity` and `torque` until the next
// command. Afterwards it must be at rest after the time of its ramp, and keep its place.

export const ticksPerMs = 16;
const rest_rpm = 3;
// Until a halt has taken a torque back. Measured by 192 stops of each axis out of moves, velocities, sweeps and torques of
// 10 %: the JMC gains 59 rpm, the others at most 9 rpm.
const overshoot_rpm: Record<string, number> = { jmc: 90 };
const usual_overshoot_rpm = 30;
// At rest the friction lets go of a shaft again and again. Measured are slips of 8 rpm for 5 ms (JMC) and of 4 rpm for 10 ms
// (iSMK after a halt in homing).
const slip_rpm = 15;
const creep_revolutions = 0.01;
// A shaft without torque is braked by the friction of its motor: measured is a loss of 1700 rpm a second at least.
const coasting_rpm_per_s = 900;
const settle_ms = 150; // of the loops, after the ramp
const still_ms = 50; // a shaft that was slow for so long has come to rest, and stays there
const longest_halt_ms = 250; // then a halt becomes a quick stop (docs/bench-api.md, "Jobs")

const moving = ['move', 'velocity', 'torque', 'home', 'jog', 'sweep', 'step', 'tune', 'tune_itself'];
const goesOn = ['velocity', 'torque']; // until the next command, also after the job is done
const asked = [...moving, 'enable'];

type Wanted = Record<string, number>; // jobs and how many of them

export interface Leave {
  at: number; // number of the note that gave it
  tab: number;
  axis: string;
  left: Wanted;
  text: string;
  ofPage?: string; // it ends when the page leaves this path
  repeats?: boolean; // as long as the switch of its page is on
}

// ---- Which control asks for what ----

const once = (...kinds: string[]): Wanted => Object.fromEntries(kinds.map((kind) => [kind, kinds.filter((each) => each === kind).length]));
const ofAxisPage: Record<string, Wanted> = {
  'Move +': once('enable', 'move'), Move: once('enable', 'move'), '− Back': once('enable', 'move'), 'Go to zero': once('enable', 'move'),
  'There and back': once('enable', 'move', 'move'), Run: once('enable', 'velocity'), Apply: once('enable', 'torque'), Home: once('enable', 'home'),
};
const ofGuide: Record<string, Wanted> = {
  'Make the small move': once('stop', 'enable', 'move'), 'Measure a step': once('stop', 'disable', 'enable', 'step'),
  'Measure the loop and propose gains': once('stop', 'tune'), 'Measure a move': once('stop', 'enable', 'move'), Home: once('stop', 'enable', 'home'),
  'There and back': once('stop', 'enable', 'move', 'move'),
};
const ofTuning: Record<string, Wanted> = { 'Measure and propose': once('stop', 'tune'), Tune: once('stop', 'tune'), 'Let the drive tune itself': once('stop', 'tune_itself') };

export type Widgets = Record<string, { axis: string; wants: Wanted }[]>; // of the dashboard, by title of the button or script

export function leavesOf({ name, region, path, disabled, fields, isJog }: Control, axes: string[], widgets: Widgets): { axis: string; wants: Wanted; ofPage?: string; repeats?: boolean }[] {
  if (disabled) return [];
  const [, page, axis = ''] = path.split('?')[0].split('/').map(decodeURIComponent);
  if (name === 'Enable all') return axes.map((each) => ({ axis: each, wants: once('enable') }));
  const ofCard = page === '' ? region : axis;
  if (name === 'Enable' || /^\d+ enable operation/.test(name)) return [{ axis: ofCard, wants: once('enable') }];
  if (/^\d+ .*→ operation enabled$/.test(name)) return [{ axis, wants: once('enable') }];
  if (page === 'axis' && isJog) return [{ axis, wants: once('stop', 'jog') }];
  if (page === 'axis' && name in ofAxisPage) return [{ axis, wants: { ...ofAxisPage[name] }, repeats: name === 'There and back' }];
  if (page === 'commission' && name in ofGuide) {
    const cycles = name === 'There and back' ? Math.max(1, Math.round(Number(fields.Cycles) || 1)) : 1;
    return [{ axis, wants: cycles > 1 ? { stop: 1, enable: 1, move: 2 * cycles } : { ...ofGuide[name] } }];
  }
  if (page === 'tuning' && name in ofTuning) return [{ axis, wants: { ...ofTuning[name] } }];
  if (page === 'scope' && name === 'Move and record') return [{ axis: fields.Axis, wants: once('enable', 'move') }];
  if (page === 'scope' && /^(Sweep|Step) and record$/.test(name)) return [{ axis: fields['Axis to excite'], wants: once('enable', name.startsWith('Sweep') ? 'sweep' : 'step') }];
  const key = name === 'Run' ? region : name;
  if (page === 'boards' && key in widgets) return widgets[key].map((each) => ({ ...each, wants: { ...each.wants }, ...(name === 'Run' ? { ofPage: path } : {}) }));
  return [];
}

// ---- The axes ----

interface Shaft {
  speed: number; // rpm
  turns: number;
  energised: boolean;
  job: number | null; // that moves it now
  free: boolean; // it may turn
  due: number; // tick: from here on it is at rest
  from: number; // speed when it began to stop
  asked: number; // tick of the command to stop: samples until then show the speed that it stops from
  since: number | null; // tick: it has been slow since then
  recent: number[]; // its last speeds, one each 10 ms
  place: number | null; // where it rests
  why: string; // what it obeys
  ramp_rpm_per_s: number; // its quick stop
  isDisturbed: boolean; // the test bench loads, locks or spoils it: it is not judged until the next sequence
}

interface Request {
  tab: number;
  at: number;
  n: number;
  method: string;
  path: string;
  body: { do?: string; after?: number };
  leave: Leave | null;
}

export class Model {
  violations: string[] = [];
  counts: Record<string, number> = {}; // how often each thing happened
  most: Record<string, number> = {}; // the largest value of each measured quantity
  pending: Request[] = []; // sent, not answered
  tick = 0; // of the last sample
  now = 0; // tick of the line: the last samples before it come later
  isQuiet = false; // between two sequences nothing is judged
  private notes = 0;
  private leaves: Leave[] = [];
  private stoppedAt = 0; // number of the note of the last STOP
  private stopsOwed = 0; // presses of STOP without their request
  private readonly repeating = new Map<number, boolean>(); // of each tab: the switch "repeat there and back"
  private readonly requests = new Map<number, Request>(); // by the job that it began
  private lost: Request[] = []; // the page was reloaded before the answer
  private readonly told: JobEvent[] = [];
  private readonly samples: Samples[] = [];
  private readonly shafts: Map<string, Shaft>;
  private began = new Map<number, { axis: string; do: string; moves: boolean }>();

  constructor(private readonly axes: { name: string; counts: number }[], private readonly widgets: Widgets) {
    this.shafts = new Map(axes.map(({ name }) => [name, { speed: 0, turns: 0, energised: false, job: null, free: false, due: 0, from: 0, asked: 0, since: null, recent: [], place: null, why: 'nothing', ramp_rpm_per_s: coasting_rpm_per_s, isDisturbed: false }]));
  }

  count(what: string) {
    this.counts[what] = (this.counts[what] ?? 0) + 1;
  }

  private measure(what: string, value: number) {
    this.most[what] = Math.max(this.most[what] ?? value, value);
  }

  private blame(text: string) {
    if (!this.isQuiet) this.violations.push(text);
  }

  setRamp(axis: string, rpm_per_s: number) {
    this.shafts.get(axis)!.ramp_rpm_per_s = Math.min(coasting_rpm_per_s, rpm_per_s);
  }

  energised = (axis: string) => this.shafts.get(axis)!.energised;
  disturbed = (axis: string) => this.shafts.get(axis)!.isDisturbed;

  // A new sequence: nothing is asked for, all axes are at rest.
  begin() {
    this.leaves = [];
    this.lost = [];
    this.stopsOwed = 0;
    this.violations = [];
    this.repeating.clear();
    for (const shaft of this.shafts.values()) Object.assign(shaft, { job: null, free: false, due: 0, since: null, place: null, why: 'nothing', isDisturbed: false });
  }

  // ---- What the page reports ----

  note(tab: number, note: Note) {
    const at = ++this.notes;
    if (note.kind === 'loaded') this.leave(tab, null);
    else if (note.kind === 'went') this.leave(tab, note.path);
    else if (note.kind === 'press') this.press(tab, at, note.control);
    else if (note.kind === 'stop') this.stop(at, 'Ctrl+Space');
    else if (note.kind === 'toggle' && note.name === 'repeat there and back') this.repeating.set(tab, note.on);
    else if (note.kind === 'request') this.request(tab, at, note);
    else if (note.kind === 'answer') this.answer(tab, note.n, note.status, note.body);
  }

  private press(tab: number, at: number, control: Control) {
    if (control.name === 'STOP' && !control.disabled) return this.stop(at, 'the button STOP');
    for (const { axis, wants, ofPage, repeats } of leavesOf(control, this.axes.map(({ name }) => name), this.widgets)) {
      this.leaves.push({ at, tab, axis, left: wants, text: `"${control.name}" at ${control.path}`, ...(ofPage ? { ofPage } : {}), ...(repeats ? { repeats } : {}) });
      if (Object.keys(wants).some((kind) => moving.includes(kind))) this.count(`asked: ${control.isJog ? 'jog' : control.path.split('/')[1].split('?')[0] + ' ' + control.name}`);
    }
  }

  private stop(at: number, by: string) {
    this.count(`STOP by ${by}`);
    if ([...this.shafts.values()].some(({ speed }) => Math.abs(speed) > rest_rpm)) this.count('STOP while a shaft turns');
    this.leaves = [];
    this.stoppedAt = at;
    ++this.stopsOwed;
    for (const shaft of this.shafts.values()) this.slow(shaft, this.present, 0, 'STOP');
  }

  // The page has been left or loaded again: its scripts have ended, and the rest of its doings with a reload.
  leave(tab: number, path: string | null) {
    if (path === null) this.lost.push(...this.leaves.filter((leave) => leave.tab === tab).flatMap(unreported));
    this.leaves = this.leaves.filter((leave) => leave.tab !== tab || (path !== null && (leave.ofPage === undefined || viewOf(leave.ofPage) === viewOf(path))));
    if (path !== null) return;
    this.lost.push(...this.pending.filter((each) => each.tab === tab));
    this.pending = this.pending.filter((each) => each.tab !== tab);
    this.repeating.set(tab, false);
  }

  private request(tab: number, at: number, { n, method, path, body }: { n: number; method: string; path: string; body: string }) {
    const given: Request['body'] = path.endsWith('/jobs') ? (JSON.parse(body) as Request['body']) : {};
    const made: Request = { tab, at, n, method, path, body: given, leave: null };
    this.pending.push(made);
    const axis = axisOf(path);
    if (path === '/stop') --this.stopsOwed;
    if (given.do && axis) made.leave = this.take(tab, axis, given.do, given.after);
    if (method === 'PUT' && /\/(plant|inputs)$/.test(path) && axis) this.disturb(axis, path.endsWith('/inputs') ? 'inputs forced' : 'plant changed');
    if (method === 'POST' && /\/faults$/.test(path) && axis) this.disturb(axis, 'fault injected');
  }

  private disturb(axis: string, what: string) {
    this.count(what);
    this.shafts.get(axis)!.isDisturbed = true;
  }

  private take(tab: number, axis: string, what: string, after: number | undefined): Leave | null {
    // A job that follows another belongs to the same press.
    const before = after === undefined ? undefined : this.requests.get(after)?.leave;
    const fits = (each: Leave) => each.tab === tab && each.axis === axis && (each.left[what] ?? 0) > 0 && (before == null || each === before);
    const leave = newest(this.leaves, fits);
    if (leave) {
      --leave.left[what];
      return leave;
    }
    const again = newest(this.leaves, (each) => each.tab === tab && each.axis === axis && each.repeats === true && what === 'move' && this.repeating.get(tab) === true);
    if (again) again.left.move = 1; // and back
    return again ?? null;
  }

  private answer(tab: number, n: number, status: number, body: string) {
    const made = this.pending.find((each) => each.tab === tab && each.n === n);
    if (!made) return;
    this.pending = this.pending.filter((each) => each !== made);
    if (status === 0 || status >= 300) {
      if (made.body.do) this.count(`${status === 0 ? 'taken back' : 'refused'}: ${made.body.do}`);
      // The page has taken it back by STOP or a halt. The server may have begun it already.
      if (status === 0 && made.body.do) this.lost.push(made);
      // The motion does not happen; what the person asked for is not taken back by this.
      return;
    }
    if (made.path.endsWith('/jobs')) this.accepted(made, (JSON.parse(body) as { id: number }).id);
    else if (made.method === 'DELETE' && made.path.startsWith('/jobs/')) this.count('a job ended by hand');
    else if (made.method === 'PUT' && /\/objects\/6040\//.test(made.path)) this.commanded(axisOf(made.path)!, made, 'controlword');
    else if (made.path.endsWith('/power')) this.commanded(axisOf(made.path)!, made, 'power');
    else if (made.method === 'PUT' && made.path.includes('/objects/')) this.count('object written');
  }

  // Another command than before: it takes back what was asked for earlier.
  private commanded(axis: string, { leave, at }: Request, what: string) {
    this.count(what);
    this.leaves = this.leaves.filter((each) => each.axis !== axis || each === leave || each.at > (leave?.at ?? at));
    if (what !== 'controlword' && what !== 'power') return;
    const shaft = this.shafts.get(axis)!;
    if (shaft.job === null) this.slow(shaft, this.present, longest_halt_ms, what);
  }

  private accepted(made: Request, id: number) {
    const what = made.body.do!;
    const axis = axisOf(made.path)!;
    this.requests.set(id, made);
    if (asked.includes(what) && !made.leave) this.blame(`${axis}: the page began the job ${what} (${id}), which nobody asked for`);
    // A request that was on its way when STOP was pressed may come behind it. It may not move the axis.
    const late = made.leave !== null && made.leave.at < this.stoppedAt;
    if (late && made.at > this.stoppedAt) this.blame(`${axis}: after STOP the page began the job ${what} (${id}) of ${made.leave?.text}`);
    if (late) this.count('job behind STOP');
    this.commanded(axis, made, `job ${what}`);
  }

  // ---- What the line reports ----

  job(event: JobEvent) {
    this.told.push(event);
  }

  take_samples(samples: Samples) {
    this.samples.push(samples);
  }

  get known() {
    const last = this.samples[this.samples.length - 1];
    return last ? last.tick + last.stride * ((last.channels[0]?.length ?? 1) - 1) : this.tick;
  }

  // A job has begun whose request the page has not reported yet.
  get isAhead() {
    return !this.isQuiet && this.told.some(({ job }) => !this.began.has(job.id) && !this.requests.has(job.id) && !this.lost.some((each) => each.body.do === job.do));
  }

  // Judges all that was received. All answers of the page are there.
  judge() {
    if (this.stopsOwed > 0) this.blame('STOP was pressed, and the page sent no stop');
    for (const { tick, stride, channels } of this.samples.splice(0)) {
      for (let i = 0; i < (channels[0]?.length ?? 0); ++i) {
        const now = tick + i * stride;
        while (this.told.length > 0 && this.told[0].tick <= now) this.hear(this.told.shift()!);
        this.axes.forEach(({ name, counts }, axis) => this.look(name, now, channels[3 * axis][i], channels[3 * axis + 1][i], channels[3 * axis + 2][i] / counts));
        this.tick = now;
      }
    }
    for (const event of this.told.splice(0)) this.hear(event);
  }

  private hear({ tick, axis, job: { id, do: what, state, ending, error } }: JobEvent) {
    const shaft = this.shafts.get(axis)!;
    const known = this.began.get(id);
    if (!known) {
      const made = this.requests.get(id) ?? this.lostRequest(axis, what);
      const isLate = made?.leave != null && made.leave.at < this.stoppedAt;
      const moves = moving.includes(what) && made?.leave != null && !isLate;
      this.began.set(id, { axis, do: what, moves });
      if (moves) Object.assign(shaft, { free: true, job: id, place: null, why: `${what} (${id})` });
      else if (['stop', 'quick_stop', 'disable'].includes(what)) this.slow(shaft, tick, longest_halt_ms, what);
    }
    if (state === 'running' && !ending) return;
    if (state !== 'running') this.count(`${what} ${state}${state === 'failed' && error ? `: ${error.what.replace(/ \[.*| at .*/, '').replace(/-?\b\d+(\.\d+)?\b/g, 'N')}` : ''}`);
    if (shaft.job !== id) return;
    if (state !== 'running') shaft.job = null;
    if (state === 'done' && goesOn.includes(what)) return;
    this.slow(shaft, tick, longest_halt_ms, `${what} (${id}) ${ending ? 'is ending' : state}`);
  }

  private lostRequest(axis: string, what: string): Request | undefined {
    const found = this.lost.find((each) => axisOf(each.path) === axis && each.body.do === what);
    this.lost = this.lost.filter((each) => each !== found);
    if (!found && asked.includes(what) && !this.isQuiet) this.blame(`${axis}: the job ${what} began, and no page has sent it`);
    return found;
  }

  private get present() {
    return Math.max(this.now, this.tick);
  }

  // From here on the shaft may only slow down. The due time is not put off by a second command.
  private slow(shaft: Shaft, tick: number, more_ms: number, why: string) {
    const within_ms = more_ms + settle_ms + (1000 * Math.abs(shaft.speed)) / shaft.ramp_rpm_per_s;
    const due = tick + within_ms * ticksPerMs;
    if (shaft.free) Object.assign(shaft, { due, from: Math.max(...[shaft.speed, ...shaft.recent.slice(-3)].map(Math.abs)), asked: tick, since: null, place: null });
    else if (tick < shaft.due) shaft.due = Math.min(shaft.due, due);
    Object.assign(shaft, { free: false, why });
  }

  private look(name: string, tick: number, rpm: number, state: number, turns: number) {
    const shaft = this.shafts.get(name)!;
    const speed = Number.isNaN(rpm) ? 0 : rpm;
    const energised = state >= 4 && state <= 6;
    if (shaft.energised && !energised && shaft.free && shaft.job === null) this.slow(shaft, tick, 0, 'the drive is off');
    Object.assign(shaft, { speed, energised });
    if (!Number.isNaN(turns)) shaft.turns = turns;
    if (tick % (10 * ticksPerMs) < ticksPerMs) shaft.recent = [...shaft.recent.slice(-39), speed];
    if (Math.abs(speed) > rest_rpm && !this.isQuiet) this.count('ms that shafts turned');
    if (shaft.free || this.isQuiet || shaft.isDisturbed || Number.isNaN(rpm)) return;
    const fast = Math.abs(speed);
    if (tick <= shaft.asked && fast > shaft.from) {
      shaft.due += ((1000 * (fast - shaft.from)) / shaft.ramp_rpm_per_s) * ticksPerMs;
      shaft.from = fast;
    }
    if (tick < shaft.due) {
      shaft.since = fast > rest_rpm ? null : (shaft.since ?? tick);
      if (shaft.since !== null && tick - shaft.since >= still_ms * ticksPerMs) shaft.due = tick;
      this.measure(`rpm of ${name} above 1.1 times the speed at which it began to stop`, fast - 1.1 * shaft.from);
      if (fast > 1.1 * shaft.from + (overshoot_rpm[name] ?? usual_overshoot_rpm)) this.fail(shaft, name, tick, `speeds up from ${shaft.from.toFixed(1)} to ${speed.toFixed(1)} rpm`);
      return;
    }
    if (fast > slip_rpm) return this.fail(shaft, name, tick, `turns at ${speed.toFixed(1)} rpm`);
    shaft.place ??= shaft.turns;
    if (Math.abs(shaft.turns - shaft.place) > creep_revolutions) this.fail(shaft, name, tick, `has crept by ${(shaft.turns - shaft.place).toFixed(4)} revolutions`);
  }

  private fail(shaft: Shaft, name: string, tick: number, what: string) {
    this.blame(`${name} ${what} at ${(tick / ticksPerMs).toFixed(1)} ms, ${shaft.energised ? 'with' : 'without'} torque; it obeys: ${shaft.why} since ${(shaft.asked / ticksPerMs).toFixed(1)} ms, began to stop at ${shaft.from.toFixed(1)} rpm, and was to be at rest at ${(shaft.due / ticksPerMs).toFixed(1)} ms; rpm each 10 ms before: ${shaft.recent.map((each) => each.toFixed(0)).join(' ')}`);
    shaft.isDisturbed = true; // one report is enough
  }
}

// A document that is left may have sent what a press still permits, and its last reports may not have arrived.
const unreported = (leave: Leave): Request[] =>
  Object.entries(leave.left).flatMap(([kind, count]) =>
    Array.from({ length: count }, () => ({ tab: leave.tab, at: leave.at, n: 0, method: 'POST', path: `/axes/${encodeURIComponent(leave.axis)}/jobs`, body: { do: kind }, leave })),
  );

// A dashboard is shown until another page or another dashboard is. The first one has no name in the address.
const viewOf = (path: string) => {
  const { pathname, searchParams } = new URL(path, 'http://page');
  return `${pathname} ${searchParams.get('name') ?? 'Monkey'}`;
};

// As Array.findLast, which Node.js 18 has and the types of ES2022 do not.
const newest = <T>(all: T[], fits: (one: T) => boolean): T | undefined => [...all].reverse().find(fits);

const axisOf = (path: string): string | undefined => {
  const found = /^\/axes\/([^/]+)\//.exec(path);
  return found ? decodeURIComponent(found[1]) : undefined;
};
