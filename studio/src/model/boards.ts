import { formats } from './bases';
import { parseSequence } from './sequence';
import { channelOf, objectOf } from './scope';

// Dashboards: a table of the kinds of widgets, and the check of a file. The editor, the check and the pages read the table.

export type FieldKind = 'text' | 'lines' | 'number' | 'choice' | 'axis' | 'channel' | 'channels' | 'object';

export interface Field {
  key: string;
  label: string;
  kind: FieldKind;
  initial?: unknown; // missing: the user must enter it
  options?: readonly (readonly [string, string])[];
  minimum?: number;
  maximum?: number;
  unit?: string;
  optional?: true; // may be missing
}

export type WidgetKind = 'value' | 'plot' | 'switch' | 'slider' | 'button' | 'script' | 'watch' | 'note';
export type Widget = { kind: WidgetKind; title: string; span: number } & Record<string, unknown>;

export interface Board {
  name: string;
  widgets: Widget[];
}

export const jobs = [
  ['enable', 'enable'], ['disable', 'disable'], ['stop', 'halt'], ['quick_stop', 'quick stop'], ['reset_fault', 'clear fault'], ['home', 'home'],
  ['move', 'move'], ['jog', 'jog while pressed'],
] as const;

const revolutions = { kind: 'number', optional: true } as const;
export const widgets: Record<WidgetKind, { title: string; does: string; span: number; fields: Field[] }> = {
  value: {
    title: 'Value', does: 'a signal or an object as a number', span: 1,
    fields: [
      { key: 'channel', label: 'Signal or object', kind: 'channel' },
      { key: 'format', label: 'Format', kind: 'choice', options: formats, initial: 'decimal' },
    ],
  },
  plot: {
    title: 'Plot', does: 'the last seconds of some channels', span: 2,
    fields: [
      { key: 'channels', label: 'Channels', kind: 'channels', maximum: 16 },
      { key: 'seconds', label: 'Length', kind: 'number', unit: 's', minimum: 1, maximum: 60, initial: 10 },
    ],
  },
  switch: {
    title: 'Switch', does: 'writes one of two values to an object', span: 1,
    fields: [
      { key: 'object', label: 'Object', kind: 'object' },
      { key: 'on', label: 'Value when on', kind: 'number', initial: 1 },
      { key: 'off', label: 'Value when off', kind: 'number', initial: 0 },
    ],
  },
  slider: {
    title: 'Slider', does: 'writes an object while it moves, for example a gain', span: 1,
    fields: [
      { key: 'object', label: 'Object', kind: 'object' },
      { key: 'minimum', label: 'Minimum', kind: 'number', initial: 0 },
      { key: 'maximum', label: 'Maximum', kind: 'number', initial: 1000 },
      { key: 'step', label: 'Step', kind: 'number', initial: 1, minimum: 1e-9 },
    ],
  },
  button: {
    title: 'Button', does: 'starts a job of an axis', span: 1,
    fields: [
      { key: 'axis', label: 'Axis', kind: 'axis' },
      { key: 'do', label: 'Job', kind: 'choice', options: jobs, initial: 'enable' },
      { key: 'by', label: 'Distance of a move', unit: 'rev', ...revolutions },
      { key: 'to', label: 'or its end', unit: 'rev', ...revolutions },
      { key: 'velocity', label: 'Velocity', unit: 'rev/s', ...revolutions },
      { key: 'acceleration', label: 'Acceleration', unit: 'rev/s²', minimum: 0, ...revolutions },
      { key: 'method', label: 'Method of homing', kind: 'number', optional: true, minimum: -128, maximum: 127 },
    ],
  },
  script: { title: 'Script', does: 'jobs and writes in sequence', span: 2, fields: [{ key: 'lines', label: 'Script', kind: 'lines' }] },
  watch: { title: 'Watch list', does: 'objects in decimal, hexadecimal and binary digits', span: 2, fields: [{ key: 'channels', label: 'Signals and objects', kind: 'channels', maximum: 64 }] },
  note: { title: 'Note', does: 'a text', span: 1, fields: [{ key: 'text', label: 'Text', kind: 'lines' }] },
};
export const kinds = Object.keys(widgets) as WidgetKind[];

// The server gives each page 8 subscriptions; the live values share 4 of them.
export const mostPlots = 4;
export const mostWidgets = 60;
export const mostBoards = 50;
const longestName = 60;
const longestText = 8000;

