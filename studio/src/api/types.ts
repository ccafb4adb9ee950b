// The answers of the bench API (docs/bench-api.md) that the page uses.

export interface Fault {
  code: string;
  name: string;
  text?: string;
  cause?: string;
  remedy?: string;
}

export interface Lamp {
  name: string;
  colour: 'green' | 'red' | 'yellow';
  light: 'off' | 'on' | 'blinking' | 'flickering' | 'flashes';
  flashes?: number;
}

export interface AxisView {
  name: string;
  product: string;
  bus: string | null;
  node_id?: number;
  bit_rate?: number;
  position?: number;
  al_state?: string;
  serial: { bus: string; station: number; protocol: string } | null;
  coupled?: string[]; // the axes to which the load is coupled; not for drives on buses
  powered: boolean;
  nmt_state?: string;
  state?: string;
  mode?: number;
  mode_name?: string;
  statusword?: number;
  controlword?: number;
  error_code?: number;
  homed?: boolean;
  in_motion?: boolean;
  outputs?: Record<string, boolean>;
  lamps?: Lamp[];
  warnings?: Fault[];
  faults?: Fault[];
  position_counts: number; // of the true shaft; for a drive on a bus 6064h, in its own units
  position_actual?: number; // 6064h in the drive's own units, of a simulated drive
  target_counts?: number | null; // of profile position, as a position of the shaft
  // These are null for a drive on a bus, of which only the objects are known.
  velocity_rpm: number | null;
  torque_nm: number | null;
  current_a: number | null;
  temperature_c: number | null;
  stage_temperature_c: number | null;
  supply_v: number | null;
  brake_engaged?: boolean;
  velocity?: number; // in the drive's own units
  torque_percent?: number; // of the rated torque
  problem?: Problem; // why the drive does not answer
  watch?: { by: string; within_s: number } | null; // the monitoring that stops the drive when the server fails; null: none
}

// The server behind the page: a simulated line or real drives.
export interface LineView {
  kind: 'virtual' | 'real';
  buses: string[];
  signals: string[];
  missing: Partial<Record<Missing, string>>; // functions that the server does not have, with the reason
}
export type Missing = 'plant' | 'inputs' | 'power' | 'fault_injection' | 'disturbance' | 'geometry' | 'virtual_time' | 'scenario';

export interface Clock {
  mode: 'real' | 'virtual';
  time_ns: number;
  time_ms: number;
  ticks: number;
  lag_ms?: number;
  lag_count?: number;
  speed?: number;
}

export interface BusLink {
  name: string;
  clients: number;
  to_bus: number;
  from_bus: number;
  dropped: number;
  refused: number;
  malformed: number;
}

export interface BusView {
  name: string;
  type: 'can' | 'ethercat' | 'rs485';
  bit_rate?: number;
  load_percent?: number;
  cut?: boolean;
  disturbance: Record<string, unknown> | null;
  axes: Record<string, Record<string, unknown>>;
  links: BusLink[];
  [counter: string]: unknown;
}

export interface ObjectEntry {
  index: string;
  sub: number;
  name: string;
  type: string;
  access: string;
  unit: string;
  pdo: string;
  saved: boolean;
  minimum?: number | null;
  maximum?: number | null;
  default?: ObjectValue;
  text?: string;
  enumeration?: unknown;
  bits?: unknown;
  terminal?: string; // the set of terminals to which the object belongs
}

export type ObjectValue = number | string | boolean | null;

export interface Geometry {
  negative_stop: number | null;
  positive_stop: number | null;
  negative_limit: number | null;
  positive_limit: number | null;
  home_from: number | null;
  home_to: number | null;
  index_every: number | null;
  index_at: number | null;
  inputs?: Record<string, unknown>;
  mechanics?: Mechanics;
}

// What the motor drives, as far as the line file describes it.
export interface Mechanics {
  kind: 'linear' | 'rotary' | 'arm' | 'crank';
  counts_per_revolution: number;
  cycle_revolutions: number; // motor revolutions in a turn of the arm or crank
  cycle_offset_turns: number;
  crank_ratio: number; // radius divided by length of the rod
  hangs: boolean;
  belt: boolean;
  elastic: boolean;
  coupling?: { axis: string; ratio: number } | null; // turns of this axis in a turn of the other
}

export interface Units {
  position_per_revolution: number | null;
  velocity_per_rps: number | null;
  acceleration_per_rps2: number | null;
}

