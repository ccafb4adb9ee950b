import type { Problem } from '../api/types';
import { quantities } from './plant';
import { significant } from './units';

// The server's hints are for users of its API. The page replaces some by its own texts, and omits hints that name requests,
// JSON keys, files or commands.

const advice: [RegExp, string][] = [
  [/^the axis has a job/, 'wait until the job has ended, or cancel it on the Axis page'],
  [/an injected fault holds/, 'remove the injected fault on the page "I/O and plant"'],
  [/has no power$/, 'switch its power on'],
  [/^the drive has no object/, 'choose another object; to map one that is not listed, add its length in bits, for example 607A:00/32'],
  [/^the recording has not ended/, 'wait until it has ended, or stop it'],
  [/^(load|supply|thermal)\.\w+: .* is not within/, 'enter a number of this range'],
  [/^no memory is left for another recording/, 'stop or delete a recording'],
  // Tuning.
  [/limit switch is active \(60FDh\), .* revolutions from the start/, 'start farther away from the switch, or permit less travel'],
  [/revolutions from its start/, 'permit more travel'],
  [/^more than .* for .* cycles/, 'the axis is blocked or oscillates: check it, or raise the torque limit'],
  [/are not possible with|instead of .* Hz, phase margin/, 'choose a lower target bandwidth'],
  [/is not made slower|less than the .* before/, 'enter a target bandwidth to make the loop slower'],
];
// The numbers and the names of jobs in the server's texts, in the words of the page.
const words: [RegExp, (...found: string[]) => string][] = [
  [/^job \d+ is not the last command of the axis.*$/, () => 'another command to the axis came in between, or the one before it was not carried out'],
  [/^job \d+ was a job of a server that has ended$/, () => 'the server was restarted in between'],
  [/^job \d+ ended (\S+) s ago, more than (\S+) s$/, (_, ago, most) => `the command before it ended ${ago} s ago, more than ${most} s`],
  [/^(\w+\.\w+): (\S+) is not within (\S+) \.\. (\S+)$/, (whole, parameter, value, least, most) => {
    const quantity = quantities.find((each) => each.parameter === parameter);
    const [typed, from, to] = [value, least, most].map((number) => significant(Number(number)));
    return quantity ? `${quantity.label}: ${typed} ${quantity.unit} is not within ${from} … ${to} ${quantity.unit}` : whole;
  }],
  [/^(the axis has a job:|replaced by the job) (\S+)$/, (_, begin, job) => `${begin} ${job.replaceAll('_', ' ')}`],
];
const technical = /\/api\/|\b(GET|PUT|POST|DELETE)\b|`servodrome|--[a-z]|[{}]|\.md\b|^(send|write) /;
// Values of `where` that are parts of a request; the page does not show them.
const places = /^(address|body|header|server|message|Host|Origin|Authorization|do|units|channels|clock|jobs|recordings|subscribe)$|^(channels|pdos)\[|^(trigger|subscribe)\./;

export function shownOf({ what, where, hint }: Problem): Problem {
  const plain = words.reduce((text, [pattern, by]) => text.replace(pattern, by), what);
  const advised = advice.find(([pattern]) => pattern.test(what))?.[1];
  const clauses = hint?.split('; ') ?? [];
  const own = [advised, ...clauses.slice(advised ? 1 : 0).filter((clause) => !technical.test(clause))].filter(Boolean).join('; ');
  return {
    what: plain,
    ...(where && !where.startsWith('/') && !places.test(where) ? { where } : {}),
    ...(own ? { hint: own } : {}),
  };
}
