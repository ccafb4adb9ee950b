import { describe, expect, it } from 'vitest';
import { predict, seconds } from './predict';

describe('what a motion will be', () => {
  it('is a trapezium of a move that reaches its velocity', () => {
    expect(predict({ distance: -10, velocity: 2, acceleration: 4 })).toEqual({ ramp_s: 0.5, braking: 0.5, top: 2, total_s: 5.5 });
  });
  it('is a triangle of one that does not', () => {
    expect(predict({ distance: 1, velocity: 300, acceleration: 4 })).toEqual({ ramp_s: 0.5, braking: 0.5, top: 2, total_s: 1 });
  });
  it('takes rpm over revolutions', () => {
    expect(predict({ velocity: 300, acceleration: 50, velocity_scale: 60 })).toEqual({ ramp_s: 0.1, braking: 0.25, top: 300 });
  });
  it('shows how long an axis of unknown units takes', () => {
    const wild = predict({ velocity: 232742, acceleration: 50 })!;
    expect(seconds(wild.ramp_s)).toBe('77.581 min');
  });
  it('shows long durations by their own units', () => {
    expect([0.0004, 0.5, 1.25, 119, 120, 7199, 7200, 172799, 172800, 2e8].map(seconds)).toEqual([
      '0 ms', '500 ms', '1.25 s', '119 s', '2 min', '119.98 min', '2 h', '48 h', '2 days', '2314.8 days',
    ].map((text) => text.replace('2314', '2\u2009314')));
    expect(seconds(2e29)).toBe('2.3148e24 days');
  });
  it('says nothing of what cannot be', () => {
    for (const acceleration of [0, -1, NaN]) expect(predict({ velocity: 1, acceleration })).toBeNull();
    for (const velocity of [0, NaN]) expect(predict({ distance: 1, velocity, acceleration: 1 })).toBeNull();
    expect(predict({ distance: NaN, velocity: 1, acceleration: 1 })).toBeNull();
  });
});
