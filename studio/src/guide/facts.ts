import { useMemo } from 'react';
import type { AxisView, Limits, ObjectEntry, ObjectValue, Units } from '../api/types';
import { axisPath } from '../commands';
import { addressOf } from '../model/objects';
import type { Gains } from '../model/tuning';
import { useHoming } from '../parts/reach';
import { useGeometry } from '../parts/travel';
import { useResource } from '../resource';
import { useLine } from '../store';
import { scaleOf } from './mechanics';
import { stepOf, type Guide } from './state';
import type { Facts, Step } from './step';
import { fieldsOf, objectsOf, steps } from './steps';

const most = 128; // of one request
const poll_ms = { virtual: 500, real: 2000 }; // limited by the time of a bus

const polarity = '607E:00';

// All data that a step's row of the table needs: read once, except the values of the objects of the step and of the journal.
export function useFacts(axis: AxisView, guide: Guide, step: Step): { facts: Facts; again: () => void } {
  const path = axisPath(axis.name);
  const asked = axis.powered && !axis.problem;
  const isVirtual = useLine(({ line }) => line?.kind === 'virtual');
  const objects = useResource<{ objects: ObjectEntry[] }>(asked ? `${path}/objects` : null).value?.objects;
  const units = useResource<Units>(asked ? `${path}/units` : null).value;
  const limits = useResource<Limits>(asked ? `${path}/limits` : null, isVirtual ? 3000 : 0);
  const gains = useResource<Gains>(asked ? `${path}/gains` : null).value;
  const geometry = useGeometry(axis.name);
  const entries = useMemo(() => new Map((objects ?? []).map((entry) => [addressOf(entry), entry])), [objects]);
  const factory = useMemo(() => Object.fromEntries((objects ?? []).map((entry) => [addressOf(entry), entry.default])), [objects]);
  const proposed = stepOf(guide, 'velocity').found.proposed?.values;
  const before: Facts = {
    axis, isVirtual, entries, values: {}, mechanics: guide.mechanics, scale: scaleOf(guide.mechanics, units), units, limits: limits.value, geometry, polarity: null, homing: undefined, gains, proposed: proposed ?? {},
    journal: guide.journal, powerOn: { stored: guide.stored ?? {}, factory },
  };
  // The report says of every step whether it is complete.
  const read = step.view === 'report' ? steps : [step];
  const wanted = [...new Set([...read.flatMap((each) => objectsOf(each, before, fieldsOf(each, before, stepOf(guide, each.id))).all), ...guide.journal.map(({ object }) => object), ...(entries.has(polarity) ? [polarity] : [])])];
  const { value, again } = useResource<{ values: Record<string, ObjectValue> }>(
    asked && entries.size > 0 && wanted.length > 0 ? `${path}/values?objects=${wanted.slice(0, most).join(',')}` : null, isVirtual ? poll_ms.virtual : poll_ms.real,
  );
  const values = value?.values ?? {};
  const homing = useHoming(axis.name, values[polarity]); // the objects of the steps do not depend on it
  const after = () => {
    again();
    limits.again(); // a write may have changed them
  };
  return { facts: { ...before, values, polarity: values[polarity], homing }, again: after };
}
