import { significant } from './units';

// Predicts a motion from the numbers of its form, before it starts. The drive's own limits are not taken into account.

export interface Planned {
  distance?: number; // position units; none for a velocity without a target
  velocity: number; // position units per second, times `velocity_scale`
  acceleration: number; // position units per second squared
  velocity_scale?: number; // the velocity that equals one position unit per second: 60 for a velocity in rpm
}

export interface Predicted {
  ramp_s: number; // duration from standstill to the velocity, and also back
  braking: number; // distance from the velocity to rest, in position units
  top: number; // greatest velocity of the motion, in units of the velocity
  total_s?: number; // duration of a move by a distance
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

const spans = [[172800, 86400, 'days'], [7200, 3600, 'h'], [120, 60, 'min'], [1, 1, 's']] as const; // from, length, unit

export function seconds(s: number): string {
  const span = spans.find(([from]) => s >= from);
  return span ? `${significant(s / span[1])} ${span[2]}` : `${significant(Math.round(s * 1000))} ms`;
}
