import type { Geometry, HomingLeg, HomingMethod } from '../api/types';

// The path of a homing method over the travel of the shaft, leg by leg from the start of the axis, as in the figures of the
// standard. With a reversed polarity (607Eh) positive legs run towards smaller counts.

export interface PathLeg {
  from: number; // counts
  to: number;
  leg: HomingLeg;
  index: number; // index of the leg in the method
  sign: 1 | -1; // 1: towards larger counts
}

const needed: Record<string, [keyof Geometry, string]> = {
  home: ['home_from', 'no home switch'],
  index: ['index_every', 'no index'],
  negative_limit: ['negative_limit', 'no negative limit switch'],
  positive_limit: ['positive_limit', 'no positive limit switch'],
  negative_stop: ['negative_stop', 'no stop at the negative end'],
  positive_stop: ['positive_stop', 'no stop at the positive end'],
};

// Why the axis cannot home by this method; empty: it can, or its wiring is not known.
export function cannotHome({ needs = [] }: HomingMethod, geometry: Geometry | undefined, hasIndex = true): string {
  const reasons = needs.filter((need) => geometry && need in needed && geometry[needed[need][0]] === null).map((need) => needed[need][1]);
  if (!hasIndex && needs.includes('index')) reasons.push('no index of this encoder');
  return reasons.join(', ');
}

// The method that the page proposes: 7 (home switch and index), or the first one that searches, if the wiring permits it.
export function proposedMethod(methods: HomingMethod[], geometry: Geometry | undefined, hasIndex = true): HomingMethod | undefined {
  const possible = methods.filter((method) => cannotHome(method, geometry, hasIndex) === '');
  return possible.find(({ method }) => method === 7) ?? possible.find(({ legs, method }) => legs.length > 0 && method > 0) ?? possible.find(({ method }) => method > 0) ?? possible[0] ?? methods[0];
}

// The path ends where the geometry has no edge ahead that the leg could reach. The homing would fail there as well, or the
// switch is not wired.
export function homingPath(method: HomingMethod, geometry: Geometry, start: number, isReversed = false): PathLeg[] {
  const { legs } = method;
  const path: PathLeg[] = [];
  let at = start;
  let index: number | null = insideHome(geometry, start) ? (method.start_active ?? 0) : 0;
  for (let guard = 0; index !== null && index < legs.length && guard < 2 * legs.length; ++guard) {
    const leg: HomingLeg = legs[index];
    const sign = (leg.direction === 'positive') !== isReversed ? 1 : -1;
    const limit = sign > 0 ? geometry.positive_limit : geometry.negative_limit;
    const target = endOf(leg, geometry, at, sign);
    const turns = leg.on_limit !== null && leg.on_limit !== undefined;
    if (turns && limit !== null && (target === null || (limit - target) * sign < 0)) {
      path.push({ from: at, to: limit, leg, index, sign });
      at = limit;
      index = leg.on_limit!;
      continue;
    }
    if (target === null) break;
    path.push({ from: at, to: target, leg, index, sign });
    at = target;
    if (leg.then === 'latch') break;
    index = leg.next ?? index + 1;
  }
  return path;
}

// Invented places of the switches and a start, to draw a method of a drive whose wiring is not known. Only the switches
// that its legs name have a place. The drawing is not to scale.
export function schematicOf({ legs }: HomingMethod): { geometry: Geometry; start: number } {
  const turn = 1000;
  const isNamed = (...untils: string[]) => legs.some(({ until }) => untils.includes(until));
  // A released switch lies behind the axis.
  const at = (until: string, direction: HomingLeg['direction']) => legs.some((leg) => leg.until === until && leg.direction === direction);
  const turnsAt = (direction: HomingLeg['direction']) => legs.some(({ direction: way, on_limit: next }) => way === direction && next !== null && next !== undefined);
  const hasHome = isNamed('home_rising', 'home_falling');
  const geometry: Geometry = {
    negative_stop: at('stalled', 'negative') ? -6 * turn : null,
    positive_stop: at('stalled', 'positive') ? 6 * turn : null,
    negative_limit: at('limit_reached', 'negative') || at('limit_released', 'positive') || turnsAt('negative') ? -5 * turn : null,
    positive_limit: at('limit_reached', 'positive') || at('limit_released', 'negative') || turnsAt('positive') ? 5 * turn : null,
    home_from: hasHome ? -turn : null, home_to: hasHome ? turn : null,
    index_every: turn, index_at: isNamed('index') ? 0.4 * turn : null,
  };
  return { geometry, start: !hasHome ? 0 : legs[0].direction === 'positive' ? -3 * turn : 3 * turn };
}

function insideHome({ home_from, home_to }: Geometry, at: number): boolean {
  return home_from !== null && home_to !== null && at >= home_from && at < home_to;
}

function endOf(leg: HomingLeg, geometry: Geometry, at: number, sign: number): number | null {
  const { home_from, home_to, index_every } = geometry;
  const ahead = sign > 0 ? geometry.positive_limit : geometry.negative_limit;
  const behind = sign > 0 ? geometry.negative_limit : geometry.positive_limit;
  const stop = sign > 0 ? geometry.positive_stop : geometry.negative_stop;
  const inFront = (mark: number | null) => (mark !== null && (mark - at) * sign >= 0 ? mark : null);
  switch (leg.until) {
    case 'home_rising': return inFront(sign > 0 ? home_from : home_to);
    case 'home_falling': return inFront(sign > 0 ? home_to : home_from);
    case 'limit_reached': return ahead;
    case 'limit_released': return behind;
    case 'stalled': return stop;
    case 'retracted': return at;
    case 'index': {
      if (!index_every) return null;
      const turns = (at - (geometry.index_at ?? 0)) / index_every;
      const next = sign > 0 ? Math.floor(turns) + 1 : Math.ceil(turns) - 1;
      return (geometry.index_at ?? 0) + next * index_every;
    }
    default: return null;
  }
}

// The present leg of an axis that was on leg `k`. It is the next leg if the axis has passed the end of its leg, or, if the
// next leg has the other direction, if the axis has reversed.
export function followLeg(path: PathLeg[], k: number, position: number, velocity: number): number {
  const leg = path[k];
  const next = path[k + 1];
  if (!leg || !next) return k;
  const passed = (position - leg.to) * leg.sign > 0;
  if (next.sign !== leg.sign) return Math.sign(velocity) === next.sign ? k + 1 : k;
  return passed ? k + 1 : k;
}
