import { expect, test } from 'vitest';
import { StopChord } from './stop_chord';

const space = (type: string, ctrlKey: boolean) => ({ type, code: 'Space', key: ' ', ctrlKey });
const control = (type: string) => ({ type, code: 'ControlLeft', key: 'Control', ctrlKey: type === 'keydown' });

test('Ctrl, then Space: stops once, and no control sees Space', () => {
  const chord = new StopChord();
  expect(chord.key(control('keydown'))).toEqual({ stops: false, isTaken: false });
  expect(chord.key(space('keydown', true))).toEqual({ stops: true, isTaken: true });
  expect(chord.key(space('keydown', true))).toEqual({ stops: false, isTaken: true }); // the key repeats
  expect(chord.key(space('keyup', true)).isTaken).toBe(true);
  expect(chord.key(space('keydown', true)).stops).toBe(true); // pressed again
});

test('Space, then Ctrl: stops, and the control that Space has pressed sees its release', () => {
  const chord = new StopChord();
  expect(chord.key(space('keydown', false))).toEqual({ stops: false, isTaken: false });
  expect(chord.key(control('keydown')).stops).toBe(true);
  expect(chord.key(space('keydown', true))).toEqual({ stops: false, isTaken: true });
  expect(chord.key(space('keyup', true)).isTaken).toBe(false);
});

test('Space alone stops nothing', () => {
  const chord = new StopChord();
  expect(chord.key(space('keydown', false)).stops).toBe(false);
  expect(chord.key(space('keyup', false))).toEqual({ stops: false, isTaken: false });
  expect(chord.key(control('keydown')).stops).toBe(false);
});

test('the window loses the focus while Space is held', () => {
  const chord = new StopChord();
  chord.key(space('keydown', false));
  chord.reset();
  expect(chord.key(control('keydown')).stops).toBe(false);
});
