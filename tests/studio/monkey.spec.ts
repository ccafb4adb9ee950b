import { expect, test } from '@playwright/test';
import { appendFileSync } from 'node:fs';
import { draw, Player, type Sequence } from './monkey/player';

// A monkey at the studio (tests/studio/monkey --help): no shaft turns unless the last command of a person asks for it, and
// every STOP brings every axis to rest.

const seed = Number(process.env.MONKEY_SEED ?? 2026);
const count = Number(process.env.MONKEY_COUNT ?? 25);
const first = Number(process.env.MONKEY_FIRST ?? 0);
const minutes = Number(process.env.MONKEY_MINUTES ?? 2);
const log = process.env.MONKEY_LOG;

const say = (text: string) => {
  if (log) appendFileSync(log, `${text}\n`);
};
const seedOf = (number: number) => (Math.imul(seed, 0x9e3779b1) + Math.imul(number + 1, 0x85ebca6b)) >>> 0;
const told = (number: number, sequence: Sequence, performed: string[], found: string[]) =>
  [
    `sequence ${number} of seed ${seed}: at ${sequence.start}, ${sequence.isEnabled ? 'axes enabled' : 'axes disabled'}, network ${sequence.before_ms} and ${sequence.after_ms} ms`,
    ...performed.map((step, i) => `  ${i + 1}. ${step}`),
    ...found.map((each) => `  FOUND ${each}`),
    `  again: tests/studio/monkey/run --seed ${seed} --first ${number} --count 1`,
  ].join('\n');

// The shortest beginning of a sequence that fails. It may fail no more: the times in the browser are not repeated.
async function shrunk(player: Player, sequence: Sequence, most: number): Promise<string> {
  for (let length = 1; length <= most; ++length) {
    const found = await player.play(sequence, length);
    if (found.length > 0) return `  with ${length} steps:\n${found.map((each) => `    ${each}`).join('\n')}`;
  }
  return '  repeated, it does not fail';
}

test.use({ trace: 'off' });

test('a monkey moves no axis unasked, and STOP rests all', async ({ browser }) => {
  test.setTimeout((minutes + 2) * 60_000);
  const until = performance.now() + 60_000 * minutes;
  const player = await Player.open(browser);
  await player.keepPlants();
  const failures: string[] = [];
  let done = 0;
  for (; done < count && performance.now() < until; ++done) {
    const sequence = draw(seedOf(first + done));
    const found = await player.play(sequence);
    if (process.env.MONKEY_STORY) say(told(first + done, sequence, player.performed, found));
    if (found.length > 0) {
      failures.push(told(first + done, sequence, player.performed, found));
      say(failures[failures.length - 1]);
      if (process.env.MONKEY_SHRINK) say(await shrunk(player, sequence, player.performed.length));
    }
    if (done % 10 === 9) say(`${done + 1} sequences, ${failures.length} with a finding, ${Math.round((performance.now() - until) / 1000 + 60 * minutes)} s`);
  }
  const { counts } = player.model;
  await player.end();
  say(`${done} sequences of seed ${seed}, ${failures.length} with a finding\n${Object.entries(counts).sort().map(([what, times]) => `  ${what}: ${times}`).join('\n')}`);
  expect(failures.join('\n')).toBe('');
  // A monkey that moves nothing finds nothing.
  if (done >= 20) expect(counts['ms that shafts turned'] ?? 0).toBeGreaterThan(1000);
});
