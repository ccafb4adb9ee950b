import { useEffect, useState } from 'react';
import type { AxisView, Geometry } from '../api/types';
import { axisPath } from '../commands';
import type { Units } from '../api/types';
import { useResource } from '../resource';
import { stream } from '../store';

// Where the drive is told to go, in counts: the true position and what the drive says is left. So it holds whatever
// the drive's zero is. Only while the axis is driven in a mode with a target position.
export function useTarget(axis: AxisView | undefined, geometry: Geometry | undefined): number | null {
  const name = axis?.name ?? '';
  const driven = axis?.state === 'operation enabled' && axis.mode === 1;
  const units = useResource<Units>(driven ? `${axisPath(name)}/units` : null).value;
  const [left, setLeft] = useState<number | null>(null);
  useEffect(() => {
    if (!driven) return;
    return stream.subscribe({
      channels: [{ axis: name, object: '607A:00' }, { axis: name, object: '6064:00' }],
      rate_hz: 10,
      frame: ({ channels: [target, actual] }) => {
        if (target.length > 0) setLeft(target[target.length - 1] - actual[actual.length - 1]);
      },
    });
  }, [driven, name]);
  if (!driven || left === null || !axis || !geometry?.index_every || !units?.position_per_revolution) return null;
  return axis.position_counts + (left * geometry.index_every) / units.position_per_revolution;
}
