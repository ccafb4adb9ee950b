// Scripts of a dashboard: jobs and writes in sequence, in a part of the language of `servodrome run` (docs/script.md).
//
//   reference enable
//   repeat 3
//     reference move by 1 velocity 10 acceleration 100
//     wait 0.5
//   end
//   reference set 6083:00 5000

import { isMotionObject } from './motion_objects';

export type Step =
  | { line: number; kind: 'job'; axis: string; request: { do: string } & Record<string, unknown> }
  | { line: number; kind: 'set'; axis: string; object: string; value: number }
  | { line: number; kind: 'wait'; seconds: number };

export interface LineProblem {
  line: number; // from 1
  problem: string;
}

interface Command {
  numbers: string[]; // keys with a number
  needs?: string[]; // one of these keys is required
}

// As the API's jobs, in revolutions. Without jobs that continue until a halt (velocity, torque), since an axis stops at the end
// of its script.
export const commands: Record<string, Command> = {
  enable: { numbers: [] },
  disable: { numbers: [] },
  reset: { numbers: [] },
  stop: { numbers: [] },
  quickstop: { numbers: [] },
  home: { numbers: ['method', 'speed', 'zero_speed', 'acceleration', 'offset'] },
  move: { numbers: ['to', 'by', 'velocity', 'acceleration', 'deceleration'], needs: ['to', 'by'] },
};
const jobOf: Record<string, string> = { reset: 'reset_fault', quickstop: 'quick_stop' };

export const mostSteps = 2000;
const longestWait_s = 3600;
const objectShape = /^([0-9a-f]{4})(?::([0-9a-f]{1,2}))?$/i;

class Mistake extends Error {}

function numberOf(text: string | undefined, what: string): number {
  const value = text === undefined || text === '' ? NaN : Number(text);
  if (!Number.isFinite(value)) throw new Mistake(text === undefined ? `a number is missing after "${what}"` : `"${text}" after "${what}" is no number`);
  return value;
}

function jobStep(line: number, axis: string, command: string, words: string[]): Step {
  if (!Object.hasOwn(commands, command)) throw new Mistake(`"${command}" is no command: use ${[...Object.keys(commands), 'set'].join(', ')}`);
  const { numbers, needs } = commands[command];
  const request: { do: string } & Record<string, unknown> = { do: jobOf[command] ?? command, units: 'revolutions' };
  for (let i = 0; i < words.length; i += 2) {
    const key = words[i];
    if (!numbers.includes(key)) throw new Mistake(numbers.length === 0 ? `${command} has no "${key}"` : `${command} has no "${key}": use ${numbers.join(', ')}`);
    if (key in request) throw new Mistake(`"${key}" is there twice`);
    request[key] = numberOf(words[i + 1], key);
  }
  if (needs && needs.filter((key) => key in request).length !== 1) throw new Mistake(`${command} needs either ${needs.join(' or ')}`);
  return { line, kind: 'job', axis, request };
}

function stepOf(line: number, words: string[]): Step {
  const [first, second, ...rest] = words;
  if (first === 'wait') {
    const seconds = numberOf(second, 'wait');
    if (seconds < 0 || seconds > longestWait_s) throw new Mistake(`wait takes 0 to ${longestWait_s} seconds`);
    if (rest.length > 0) throw new Mistake(`"${rest[0]}" after the seconds has no meaning`);
    return { line, kind: 'wait', seconds };
  }
  if (second === undefined) throw new Mistake(`a command is missing after "${first}"`);
  if (second !== 'set') return jobStep(line, first, second, rest);
  const found = objectShape.exec(rest[0] ?? '');
  if (!found) throw new Mistake('set needs an object and a value: set 6083:00 5000');
  // The server counts a written controlword as another command, and would refuse the next job of the script (`after`).
  if (parseInt(found[1], 16) === 0x6040) throw new Mistake('a script cannot set the controlword 6040h: use enable, disable, reset, stop, quickstop');
  // Such a write moves an axis that another client has halted, since the server does not count it as a command.
  if (isMotionObject(parseInt(found[1], 16))) throw new Mistake(`a script cannot set ${found[1].toUpperCase()}h, a target or the mode of operation: use move, home`);
  if (rest.length > 2) throw new Mistake(`"${rest[2]}" after the value has no meaning`);
  return { line, kind: 'set', axis: first, object: `${found[1].toUpperCase()}:${(found[2] ?? '0').toUpperCase().padStart(2, '0')}`, value: numberOf(rest[1], rest[0]) };
}

