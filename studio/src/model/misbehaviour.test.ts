import { describe, expect, it } from 'vitest';
import type { ActionNote, MessageNote } from '../api/types';
import { freeName, messagesOf, problemOf, ruleText, type Choice } from './misbehaviour';

const types = { message: { object: { type: 'string' } }, rule: { skip: { type: 'integer' } }, when: { state: { type: 'string' } } } as const;
const answer: MessageNote = { message: 'sdo_answer', text: 'SDO answer', clause: '', of_bus: false };
const frame: MessageNote = { message: 'frame', text: 'frame', clause: '', of_bus: true };
const abort: ActionNote = {
  do: 'abort', text: '', use: 'message', of_bus: false, clause: '', messages: 'sdo_answer', keys: { code: { type: 'integer', minimum: 0, maximum: 9 } }, example: {},
};
const choice: Choice = { axis: 'x"1', bus: 'can0', action: abort, message: answer, values: { code: '0x5' }, message_values: {}, rule_values: {}, when_values: {} };

describe('the text of a rule', () => {
  it('has the fields that are filled in', () => {
    expect(ruleText('abort 1', { ...choice, message_values: { object: ' 6041 ' }, rule_values: { skip: '2' }, when_values: { state: 'fault' } }, 'act', types)).toBe(
      '[[rule]]\nname = "abort 1"\naxis = "x\\"1"\nwhen = { axis = "x\\"1", state = "fault" }\non = { message = "sdo_answer", object = "6041" }\n' +
      'do = "abort"\ncode = 0x5\nskip = 2\ntimes = 1\n',
    );
  });
  it('names the bus if the message or the action is of all of it', () => {
    expect(ruleText('a', { ...choice, message: frame }, 'removed', types)).toContain('\nbus = "can0"\n');
    expect(ruleText('a', { ...choice, action: { ...abort, of_bus: true } }, 'second', types)).toMatch(/bus = "can0"[^]*for_ms = 1000/);
  });
});

it('a field says why its text is no value', () => {
  const integer = { type: 'integer', minimum: 0, maximum: 9 } as const;
  expect(['', '7', '0x9', ' 3 '].map((text) => problemOf(integer, text))).toEqual([undefined, undefined, undefined, undefined]);
  expect(['-1', '10', '1.5', 'a', '0xG'].map((text) => problemOf(integer, text) === undefined)).toEqual([false, false, false, false, false]);
  expect(problemOf({ anyOf: [{ type: 'boolean' }, { type: 'number' }] }, 'true')).toBeUndefined();
  expect(problemOf({ anyOf: [{ type: 'boolean' }, { type: 'number' }] }, '1.5')).toBeUndefined();
  expect(problemOf({ anyOf: [{ type: 'boolean' }, { type: 'number' }] }, 'yes')).toBeDefined();
});

it('rules have numbers that are free', () => {
  expect(freeName('abort', ['abort 1', 'abort 3'])).toBe('abort 2');
});

it('an action offers the messages on which it can act', () => {
  expect(messagesOf(abort, [answer, frame])).toEqual([answer]);
  expect(messagesOf({ ...abort, messages: '' }, [answer, frame])).toEqual([answer, frame]);
  expect(messagesOf({ ...abort, use: 'lasts' }, [answer])).toEqual([]);
});
