import { expect, test } from '@playwright/test';
import { appendFileSync } from 'node:fs';
import { Chromium } from './monkey/chromium';
import { Player } from './monkey/player';
import { draw, type Sequence } from './monkey/sequence';

// A monkey at the studio (tests/studio/monkey/run --help): no shaft turns unless the last command of a person asks for it, and
// every STOP brings every axis to rest.

const seed = Number(process.env.MONKEY_SEED ?? 2026);
const count = Number(process.env.MONKEY_COUNT ?? 25);
const first = Number(process.env.MONKEY_FIRST ?? 0);
const minutes = Number(process.env.MONKEY_MINUTES ?? 0.4);
const players = Number(process.env.MONKEY_PLAYERS ?? 2);
const log = process.env.MONKEY_LOG;
// A line and a profile of the browser serve so many sequences: a page that is never loaded again grows slower.
const sequencesOfPlayer = 200;

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

test('a monkey moves no axis unasked, and STOP rests all', async () => {
  test.setTimeout((minutes + 2) * 60_000);
  const began = performance.now();
  const seconds = () => (performance.now() - began) / 1000;
  const browser = new Chromium();
  const failures: string[] = [];
  const counts: Record<string, number> = {};
  const most: Record<string, number> = {};
  let next = first;
  let done = 0;
  const fail = (text: string) => {
    failures.push(text);
    say(text);
  };

  // One of several monkeys that play at the same time. Each has a line of its own, and takes the next number.
  const plays = async () => {
    while (next < first + count && seconds() < 60 * minutes) {
      const player = await Player.open(browser);
      try {
        for (let i = 0; i < sequencesOfPlayer && next < first + count && seconds() < 60 * minutes; ++i) {
          const number = next++;
          const sequence = draw(seedOf(number));
          const found = await player.play(sequence).catch((error: Error) => [`broken off: ${error.message}`]);
          if (process.env.MONKEY_STORY) say(told(number, sequence, player.performed, found));
          if (found.length > 0) {
            fail(told(number, sequence, player.performed, found));
            if (process.env.MONKEY_SHRINK) say(await shrunk(player, sequence, player.performed.length));
          }
          if (++done % 100 === 0) say(`${done} sequences, ${failures.length} with a finding, ${Math.round(seconds())} s`);
          if (found.some((each) => each.startsWith('broken off'))) break;
        }
      } finally {
        for (const [what, times] of Object.entries(player.model.counts)) counts[what] = (counts[what] ?? 0) + times;
        for (const [what, value] of Object.entries(player.model.most)) most[what] = Math.max(most[what] ?? value, value);
        await player.end();
      }
    }
  };
  try {
    await Promise.all(Array.from({ length: players }, plays));
  } finally {
    await browser.end();
  }
  const list = Object.entries(counts).sort().map(([what, times]) => `  ${what}: ${times}`);
  list.push(...Object.entries(most).sort().map(([what, value]) => `  most ${what}: ${value.toFixed(1)}`));
  say(`${done} sequences of seed ${seed} from ${first}, ${failures.length} with a finding, ${Math.round(seconds())} s\n${list.join('\n')}`);
  expect(failures.join('\n')).toBe('');
  // A monkey that moves nothing finds nothing.
  if (done >= 20) expect(counts['ms that shafts turned'] ?? 0).toBeGreaterThan(1000);
});