// The steps of a script in their order, with `repeat` carried out.
export function parseSequence(text: string): { steps: Step[]; problems: LineProblem[] } {
  const problems: LineProblem[] = [];
  const open: { line: number; times: number; steps: Step[] }[] = [{ line: 0, times: 1, steps: [] }];
  text.split('\n').forEach((source, i) => {
    const line = i + 1;
    const words = source.replace(/#.*/, '').trim().split(/\s+/).filter(Boolean);
    if (words.length === 0) return;
    try {
      if (words[0] === 'repeat') {
        const times = numberOf(words[1], 'repeat');
        if (!Number.isInteger(times) || times < 1) throw new Mistake('repeat takes a whole number from 1 on');
        open.push({ line, times, steps: [] });
      } else if (words[0] === 'end') {
        if (open.length === 1) throw new Mistake('"end" without "repeat"');
        const { times, steps } = open.pop()!;
        const outer = open[open.length - 1].steps;
        if (outer.length + times * steps.length > mostSteps) throw new Mistake(`the script has more than ${mostSteps} steps`);
        for (let n = 0; n < times; ++n) outer.push(...steps);
      } else {
        open[open.length - 1].steps.push(stepOf(line, words));
      }
    } catch (error) {
      if (!(error instanceof Mistake)) throw error;
      problems.push({ line, problem: error.message });
    }
  });
  for (const { line } of open.slice(1)) problems.push({ line, problem: '"end" is missing for this "repeat"' });
  const { steps } = open[0];
  if (problems.length === 0 && steps.length === 0) problems.push({ line: 1, problem: 'the script has no step' });
  return { steps, problems };
}

export const axesOf = (steps: Step[]) => [...new Set(steps.flatMap((step) => (step.kind === 'wait' ? [] : [step.axis])))];

export interface JobState {
  id: number;
  state: string;
  error?: { what: string };
}

export interface SequenceDoes {
  start(axis: string, request: { do: string } & Record<string, unknown>): Promise<JobState>;
  finish(job: JobState): Promise<JobState>;
  cancel(job: JobState): Promise<unknown>;
  write(axis: string, object: string, value: number): Promise<unknown>;
  latest(axis: string): number | undefined; // the latest job of the axis, of any client
  sleep(ms: number, signal: AbortSignal): Promise<void>;
  at(step: Step, number: number): void;
  hindrance?(axis: string, request: { do: string } & Record<string, unknown>): Promise<string>; // why a job cannot be done; empty: it can
}

export class Ended extends Error {}

// Runs a script once. It begins with a halt of each of its axes, all at the same time. The server then knows the last command of
// each axis, and refuses the next job of the script if another client has sent a halt or STOP meanwhile. A write has no such
// check by the server, so the script ends before it if the axis has another job. Each job ends at rest, and so does the script.
export class Sequence {
  private readonly abort = new AbortController();
  private running: JobState | null = null;
  private readonly last = new Map<string, number>(); // last job of each axis

  constructor(
    private readonly steps: Step[],
    private readonly does: SequenceDoes,
  ) {}

  // Ends when all steps are done. Throws if a step fails or stop() ends it.
  async run(): Promise<void> {
    const moved = axesOf(this.steps.filter(({ kind }) => kind === 'job'));
    await Promise.all(moved.map((axis) => this.halt(axis)));
    for (const [number, step] of this.steps.entries()) {
      this.live();
      this.does.at(step, number);
      await this.step(step);
    }
    this.live();
  }

  stop() {
    this.abort.abort();
    if (this.running) void this.does.cancel(this.running).catch(() => undefined); // the job may be over
  }

  private live() {
    if (this.abort.signal.aborted) throw new Ended('stopped');
  }

  private async step(step: Step) {
    if (step.kind === 'wait') await this.does.sleep(1000 * step.seconds, this.abort.signal);
    else if (step.kind === 'set') await this.write(step);
    else await this.job(step.axis, step.request);
  }

  private async halt(axis: string) {
    const begun = await this.does.start(axis, { do: 'stop' });
    this.last.set(axis, begun.id);
    const job = await this.does.finish(begun);
    if (job.state !== 'done') throw new Ended(job.error?.what ?? `the job is ${job.state}`);
  }

  private async write({ axis, object, value }: Step & { kind: 'set' }) {
    const [last, latest] = [this.last.get(axis), this.does.latest(axis)];
    if (last !== undefined && latest !== undefined && latest > last) throw new Ended('another command to the axis came first');
    await this.does.write(axis, object, value);
  }

  private async job(axis: string, request: { do: string } & Record<string, unknown>) {
    const reason = await this.does.hindrance?.(axis, request);
    this.live();
    if (reason) throw new Ended(reason);
    const last = this.last.get(axis);
    this.running = await this.does.start(axis, last === undefined ? request : { ...request, after: last });
    const { id } = this.running;
    this.last.set(axis, id);
    if (this.abort.signal.aborted) await this.does.cancel(this.running).catch(() => undefined);
    const job = await this.does.finish(this.running);
    this.running = null;
    this.live();
    if (job.state !== 'done') throw new Ended(job.error?.what ?? `the job is ${job.state}`);
  }
}
