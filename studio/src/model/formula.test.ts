import { describe, expect, test } from 'vitest';
import { formulaOf, mathsOf, nameProblem, textOfMaths, type Wave } from './formula';

const wave = (unit: string, ...values: number[]): Wave => ({ unit, values: Float64Array.from(values) });
const waves = [wave('rpm', 1, 2, 4, 8), wave('Nm', 10, 0, -10, 5), wave('rpm', 1, 1, 1, 1)];

function result(text: string, interval_s = 0.5) {
  const formula = formulaOf(text, waves.length);
  if (typeof formula !== 'function') throw new Error(`${formula.problem} at ${formula.at}`);
  const { values, unit } = formula({ waves, interval_s });
  return { values: [...values], unit };
}

describe('a formula', () => {
  test.each([
    ['c1 + c3', [2, 3, 5, 9], 'rpm'],
    ['c1 - 2 * c3', [-1, 0, 2, 6], 'rpm'],
    ['(c1 - 2) * c3', [-1, 0, 2, 6], 'rpm·rpm'],
    ['-c1 - -c3', [0, -1, -3, -7], 'rpm'],
    ['8 / 4 / 2 * c3', [1, 1, 1, 1], 'rpm'],
    ['c1 / c3', [1, 2, 4, 8], ''],
    ['c1 / c2', [0.1, NaN, -0.4, 1.6], 'rpm/Nm'],
    ['c1 + c2', [11, 2, -6, 13], ''],
    ['abs(c2)', [10, 0, 10, 5], 'Nm'],
    ['derivative(c1)', [2, 3, 6, 8], 'rpm/s'],
    ['integral(c1)', [0, 0.75, 2.25, 5.25], 'rpm·s'],
    ['integral(derivative(c3))', [0, 0, 0, 0], 'rpm'],
    ['difference(c1)', [0, 1, 2, 4], 'rpm'],
    ['difference(c1, c3)', [0, 1, 3, 7], 'rpm'],
    ['1.5e1', [15, 15, 15, 15], ''],
    [' C1\u2212c3 ', [0, 1, 3, 7], 'rpm'],
    ['derivative(c1 * c2)', result('derivative(c2 * c1)').values, '(rpm·Nm)/s'],
  ])('%s', (text, values, unit) => {
    expect(result(text)).toEqual({ values, unit });
  });

  test.each([
    ['', 'a channel or a number is missing at the end', 0],
    ['c1 +', 'a channel or a number is missing at the end', 4],
    ['c1 + * c2', 'a channel or a number is missing before "*"', 5],
    ['(c1', '")" is missing for this "("', 0],
    ['abs(c1', '")" is missing for this "("', 3],
    ['c1)', '")" without "("', 2],
    ['c1 c2', 'an operator is missing before "c2"', 3],
    ['c4', 'there is no channel c4: the recording has c1 to c3', 0],
    ['c0', 'there is no channel c0: the recording has c1 to c3', 0],
    ['abs c1', 'abs needs "(" and ")" around its channel', 0],
    ['abs(c1, c2)', 'abs takes 1, not 2 channels', 0],
    ['2 * alert(1)', '"alert" is no channel and no function: use c1 to c3, abs, derivative, integral, difference', 4],
    ['constructor(c1)', '"constructor" is no channel and no function: use c1 to c3, abs, derivative, integral, difference', 0],
    ['1,5*c1', 'the decimal separator is a point: 1.5', 0],
    ['c1 * 1,5', 'the decimal separator is a point: 1.5', 5],
    ['(0,25 * c1)', 'the decimal separator is a point: 0.25', 1],
    ['c1, c2', 'an operator is missing before ","', 2],
    ['c1/0', 'a division by 0 has no value', 2],
    ['1 + c1 / (2 - 2)', 'a division by 0 has no value', 7],
    ['c1 ; c2', '";" has no meaning here', 3],
    ['c1 ^ 2', '"^" has no meaning here', 3],
    ['(', 'a channel or a number is missing at the end', 1],
    ['('.repeat(5000), 'more than 100 nested parentheses', 100],
  ])('refuses %s', (text, problem, at) => {
    expect(formulaOf(text, waves.length)).toEqual({ problem, at });
  });

  test('leaves a gap a gap, and goes on after it', () => {
    const gap = [wave('m', 0, 1, NaN, 3, 4)];
    const of = (text: string) => (formulaOf(text, 1) as (sampled: unknown) => Wave)({ waves: gap, interval_s: 1 }).values;
    expect([...of('derivative(c1)')]).toEqual([1, 1, NaN, 1, 1]);
    expect([...of('integral(c1)')]).toEqual([0, 0.5, NaN, 0.5, 4]);
    expect([...of('c1 + 1')]).toEqual([1, 2, NaN, 4, 5]);
  });
});

test('math channels survive the address', () => {
  const maths = [{ name: 'slip', formula: 'c1 - c2' }, { name: 'power of x', formula: 'c1 * c2' }];
  expect(mathsOf(textOfMaths(maths))).toEqual(maths);
  expect(mathsOf(null)).toEqual([]);
  expect(mathsOf('broken;=c1')).toEqual([]);
});

test('a name of a math channel', () => {
  expect(nameProblem(' ', [])).toBe('Enter a name.');
  expect(nameProblem('a=b', [])).toMatch(/not contain "="/);
  expect(nameProblem('slip ', ['slip'])).toBe('This name is taken.');
  expect(nameProblem('slip', ['x'])).toBeUndefined();
});