// The product's names of its modes (6061h) and of the bits of the statusword. A bit with a mode has this name in that mode.
export interface Words {
  modes: Record<string, string | undefined>;
  statusword: { bit: number; name: string; mode?: number }[];
}

// Limits of the drive, in its own units; null: none.
export interface Limits {
  velocity: number | null;
  acceleration: number | null;
  deceleration: number | null;
  lowest_position: number | null; // null: no software limit acts now
  highest_position: number | null;
  wraps_within: [number, number] | null; // the range 607Bh of an axis that wraps around
}

export interface HomingLeg {
  direction: 'positive' | 'negative';
  speed: 'switch' | 'zero';
  until: string;
  then?: string;
  next?: number | null;
  on_limit?: number | null;
}

export interface HomingMethod {
  method: number;
  supported: boolean;
  legs: HomingLeg[];
  start_active?: number;
  returns?: boolean;
  needs?: string[]; // keys of the geometry: 'home', 'negative_limit', 'positive_stop' ...
}

export interface Transition {
  number: number;
  name: string;
  to: string;
  controlword: number;
}

export interface StatesView {
  state: string;
  transitions: Transition[];
}

export interface Problem {
  what: string;
  where?: string;
  hint?: string;
}

export interface Job {
  id: number;
  axis: string;
  do: string;
  units?: 'drive' | 'revolutions'; // units of the request and of result.position
  state: 'running' | 'done' | 'failed' | 'cancelled';
  ending?: boolean; // it still runs, but its axis is coming to rest
  began_tick?: number;
  note?: string; // a remark, for example that a halt became a quick stop
  error?: Problem;
  result?: { position?: number; seconds?: number };
  progress?: { doing: string; share: number };
  found?: unknown; // the result of a job that measures
}

// A request names a channel by its signal or object; the answer adds a name and a unit.
export interface ChannelRequest {
  axis: string;
  signal?: string;
  object?: string;
}

export interface Channel extends ChannelRequest {
  name: string;
  unit: string;
  sampled?: Sampled;
}

// How a channel of a recording of drives on buses is sampled. The numbers of samples are there when it has ended.
export interface Sampled {
  by: string;
  due_hz?: number;
  limit?: { what: string; where: string; hint: string };
  rate_hz?: number;
  samples?: number;
  missed?: number;
}

export interface Trigger {
  kind: 'now' | 'edge' | 'level' | 'state' | 'fault';
  channel?: number;
  level?: number;
  slope?: 'rising' | 'falling';
  axis?: string;
  state?: string;
}

export interface Recording {
  id: number;
  name: string;
  note?: string;
  state: 'armed' | 'running' | 'done' | 'stopped';
  rate_hz: number;
  trigger_tick: number | null;
  first_tick: number | null;
  samples: number;
  channels: Channel[];
  fault?: { axis: string; code: string };
}

export interface FaultList {
  active: Fault[];
  history: (Fault & Record<string, unknown>)[];
  injected: string[];
  injectable: { plant: string[]; drive: { code: string; cause: string; name: string }[] };
}

export interface Plant {
  locked_rotor: boolean;
  load_torque_nm: number;
  load_inertia_kgm2: number;
  friction_nm: number;
  supply_v: number;
  ambient_c: number;
  position_counts: number;
}

export type Inputs = Record<string, { level: boolean; forced: boolean }>;

// The catalogue of misbehaviours, and the rules that are in force.

export interface KeyType {
  type?: 'string' | 'boolean' | 'integer' | 'number';
  enum?: readonly string[];
  minimum?: number;
  maximum?: number;
  anyOf?: readonly KeyType[];
}
export type KeyTypes = Readonly<Record<string, KeyType>>;

export interface MessageNote {
  message: string;
  text: string;
  of_bus: boolean;
  clause: string;
}

export interface ActionNote {
  do: string;
  text: string;
  use: 'message' | 'once' | 'lasts';
  of_bus: boolean;
  clause: string;
  messages: string; // on which it can act; empty: all of the group
  keys: KeyTypes;
  example: Readonly<Record<string, string>>;
}

export interface ActionGroup {
  name: string;
  title: string;
  bus: string; // type of the buses that have it; empty: all
  messages: readonly MessageNote[];
  actions: readonly ActionNote[];
}

export interface Catalogue {
  groups: readonly ActionGroup[];
  message: KeyTypes;
  rule: KeyTypes;
  when: KeyTypes;
}

export interface RulesView {
  rules: { name: string; do: string; where: string; phase: 'waiting' | 'active' | 'over'; acts: number; first_act_s: number | null; error: string }[];
}
