import { describe, expect, test } from 'vitest';
import { lost, noPowerOn, noted, notedMode, standingOf, toUndo, undoing, without, type Journal, type Written } from './journal';

const write = (step: string, before: number, after: number, object = '6072:00'): Written => ({ step, object, name: 'Max torque', unit: '', before, after });
const all = (...writes: Written[]) => writes.reduce<Journal>(noted, []);

test('a step that writes twice keeps the first value, and nothing if it writes that back', () => {
  expect(all(write('a', 1, 2), write('a', 2, 3))).toEqual([write('a', 1, 3)]);
  expect(all(write('a', 1, 2), write('a', 2, 1))).toEqual([]);
});

describe('the mode of operation after a motion', () => {
  const mode = (before: number, after: number) => write('a', before, after, '6060:00');
  const after = (journal: Journal, before: number, now: number) => notedMode(journal, mode(before, now), [9]);
  test('belongs to the guide, if its job has set it', () => {
    expect(after([], 3, 9)).toEqual([mode(3, 9)]);
    expect(after([mode(1, 3)], 3, 9)).toEqual([mode(1, 9)]);
    expect(after([mode(1, 9)], 1, 1)).toEqual([]); // the job has restored it, or a halt came before it
    expect(after([], 3, 3)).toEqual([]);
  });
  test('does not belong to the guide, if another has set it', () => {
    expect(after([], 3, 8)).toEqual([]);
    expect(after([mode(1, 9)], 1, 8)).toEqual([mode(1, 9)]);
  });
  test('is entered for the step of the motion', () => expect(notedMode([mode(1, 3)], write('b', 3, 9, '6060:00'), [9])).toEqual([mode(1, 3), write('b', 3, 9, '6060:00')]));
});

test('the last step of an object is undone by the value before it', () => {
  const journal = all(write('a', 1, 2), write('b', 2, 3));
  expect(without(journal, journal[1])).toEqual({ journal: [write('a', 1, 2)], write: 2 });
});

test('an earlier step of an object leaves the value of the later one, which then leads back to the factory', () => {
  const journal = all(write('a', 1, 2), write('b', 2, 3));
  const { journal: rest, write: value } = without(journal, journal[0]);
  expect(value).toBeNull();
  expect(rest).toEqual([write('b', 1, 3)]);
});

test('to undo all, one by one, ends at the first values', () => {
  let journal = all(write('a', 1, 2), write('a', 5, 6, '6081:00'), write('b', 2, 3), write('a', 3, 4));
  const drive: Record<string, number> = { '6072:00': 4, '6081:00': 6 };
  for (const entry of toUndo(journal, null)) {
    const undone = without(journal, journal.find((each) => each.step === entry.step && each.object === entry.object && each.after === entry.after)!);
    ({ journal } = undone);
    if (undone.write !== null) drive[entry.object] = undone.write;
  }
  expect(journal).toEqual([]);
  expect(drive).toEqual({ '6072:00': 1, '6081:00': 5 });
});

test('the standing of a write is read from the drive', () => {
  const journal = all(write('a', 1, 2), write('b', 2, 3));
  expect(standingOf(journal, journal[0], 3)).toBe('replaced');
  expect(standingOf(journal, journal[1], 3)).toBe('in the drive');
  expect(standingOf(journal, journal[1], 2)).toBe(lost);
  expect(standingOf(journal, journal[1], 9)).toBe('changed by another');
  expect(standingOf(journal, journal[1], null)).toBe('not known');
});

describe('after a power cut', () => {
  const journal = all(write('a', 10, 20), write('b', 20, 30)); // written in two steps
  const powerOn = { stored: { '6072:00': 25 }, factory: { '6072:00': 5 } };
  test('the value before the first write, the stored and the factory value are known', () => {
    for (const now of [10, 25, 5, 20]) expect(standingOf(journal, journal[1], now, powerOn), String(now)).toBe(lost);
    for (const now of [25, 5, 11]) expect(standingOf(journal, journal[1], now, noPowerOn), String(now)).toBe('changed by another');
  });
  test('a value from before the guide counts as undone', () => {
    for (const now of [10, 5]) expect(undoing(journal, journal[1], now, powerOn), String(now)).toBe('nothing');
    expect(undoing(journal, journal[1], 20, powerOn)).toBe('nothing'); // the value to write back
    for (const now of [30, 25]) expect(undoing(journal, journal[1], now, powerOn), String(now)).toBe('write');
    expect(undoing(journal, journal[1], 11, powerOn)).toBeNull();
    expect(undoing(journal, journal[1], undefined, { stored: {}, factory: {} })).toBeNull();
  });
  test('the present value of the last step is written back also if it is that of the factory', () => {
    const back = all(write('a', 10, 20), write('b', 20, 10));
    expect(undoing(back, back[1], 10, { stored: {}, factory: { '6072:00': 10 } })).toBe('write');
  });
});
