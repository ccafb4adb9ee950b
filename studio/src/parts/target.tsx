import { useEffect, useState } from 'react';
import type { AxisView, Geometry, Units } from '../api/types';
import { axisPath } from '../commands';
import { useResource } from '../resource';
import { watchTarget } from '../targets';

// The target position in counts of the shaft: the true position plus the remaining distance that the drive reports. So it
// does not depend on the drive's zero. Null unless the axis is enabled in profile position.
export function useTarget(axis: AxisView | undefined, geometry: Geometry | undefined): number | null {
  const name = axis?.name ?? '';
  const driven = axis?.state === 'operation enabled' && axis.mode === 1;
  const units = useResource<Units>(driven ? `${axisPath(name)}/units` : null).value;
  const [left, setLeft] = useState<number | null>(null);
  useEffect(() => {
    if (!driven) return;
    return watchTarget(name, setLeft);
  }, [driven, name]);
  if (!driven || left === null || !axis || !geometry?.index_every || !units?.position_per_revolution) return null;
  return axis.position_counts + (left * geometry.index_every) / units.position_per_revolution;
}
