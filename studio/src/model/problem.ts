import type { Problem } from '../api/types';

// The server's hints are for users of its API. The page replaces some by its own texts, and omits hints that name requests,
// JSON keys, files or commands.

const advice: [RegExp, string][] = [
  [/^the axis has a job/, 'wait until the job has ended, or cancel it on the Axis page'],
  [/has no power$/, 'switch its power on'],
  [/^the drive has no object/, 'choose an object of the list, or add its length in bits, for example 607A:00/32'],
  [/^the recording has not ended/, 'wait until it has ended, or stop it'],
  [/^no memory is left for another recording/, 'stop or delete a recording'],
];
const technical = /\/api\/|\b(GET|PUT|POST|DELETE)\b|`servodrome|--[a-z]|[{}]|\.md\b|^(send|write) /;
// Values of `where` that are parts of a request; the page does not show them.
const places = ['address', 'body', 'header', 'server', 'message', 'Host', 'Origin', 'Authorization', 'do', 'units', 'channels', 'clock', 'jobs', 'recordings', 'subscribe'];

export function shownOf({ what, where, hint }: Problem): Problem {
  const plain = what.startsWith('the axis has a job: ') ? what.replaceAll('_', ' ') : what;
  const own = advice.find(([pattern]) => pattern.test(what))?.[1] ?? (hint && !technical.test(hint) ? hint : undefined);
  return {
    what: plain,
    ...(where && !where.startsWith('/') && !places.includes(where) ? { where } : {}),
    ...(own ? { hint: own } : {}),
  };
}
