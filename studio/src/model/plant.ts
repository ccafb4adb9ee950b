import type { Plant } from '../api/types';

// The quantities of the simulated plant that the page changes.

export interface Quantity {
  key: keyof Plant;
  label: string;
  unit: string;
  parameter: string; // of the line file: the server's refusals name it
}

export const quantities: Quantity[] = [
  { key: 'load_torque_nm', label: 'Load torque', unit: 'Nm', parameter: 'load.external_torque_nm' },
  { key: 'load_inertia_kgm2', label: 'Load inertia', unit: 'kg·m²', parameter: 'load.inertia_kgm2' },
  { key: 'friction_nm', label: 'Coulomb friction', unit: 'Nm', parameter: 'load.coulomb_friction_nm' },
  { key: 'supply_v', label: 'Supply', unit: 'V', parameter: 'supply.volts' },
  { key: 'ambient_c', label: 'Ambient', unit: '°C', parameter: 'thermal.ambient_c' },
];
