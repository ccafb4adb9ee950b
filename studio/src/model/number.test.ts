import { describe, expect, it } from 'vitest';
import { readNumber, showNumber } from './number';

const value = (text: string, limits = {}) => {
  const typed = readNumber(text, limits);
  return 'value' in typed ? typed.value : typed.problem;
};

describe('numbers as they are typed', () => {
  it.each([
    ['5', 5], ['-5', -5], ['\u22125', -5], ['+5', 5], ['0.5', 0.5], ['0,5', 0.5], ['0,500', 0.5], ['-1,25', -1.25], [' 12 ', 12], ['.5', 0.5], ['1e3', 1000], ['1.5e-3', 0.0015],
    ['1,5', 1.5], ['1234,5', 1234.5], ['1.500', 1.5],
  ])('takes %s', (text, number) => expect(value(text)).toBe(number));

  it.each([['', 'Enter a number'], ['   ', 'Enter a number'], ['abc', 'Not a number'], ['-', 'Not a number'], ['1.2.3', 'Not a number'], ['1,2,3', 'Not a number'], ['1 000', 'Not a number'], ['5 rpm', 'Not a number'],
    ['0x10', 'Not a number'], ['Infinity', 'Not a number'], ['1e999', 'too large'], ['1,500', '1500 or 1.5'], ['-12,345', '-12345 or -12.345']])('refuses %s', (text, problem) =>
    expect(value(text)).toContain(problem));

  it('marks what is outside its limits instead of moving it', () => {
    expect(value('-5', { minimum: 0 })).toBe('At least 0.');
    expect(value('301', { maximum: 300 })).toBe('At most 300.');
    expect(value('301', { minimum: -300, maximum: 300 })).toBe('From -300 to 300.');
    expect(value('0', { above: 0 })).toBe('More than 0.');
    expect(value('0', { above: 0, maximum: 983039 })).toBe('More than 0, at most 983039.');
    expect(value('1e9', { above: 0, maximum: 983039 })).toBe('More than 0, at most 983039.');
    expect(value('1e-9', { above: 0 })).toBe(1e-9);
    expect(value('0', { minimum: 0 })).toBe(0);
    expect(value('300', { maximum: 300 })).toBe(300);
  });

  it('are hexadecimal where that is asked for', () => {
    expect(readNumber('181h', {}, true)).toEqual({ value: 0x181 });
    expect(readNumber('0x181', {}, true)).toEqual({ value: 0x181 });
    expect(readNumber('181', {}, true)).toEqual({ value: 0x181 });
    expect(readNumber('1.5', {}, true)).toHaveProperty('problem');
    expect(readNumber('800h', { maximum: 0x7ff }, true)).toEqual({ problem: 'At most 7FFh.' });
    expect(showNumber(0x181, true)).toBe('181h');
  });

  it('shows numbers so that they are read back', () => {
    for (const number of [0, 1, -1.25, 0.000001, 2147483647, 1e-9, 1e21]) expect(value(showNumber(number))).toBe(number);
    expect(showNumber(NaN)).toBe('');
  });
});
