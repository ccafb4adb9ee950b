import { describe, expect, it } from 'vitest';
import { edges, isFault, isStop, motionHindrance, states } from './cia402';

describe('a drive in fault', () => {
  it('is in one of two states', () => {
    expect(states.filter(isFault)).toEqual(['fault reaction active', 'fault']);
    expect(isFault(undefined)).toBe(false);
  });

  it('begins no motion, with the reason', () => {
    const reason = 'The drive has a fault: clear it first.';
    expect(states.map((state) => motionHindrance({ powered: true, state }))).toEqual(['', '', '', '', '', '', reason, reason]);
    expect(motionHindrance({ powered: true })).toBe('');
    expect(motionHindrance({ powered: false, state: 'fault' })).toBe('The drive has no power: switch it on first.');
    expect(motionHindrance({ powered: true, problem: { what: 'no' } })).toBe('The drive does not answer.');
    expect(motionHindrance(undefined)).toBe('There is no such axis.');
  });
});

describe('the commands that stop', () => {
  it('are those that end the motion of an enabled drive', () => {
    const commands = edges.filter(({ name }) => name !== '');
    expect(commands.filter(({ from, to }) => isStop(from, to)).map(({ number, name }) => `${number} ${name}`)).toEqual([
      '5 disable operation', '8 shutdown', '9 disable voltage', '11 quick stop', '12 disable voltage',
    ]);
    expect(isStop(undefined, 'switch on disabled')).toBe(false);
  });
});