const common: Field[] = [
  { key: 'title', label: 'Title', kind: 'text', initial: '', optional: true },
  { key: 'span', label: 'Width', kind: 'number', unit: 'columns', minimum: 1, maximum: 4 },
];
export const fieldsOf = (kind: WidgetKind): Field[] => [...common, ...widgets[kind].fields];

export function newWidget(kind: WidgetKind): Widget {
  const initial = widgets[kind].fields.flatMap((field) => (field.initial === undefined ? [] : [[field.key, field.initial] as const]));
  return { kind, title: '', span: widgets[kind].span, ...Object.fromEntries(initial) };
}

const isObject = (text: string) => objectOf(channelOf(text)?.object ?? '') !== null;

function numberProblem({ minimum, maximum }: Field, value: unknown): string | undefined {
  if (typeof value !== 'number' || !Number.isFinite(value)) return 'must be a number';
  if (minimum !== undefined && value < minimum) return `must be at least ${minimum}`;
  if (maximum !== undefined && value > maximum) return `must be at most ${maximum}`;
  return undefined;
}

function textProblem(value: unknown, longest: number): string | undefined {
  if (typeof value !== 'string') return 'must be a text';
  return value.length > longest ? `must have at most ${longest} characters` : undefined;
}

const isText = (value: unknown): value is string => typeof value === 'string';
const checks: Record<FieldKind, (field: Field, value: unknown) => string | undefined> = {
  text: (_, value) => textProblem(value, longestName),
  lines: (_, value) => textProblem(value, longestText) ?? (String(value).trim() === '' ? 'must not be empty' : undefined),
  number: numberProblem,
  choice: ({ options = [] }, value) => (options.some(([id]) => id === value) ? undefined : `must be one of ${options.map(([id]) => id).join(', ')}`),
  axis: (_, value) => textProblem(value, longestName) ?? (value === '' ? 'must name an axis' : undefined),
  channel: (_, value) => (isText(value) && channelOf(value) ? undefined : 'must be AXIS/SIGNAL or AXIS/6064:00'),
  channels: ({ maximum = 16 }, value) => {
    if (!Array.isArray(value) || value.length === 0) return 'must be a list of at least one channel';
    if (value.length > maximum) return `must have at most ${maximum} channels`;
    const wrong = value.findIndex((each: unknown) => !isText(each) || !channelOf(each));
    return wrong < 0 ? undefined : `channel ${wrong + 1} must be AXIS/SIGNAL or AXIS/6064:00`;
  },
  object: (_, value) => (isText(value) && isObject(value) ? undefined : 'must be an object of an axis: AXIS/6064:00'),
};

// The errors of a widget, by the key of the field.
export function problemsOf(widget: Widget): Record<string, string> {
  const found: Record<string, string> = {};
  for (const field of fieldsOf(widget.kind)) {
    const value = widget[field.key];
    if (value === undefined && field.optional) continue;
    const problem = value === undefined ? 'is missing' : checks[field.kind](field, value);
    if (problem) found[field.key] = problem;
  }
  for (const { applies, key, problem } of rules) if (!found[key] && applies(widget)) found[key] = problem(widget);
  return found;
}

// Errors in the combination of two fields.
const rules: { key: string; applies: (widget: Widget) => boolean; problem: (widget: Widget) => string }[] = [
  { key: 'maximum', applies: ({ kind, minimum, maximum }) => kind === 'slider' && Number(maximum) <= Number(minimum), problem: () => 'must be above the minimum' },
  { key: 'off', applies: ({ kind, on, off }) => kind === 'switch' && on === off, problem: () => 'must differ from the value when on' },
  { key: 'by', applies: ({ kind, do: job, by, to }) => kind === 'button' && job === 'move' && (by === undefined) === (to === undefined), problem: () => 'a move needs either a distance or an end' },
  { key: 'velocity', applies: ({ kind, do: job, velocity }) => kind === 'button' && job === 'jog' && !velocity, problem: () => 'a jog needs a velocity; its sign is the direction' },
  {
    key: 'lines',
    applies: ({ kind, lines }) => kind === 'script' && isText(lines) && parseSequence(lines).problems.length > 0,
    problem: ({ lines }) => parseSequence(String(lines)).problems.map(({ line, problem }) => `line ${line}: ${problem}`).join('; '),
  },
];

export const format = 'servodrome-dashboards';
export const version = 1;

export const fileOf = (boards: Board[]) => JSON.stringify({ format, version, boards }, null, 2);

