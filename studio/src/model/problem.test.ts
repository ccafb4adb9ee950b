import { expect, test } from 'vitest';
import { shownOf } from './problem';

test('problems are shown without the words of the API and of the command line', () => {
  expect(shownOf({ what: 'the axis has a job: reset_fault', where: 'ismc', hint: 'wait until it is done, or end it: DELETE /api/v1/jobs/50' })).toEqual({
    what: 'the axis has a job: reset fault', where: 'ismc', hint: 'wait until the job has ended, or cancel it on the Axis page',
  });
  // A job has no number on the page.
  expect(shownOf({ what: 'job 50 is not the last command of the axis, or is not done', where: 'ismc', hint: 'begin again if the axis shall move' })).toEqual({
    what: 'another command to the axis came in between, or the one before it was not carried out', where: 'ismc', hint: 'begin again if the axis shall move',
  });
  expect(shownOf({ what: 'job 50 was a job of a server that has ended' }).what).toBe('the server was restarted in between');
  expect(shownOf({ what: 'job 50 ended 12 s ago, more than 10 s' }).what).toBe('the command before it ended 12 s ago, more than 10 s');
  expect(shownOf({ what: 'replaced by the job quick_stop' }).what).toBe('replaced by the job quick stop');
  expect(shownOf({ what: 'there is no job "7"', where: 'address', hint: 'GET /api/v1/jobs lists the last 200' })).toEqual({ what: 'there is no job "7"' });
  expect(shownOf({ what: 'level is "a"', where: 'trigger.level', hint: 'send a number' })).toEqual({ what: 'level is "a"' });
  expect(shownOf({ what: '"60" is not an object', where: 'channels[2]' })).toEqual({ what: '"60" is not an object' });
  expect(shownOf({ what: 'the server does not answer', where: '/jobs/7' })).toEqual({ what: 'the server does not answer' });
  expect(shownOf({ what: 'no', where: 'can0', hint: '`servodrome up` runs simulated drives' })).toEqual({ what: 'no', where: 'can0' });
  // What happened to the gains is said, without the name of an option.
  expect(shownOf({ what: 'measured with the new gains: bandwidth 20.0 Hz instead of 40.0 Hz, phase margin 30 degrees', hint: 'choose a lower --bandwidth; the old gains are restored' })).toEqual({
    what: 'measured with the new gains: bandwidth 20.0 Hz instead of 40.0 Hz, phase margin 30 degrees', hint: 'choose a lower target bandwidth; the old gains are restored',
  });
  expect(shownOf({ what: 'the fault cannot be reset, because an injected fault holds: encoder_loss', hint: 'remove it: DELETE /api/v1/axes/ismc/faults' }).hint).toBe('remove the injected fault on the page "I/O and plant"');
  expect(shownOf({ what: 'the drive is not enabled', where: 'ismc', hint: 'enable it first' })).toEqual({ what: 'the drive is not enabled', where: 'ismc', hint: 'enable it first' });
  // Of the plant: the label of the field.
  expect(shownOf({ what: 'load.external_torque_nm: 1e+30 is not within -100000 .. 100000', where: 'body', hint: 'choose a valid value for the plant' })).toEqual({
    what: 'Load torque: 1e30 Nm is not within \u2212100\u2009000 … 100\u2009000 Nm', hint: 'enter a number of this range',
  });
  for (const [parameter, label] of [['supply.volts', 'Supply'], ['thermal.ambient_c', 'Ambient'], ['load.inertia_kgm2', 'Load inertia'], ['load.coulomb_friction_nm', 'Coulomb friction']]) {
    expect(shownOf({ what: `${parameter}: -1 is not within 0 .. 10`, where: 'body' }).what).toMatch(new RegExp(`^${label}: \u22121 \\S+ is not within 0 … 10 `));
  }
});
