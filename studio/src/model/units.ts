import type { Limits, Units } from '../api/types';

// Converts positions and velocities between revolutions, rpm and rev/s^2 and the drive's own units; formats numbers.

export const toDrivePosition = (units: Units | undefined, revolutions: number) => scale(revolutions, units?.position_per_revolution);
export const toDriveVelocity = (units: Units | undefined, rpm: number) => scale(rpm / 60, units?.velocity_per_rps);
export const toDriveAcceleration = (units: Units | undefined, rps2: number) => scale(rps2, units?.acceleration_per_rps2);
export const fromDrivePosition = (units: Units | undefined, value: number) => unscale(value, units?.position_per_revolution);

export const isKnown = (units: Units | undefined) => Boolean(units?.position_per_revolution && units.velocity_per_rps && units.acceleration_per_rps2);

// The greatest velocity in rpm and acceleration in rev/s^2 that the drive's limits permit; Infinity: no limit.
export interface Greatest {
  velocity: number;
  acceleration: number;
}
export function greatestOf(units: Units | undefined, limits: Limits | undefined): Greatest {
  const least = Math.min(limits?.acceleration ?? Infinity, limits?.deceleration ?? Infinity);
  return {
    velocity: (60 * (limits?.velocity ?? Infinity)) / (units?.velocity_per_rps ?? 1),
    acceleration: least / (units?.acceleration_per_rps2 ?? 1),
  };
}

// The greatest numbers that the objects of a motion can hold, in revolutions, rpm and rev/s^2, or in the drive's units
// if their size is not known. They are rounded down to whole numbers, small ones to five digits.
export interface Holds {
  position: number; // INTEGER32: 607Ah
  speed: number; // UNSIGNED32: 6081h, 6099h
  velocity: number; // INTEGER32: 60FFh, of both directions
  acceleration: number; // UNSIGNED32: 6083h, 6084h, 609Ah
}
export function holdsOf(units: Units | undefined): Holds {
  const { position_per_revolution: position, velocity_per_rps: velocity, acceleration_per_rps2: acceleration } = isKnown(units) && units ? units : noUnits;
  const [signed, unsigned] = [2 ** 31 - 1, 2 ** 32 - 1];
  const turns = isKnown(units) ? 60 : 1;
  return {
    position: roundedDown(signed / (position ?? 1)),
    speed: roundedDown((turns * unsigned) / (velocity ?? 1)),
    velocity: roundedDown((turns * signed) / (velocity ?? 1)),
    acceleration: roundedDown(unsigned / (acceleration ?? 1)),
  };
}
const noUnits: Units = { position_per_revolution: null, velocity_per_rps: null, acceleration_per_rps2: null };

function roundedDown(value: number): number {
  const places = Math.max(0, 4 - Math.floor(Math.log10(value)));
  return Math.floor(value * 10 ** places) / 10 ** places;
}

// The usual value. If it is above `greatest`, returns `greatest` rounded down to two digits.
export function proposed(usual: number, greatest: number): number {
  if (!(greatest < usual)) return usual;
  const step = 10 ** (Math.floor(Math.log10(greatest)) - 1);
  return Number((Math.floor(greatest / step + 1e-9) * step).toPrecision(2));
}

function scale(value: number, factor: number | null | undefined): number | null {
  return factor ? Math.round(value * factor) : null;
}

function unscale(value: number, factor: number | null | undefined): number | null {
  return factor ? value / factor : null;
}

// A fixed number of decimal places, a minus sign (U+2212), and thin spaces between thousands. Numbers of 15 digits and more have
// five digits and a power of ten.
export function fixed(value: number | null | undefined, places: number): string {
  if (value === null || value === undefined || !Number.isFinite(value)) return '–';
  if (Math.abs(value) >= 1e15) return value.toExponential(4).replace(/\.?0*e\+/, 'e').replace('-', '\u2212');
  const [whole = '', fraction] = Math.abs(value).toFixed(places).split('.');
  const grouped = whole.replace(/\B(?=(\d{3})+$)/g, '\u2009');
  const zero = /^[0.]*$/.test(whole + (fraction ?? ''));
  return (value < 0 && !zero ? '\u2212' : '') + grouped + (fraction ? `.${fraction}` : '');
}

// About five significant digits without trailing zeros, for cursors and measurements in any unit.
export function significant(value: number | null | undefined): string {
  if (value === null || value === undefined || !Number.isFinite(value)) return '–';
  const size = Math.abs(value);
  if (size >= 1e5 || Number.isInteger(value)) return fixed(value, 0);
  if (size === 0) return '0';
  return fixed(value, Math.max(0, Math.min(6, 4 - Math.floor(Math.log10(size))))).replace(/(\.\d*?)0+$/, '$1').replace(/\.$/, '');
}

export function duration(ns: number): string {
  const total = ns / 1e9;
  const hours = Math.floor(total / 3600);
  const minutes = Math.floor((total % 3600) / 60);
  const seconds = (total % 60).toFixed(1).padStart(4, '0');
  return hours > 0 ? `${hours}:${String(minutes).padStart(2, '0')}:${seconds}` : `${minutes}:${seconds}`;
}

// The ticks of a logarithmic axis: 1 to 9 times each power of ten.
export function decadeTicks(min: number, max: number): number[] {
  const ticks: number[] = [];
  for (let power = Math.floor(Math.log10(min)); power <= Math.log10(max); ++power) {
    for (let k = 1; k <= 9; ++k) {
      const tick = Number(`${k}e${power}`);
      if (tick >= min && tick <= max) ticks.push(tick);
    }
  }
  return ticks;
}

// Whether a tick of a logarithmic axis has room for its number: 1, 2 and 5, or only 1 of narrow decades.
export function isLabelled(tick: number, decade_pixels: number): boolean {
  const first = Math.round(tick / 10 ** Math.floor(Math.log10(tick) + 1e-9));
  return first === 1 || (decade_pixels > 150 && (first === 2 || first === 5));
}

// Texts of the tick marks of a plot's axis, with enough decimal places to distinguish them. A null tick gets no text.
export function ticksText(ticks: readonly (number | null)[]): string[] {
  const there = ticks.filter((tick): tick is number => tick !== null);
  const steps = there.slice(1).map((tick, i) => Math.abs(tick - there[i])).filter((step) => step > 0);
  const steady = steps.length > 0 && Math.max(...steps) < 1.5 * Math.min(...steps);
  if (!steady) return ticks.map((tick) => (tick === null ? '' : significant(tick)));
  const step = Math.min(...steps);
  let places = 0;
  while (places < 9 && Math.abs(Math.round(step * 10 ** places) / 10 ** places - step) > step * 1e-3) ++places;
  return ticks.map((tick) => (tick === null ? '' : fixed(tick, places)));
}
