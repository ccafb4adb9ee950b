import type { ActionNote, KeyTypes, KeyType, MessageNote } from '../api/types';

// The text of a rule (docs/scenario.md) that a person has put together from the server's catalogue of actions.

export type Values = Record<string, string>; // of fields, as typed; an empty text: the key is left out

export interface Choice {
  axis: string;
  bus: string;
  action: ActionNote;
  message: MessageNote | null; // for actions on messages
  values: Values; // of the action
  message_values: Values;
  rule_values: Values;
  when_values: Values;
}

// How a rule ends: after one act, after a second, or when it is removed.
export type End = 'act' | 'second' | 'removed';

// A key may have several types; the first is that of its field.
export const typeOf = (type: KeyType): KeyType => type.anyOf?.find((each) => each.type === 'number' || each.type === 'integer') ?? type.anyOf?.[0] ?? type;

const number = /^[+-]?(\d+(\.\d+)?|0x[0-9A-Fa-f]+)$/;

// Why a text is no value of the key; an empty text is the key left out.
export function problemOf(type: KeyType, text: string): string | undefined {
  const { type: kind, minimum, maximum, anyOf } = type;
  const value = text.trim();
  if (value === '' || kind === 'string') return undefined;
  if (anyOf) return anyOf.some((each) => problemOf(each, text) === undefined) ? undefined : problemOf(typeOf(type), text);
  if (kind === 'boolean') return value === 'true' || value === 'false' ? undefined : 'true or false';
  if (!number.test(value)) return 'a number, such as 12 or 0x0C';
  if (kind === 'integer' && value.includes('.')) return 'a whole number';
  if (minimum !== undefined && Number(value) < minimum) return `at least ${minimum}`;
  if (maximum !== undefined && Number(value) > maximum) return `at most ${maximum}`;
  return undefined;
}

function shown(type: KeyType, text: string): string {
  const value = text.trim();
  return type.type === 'string' ? JSON.stringify(value) : value;
}

function assignments(types: KeyTypes, values: Values): string[] {
  return Object.entries(types)
    .filter(([key]) => (values[key] ?? '').trim() !== '')
    .map(([key, type]) => `${key} = ${shown(type, values[key])}`);
}

// The action names a bus if it concerns all of it, else the axis.
export const isOfBus = ({ action, message }: Pick<Choice, 'action' | 'message'>) => action.of_bus || (message?.of_bus ?? false);

export function ruleText(name: string, choice: Choice, end: End, types: { message: KeyTypes; rule: KeyTypes; when: KeyTypes }): string {
  const { axis, bus, action, message } = choice;
  const when = assignments(types.when, choice.when_values);
  const lines = ['[[rule]]', `name = ${JSON.stringify(name)}`, isOfBus(choice) ? `bus = ${JSON.stringify(bus)}` : `axis = ${JSON.stringify(axis)}`];
  if (when.length > 0) lines.push(`when = { ${[`axis = ${JSON.stringify(axis)}`, ...when].join(', ')} }`);
  if (message) lines.push(`on = { ${[`message = ${JSON.stringify(message.message)}`, ...assignments(types.message, choice.message_values)].join(', ')} }`);
  lines.push(`do = ${JSON.stringify(action.do)}`, ...assignments(action.keys, choice.values), ...assignments(types.rule, choice.rule_values));
  if (end === 'act') lines.push('times = 1');
  if (end === 'second') lines.push('for_ms = 1000');
  return `${lines.join('\n')}\n`;
}

// The name of the next rule with this action: "abort 1", "abort 2" ...
export function freeName(action: string, present: readonly string[]): string {
  for (let number = 1; ; ++number) {
    const name = `${action} ${number}`;
    if (!present.includes(name)) return name;
  }
}

// The messages on which an action can act.
export const messagesOf = (action: ActionNote, messages: readonly MessageNote[]) =>
  action.use === 'message' ? messages.filter(({ message }) => action.messages === '' || action.messages.split(' ').includes(message)) : [];
