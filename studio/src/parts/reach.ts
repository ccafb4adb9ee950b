import { get } from '../api/client';
import type { AxisView, Geometry, HomingMethod, Limits, ObjectValue, Units } from '../api/types';
import { axisPath } from '../commands';
import { hindrance, isReversed, type Move, type Reach } from '../model/plan';
import { isKnown } from '../model/units';
import { useResource } from '../resource';
import { snapshot, useAxis, useLine } from '../store';
import { useGeometry } from './travel';

const poll_ms = 3000; // of a simulated drive; a bus has no time for that
const polarityPath = (path: string) => `${path}/values?objects=607E:00`;

const useEvery = () => useLine(({ line }) => (line?.kind === 'virtual' ? poll_ms : 0));
const useAnswers = (name: string | null) => useLine(({ axes }) => {
  const axis = name === null ? undefined : (axes[name] as AxisView | undefined);
  return axis !== undefined && axis.powered && !axis.problem;
});

// `name` null: there is no axis, so nothing is requested. The same holds for useReach().
export function usePolarity(name: string | null): unknown {
  const answers = useAnswers(name);
  return useResource<{ values: Record<string, ObjectValue> }>(answers ? polarityPath(axisPath(name ?? '')) : null, useEvery()).value?.values['607E:00'];
}

export interface HomingView {
  methods: HomingMethod[];
  index_available?: boolean;
}

// The methods of an axis. A reversed polarity exchanges the ends of the travel that they need, so they are requested again when
// it changes.
export function useHoming(name: string, polarity: unknown): HomingView | undefined {
  return useResource<HomingView>(`${axisPath(name)}/homing${isReversed(polarity) ? '#reversed' : ''}`).value;
}

// What bounds the moves of an axis, for the pages that start one.
export function useReach(name: string | null): Reach {
  const answers = useAnswers(name);
  const every_ms = useEvery();
  const path = axisPath(name ?? '');
  const geometry = useGeometry(answers ? name : null);
  const units = useResource<Units>(answers ? `${path}/units` : null).value;
  const limits = useResource<Limits>(answers ? `${path}/limits` : null, every_ms).value;
  const polarity = usePolarity(name);
  return { geometry, units, limits, polarity };
}

// Why the axis cannot make the move in revolutions; empty: it can.
export function useHindrance(name: string, move: Move | null): string {
  const axis = useAxis(name);
  const reach = useReach(move && name);
  return axis && move && isKnown(reach.units) ? hindrance(axis, reach, move) : '';
}

// The same, asked once.
export async function hindranceNow(name: string, move: Move): Promise<string> {
  const path = axisPath(name);
  const isVirtual = snapshot().line?.kind === 'virtual';
  const [geometry, units, limits, polarity] = await Promise.all([
    isVirtual ? get<Geometry>(`${path}/geometry`) : undefined, get<Units>(`${path}/units`), get<Limits>(`${path}/limits`), get<{ values: Record<string, ObjectValue> }>(polarityPath(path)),
  ]);
  const axis = snapshot().axes[name] as AxisView | undefined;
  return axis && isKnown(units) ? hindrance(axis, { geometry, units, limits, polarity: polarity.values['607E:00'] }, move) : '';
}
