import { expect, test } from 'vitest';
import { authorsOf, type Change, foretold, matches, most_kept, said, withAnswer } from './changes';

const change = (number: number, more: Partial<Change> = {}): Change => ({
  number, time_ns: 0, wall: '', axis: 'x', object: '6083:00', name: 'Profile acceleration', type: 'UNSIGNED32', unit: '', before: 1, after: 2, who: 'API (page)', ...more,
});
const answer = (changes: Change[]) => ({ changes, next: changes.at(-1)?.number ?? 0, left_out: 0, dropped: 0, most: 10000 });

test('answers are put together without repetitions, and the oldest rows go', () => {
  const some = withAnswer([], answer([change(1), change(2)]));
  expect(withAnswer(some, answer([change(2), change(3)])).map(({ number }) => number)).toEqual([1, 2, 3]);
  expect(withAnswer(some, answer([]))).toBe(some);
  const many = withAnswer([], answer(Array.from({ length: most_kept + 5 }, (_, i) => change(i + 1))));
  expect(many).toHaveLength(most_kept);
  expect(many[0].number).toBe(6);
});

test('a filter looks at object, name and author', () => {
  expect(matches(change(1), 'acceleration', '')).toBe(true);
  expect(matches(change(1), '6083', '')).toBe(true);
  expect(matches(change(1), 'can0', '')).toBe(false);
  expect(matches(change(1, { who: 'SDO on can0' }), ' CAN0 ', '')).toBe(true);
  expect(matches(change(1), '', 'job 1 (move)')).toBe(false);
  expect(authorsOf([change(1), change(2, { who: 'a' }), change(3)])).toEqual(['API (page)', 'a']);
});

const one = { number: 1, axis: 'x', object: '6083:00', name: '', from: 1, to: 2 };
const kept = { number: 2, axis: 'x', object: '6060:00', name: '', what: '', hint: '' };

test('an undo is one sentence', () => {
  expect(said({ undone: [], kept: [], until: 2 })).toBe('Nothing to undo.');
  expect(said({ undone: [one], kept: [], until: 2 })).toBe('1 object has the former value.');
  expect(said({ undone: [one, one], kept: [kept], until: 2 })).toBe('2 objects have the former value; 1 stays.');
});

test('an undo is foretold in one sentence, with the number of drives', () => {
  expect(foretold({ undone: [one], kept: [], until: 2 })).toBe('The undo writes 1 value in 1 drive.');
  expect(foretold({ undone: [one, one, { ...one, axis: 'y' }], kept: [kept], until: 2 })).toBe('The undo writes 3 values in 2 drives; 1 object stays.');
  expect(foretold({ undone: [one], kept: [kept, kept], until: 2 })).toContain('2 objects stay.');
});
