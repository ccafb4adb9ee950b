import { describe, expect, it } from 'vitest';
import { emptyTable, isGap, mostShown, queryOf, type TrafficAnswer, type TrafficRow, withAnswer } from './traffic';

const row = (number: number): TrafficRow => ({ number, time_ns: number, from: 'master', kind: 'sdo', node: 1, about: 'node 1', bytes: '', text: 't', error: false, values: [] });
const answer = (numbers: number[], more: Partial<TrafficAnswer> = {}): TrafficAnswer => ({
  rows: numbers.map(row), next: numbers.at(-1) ?? 0, left_out: 0, lost: 0, missed: 0, frames: 0, recording: true, ...more,
});

describe('table of traffic', () => {
  it('shows rows in their order, and says what is missing where it is missing', () => {
    let table = withAnswer(emptyTable(), answer([1, 2]));
    table = withAnswer(table, answer([40, 41], { left_out: 12, lost: 3, missed: 4 }));
    expect(table.rows.map((one) => (isGap(one) ? one.gap.split(':')[0] : one.number))).toEqual([1, 2, '7 frames lost', '12 rows skipped', 40, 41]);
    expect(table.next).toBe(41);
    expect(table.absent).toBe(19);
  });

  it('does not count what was missed before it was opened', () => {
    const table = withAnswer(emptyTable(), answer([5], { missed: 1000 }));
    expect(table.rows.some(isGap)).toBe(false);
    expect(withAnswer(table, answer([6], { missed: 1001 })).rows.filter(isGap)).toHaveLength(1);
  });

  it('keeps a bounded number of rows, with keys that stay', () => {
    let table = emptyTable();
    for (let i = 0; i < 30; i++) table = withAnswer(table, answer(Array.from({ length: 500 }, (_, n) => i * 500 + n + 1)));
    expect(table.rows).toHaveLength(mostShown);
    expect(table.trimmed).toBe(15_000 - mostShown);
    expect(new Set(table.rows.map(({ key }) => key)).size).toBe(mostShown);
    expect(table.rows[0]?.key).toBe(table.trimmed + 1);
  });

  it('is the same table when nothing has come', () => {
    const table = withAnswer(emptyTable(), answer([1]));
    expect(withAnswer(table, answer([], { next: 1 }))).toBe(table);
  });

  it('asks for what is wanted', () => {
    expect(queryOf({ text: 'a b', kind: 'sdo', node: '5', errors: true }, 7, 100)).toBe('since=7&limit=100&newest=true&text=a+b&kind=sdo&node=5&errors=true');
    expect(queryOf({ text: '', kind: '', node: 'x', errors: false }, 0, 1)).toBe('since=0&limit=1&newest=true');
  });
});
