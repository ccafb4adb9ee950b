import { significant } from './units';

// What a motion will be, from the numbers of its form: before its button is pressed, and without the drive's own limits.

export interface Planned {
  distance?: number; // of a move by a distance
  velocity: number; // position units per second, times `velocity_scale`
  acceleration: number; // the same, per second squared
  velocity_scale?: number; // of one position unit per second, in units of the velocity: 60 where it is in rpm
}

export interface Predicted {
  ramp_s: number; // from standstill to the velocity, and back
  braking: number; // position units, from the velocity to rest
  top: number; // the velocity that is reached, in its own units
  total_s?: number; // of a move by a distance
}

export function predict({ distance, velocity, acceleration, velocity_scale = 1 }: Planned): Predicted | null {
  const speed = Math.abs(velocity) / velocity_scale;
  if (!(acceleration > 0) || !Number.isFinite(speed)) return null;
  const ramp_s = speed / acceleration;
  const braking = (speed * ramp_s) / 2;
  if (distance === undefined) return { ramp_s, braking, top: Math.abs(velocity) };
  if (!(speed > 0) || !Number.isFinite(distance)) return null;
  const way = Math.abs(distance);
  if (way < 2 * braking) {
    const top = Math.sqrt(way * acceleration);
    return { ramp_s: top / acceleration, braking: way / 2, top: top * velocity_scale, total_s: (2 * top) / acceleration };
  }
  return { ramp_s, braking, top: Math.abs(velocity), total_s: way / speed + ramp_s };
}

export const seconds = (s: number) => (s >= 120 ? `${significant(s / 60)} min` : s >= 1 ? `${significant(s)} s` : `${significant(Math.round(s * 1000))} ms`);
