import type { ObjectEntry } from '../api/types';
import { axisPath } from '../commands';
import { channelOf } from '../model/scope';
import { useResource } from '../resource';
import { useLine, usePowered } from '../store';

const signalUnits: Record<string, string> = {
  position_counts: 'counts', velocity_rpm: 'rpm', torque_nm: 'Nm', current_a: 'A', direct_current_a: 'A', temperature_c: '°C', stage_temperature_c: '°C',
  supply_v: 'V', direct_voltage_v: 'V', quadrature_voltage_v: 'V',
};

export interface About {
  name: string;
  unit: string;
  type: string;
}

// Name, unit and type of an object, which the page requests once; of a signal only its unit. Undefined: not known.
export function useObject(text: string): About | undefined {
  const { axis = '', signal, object } = channelOf(text) ?? {};
  const exists = useLine((line) => line.order.includes(axis));
  const powered = usePowered(axis);
  const { value } = useResource<Pick<ObjectEntry, 'name' | 'type' | 'unit'>>(object && exists && powered ? `${axisPath(axis)}/objects/${object.replace(':', '/')}` : null);
  if (signal) return { name: '', unit: signalUnits[signal] ?? '', type: '' };
  return value;
}