// Reads a file of dashboards. If the file has mistakes, throws an Error that names each with its place, and uses nothing of the
// file.
export function readFile(text: string): Board[] {
  let json: unknown;
  try {
    json = JSON.parse(text);
  } catch (error) {
    throw new Error(`the file is no JSON: ${error instanceof Error ? error.message : String(error)}`);
  }
  if (!isRecord(json) || json.format !== format) throw new Error(`the file has no dashboards: its "format" is not "${format}"`);
  if (json.version !== version) throw new Error(`the file has version ${String(json.version)}; this page reads version ${version}`);
  return readBoards(json.boards);
}

const isRecord = (json: unknown): json is Record<string, unknown> => typeof json === 'object' && json !== null && !Array.isArray(json);

// "dashboard 2 "bench", widget 1: kind must be one of ..". `key` is empty for a problem of the whole.
function mistake(place: string, key: string, problem: string): string {
  const continues = /^(must|is) /.test(problem); // the sentence that begins with the key
  return `${place}: ${key}${key === '' ? '' : continues ? ' ' : ': '}${problem}`;
}

export function readBoards(json: unknown): Board[] {
  if (!Array.isArray(json)) throw new Error('the dashboards must be a list');
  const problems: string[] = json.length > mostBoards ? [`there must be at most ${mostBoards} dashboards`] : [];
  const names = new Set<string>();
  json.forEach((board: unknown, i) => {
    const number = `dashboard ${i + 1}`;
    if (!isRecord(board)) return void problems.push(mistake(number, '', 'must be an object'));
    const place = isText(board.name) && board.name.trim() !== '' ? `${number} "${board.name.slice(0, longestName)}"` : number;
    const wrong = nameProblem(board.name, [...names]);
    if (wrong) problems.push(mistake(place, 'name', wrong));
    names.add(String(board.name));
    problems.push(...unknownKeys(board, ['name', 'widgets']).map((key) => mistake(place, key, 'is not known')));
    problems.push(...widgetProblems(board.widgets, place));
  });
  if (problems.length > 0) throw new Error(problems.slice(0, 8).join('\n') + (problems.length > 8 ? `\nand ${problems.length - 8} more` : ''));
  return json as Board[];
}

const unknownKeys = (json: Record<string, unknown>, known: string[]) => Object.keys(json).filter((key) => !known.includes(key));

function widgetProblems(json: unknown, place: string): string[] {
  if (!Array.isArray(json)) return [mistake(place, 'widgets', 'must be a list')];
  if (json.length > mostWidgets) return [mistake(place, '', `must have at most ${mostWidgets} widgets`)];
  const plots = json.filter((each: unknown) => isRecord(each) && each.kind === 'plot').length;
  const crowded = plots > mostPlots ? [mistake(place, '', `must have at most ${mostPlots} plots`)] : [];
  return json.reduce<string[]>((problems, widget: unknown, i) => {
    const here = `${place}, widget ${i + 1}`;
    if (!isRecord(widget)) return [...problems, mistake(here, '', 'must be an object')];
    if (!kinds.includes(widget.kind as WidgetKind)) return [...problems, mistake(here, 'kind', `must be one of ${kinds.join(', ')}`)];
    const found = Object.entries(problemsOf(widget as Widget)).map(([key, problem]) => mistake(here, key, problem));
    const known = ['kind', ...fieldsOf(widget.kind as WidgetKind).map(({ key }) => key)];
    return [...problems, ...found, ...unknownKeys(widget, known).map((key) => mistake(here, key, 'is not known'))];
  }, crowded);
}

export function nameProblem(name: unknown, taken: string[]): string | undefined {
  if (typeof name !== 'string' || name.trim() === '') return 'must be a name';
  if (name.length > longestName) return `must have at most ${longestName} characters`;
  return taken.includes(name) ? 'is there already' : undefined;
}

// Adds dashboards without replacing any: appends a number to a name that exists.
export function added(boards: Board[], more: Board[]): Board[] {
  return more.reduce((all, board) => {
    let name = board.name;
    for (let n = 2; all.some((each) => each.name === name); ++n) name = `${board.name.slice(0, longestName - 6)} (${n})`;
    return [...all, { ...board, name }];
  }, boards);
}

// Moves the element `from` to `to`.
export function movedTo<T>(list: T[], from: number, to: number): T[] {
  const rest = list.filter((_, i) => i !== from);
  rest.splice(to, 0, list[from]);
  return rest;
}
