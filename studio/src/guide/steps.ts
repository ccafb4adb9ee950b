import type { ObjectEntry } from '../api/types';
import { cannotHome, proposedMethod } from '../model/homing';
import { addressOf, namedOf } from '../model/objects';
import { isReversed, positionAt, slack } from '../model/plan';
import { predict } from '../model/predict';
import { missingForTune } from '../model/tuning';
import type { StepState } from './state';
import { firstOf, has, keptOf, lostGains, notInDrive, positionText, reachOf, refusedIn, type Facts, type Field, type Motion, type Numbers, type Step } from './step';
import { toDrive } from './mechanics';

// The guided commissioning: one row for each step. The page (pages/commission.tsx) shows any row by the same rules.

// Sets of objects that limit the torque; the guide uses the first set that the drive has: those of CiA 402, the current
// limit of the iSMK, and Pn401 and Pn402 of the ProNet.
const torqueLimits = [['6072:00'], ['60E0:00', '60E1:00'], ['6073:00'], ['3068:00', '3069:00']];
const torqueOf = (facts: Facts) => firstOf(facts, torqueLimits);
const factoryOf = (facts: Facts, object: string) => Number(facts.entries.get(object)?.default ?? NaN);

const torqueField = (facts: Facts, share: number, label: string): Field[] => {
  const objects = torqueOf(facts);
  if (objects.length === 0) return [];
  const unit = facts.entries.get(objects[0])?.unit ?? '';
  return [{ key: 'torque', label, unit, objects, usual: Math.round(factoryOf(facts, objects[0]) * share), minimum: 1, maximum: 65535 }];
};

const noTorqueLimit = (facts: Facts) =>
  torqueOf(facts).length > 0 ? '' : `${facts.axis.product} has none of the objects ${torqueLimits.flat().map((object) => `${object.slice(0, 4)}h`).join(', ')}: its torque cannot be limited over the bus.`;

const noScale = ({ scale }: Facts) => (scale ? '' : 'The size of the drive\'s units is not known: complete the step "Units" first.');

// `lacks` of a step that needs the scale. While the page requests the units, the form stays, so that an open list does
// not close.
const lacksScale = (facts: Facts) => (facts.units ? noScale(facts) : '');

// The objects of a profile. The move uses the values in the drive, so the guide writes them, not the job.
const profile = (velocity: number, acceleration: number): Field[] => [
  { key: 'velocity', label: 'Velocity', kind: 'velocity', objects: ['6081:00'], usual: velocity, minimum: 0 },
  { key: 'acceleration', label: 'Acceleration', kind: 'acceleration', objects: ['6083:00', '6084:00'], usual: acceleration, minimum: 0 },
];

// The usual value, or nine tenths of the drive's limit if that is less.
function within(facts: Facts, kind: 'velocity' | 'acceleration', usual: number): number {
  const limits = facts.limits;
  const most = kind === 'velocity' ? limits?.velocity : Math.min(limits?.acceleration ?? Infinity, limits?.deceleration ?? Infinity);
  return most && facts.scale && Number.isFinite(most) ? Math.min(usual, Math.floor((9 * most) / facts.scale.drive[kind]) / 10) : usual;
}

const seconds = (numbers: Numbers, distance: number) =>
  predict({ velocity: numbers('velocity'), acceleration: numbers('acceleration'), velocity_scale: 1, distance })?.total_s ?? 1;

// The check of the direction allows a difference of 0.02 revolutions, and a coarse encoder has few counts in that. A
// smaller move does not show the direction.
const shows = 0.05;
const least_counts = 10;
const leastDistance = ({ scale }: Facts, revolutions: number, why: string) => ({ size: Math.max(revolutions, least_counts / (scale?.drive.position ?? Infinity)), why });
const leastOfDirection = (facts: Facts) => leastDistance(facts, shows, 'a smaller move does not show the direction');
const leastOfMeasurement = (facts: Facts) => leastDistance(facts, 0, 'a smaller move cannot be measured');

// A move that is recorded, from a little before its start to a little after its end.
const moves = (id: string, label: string, says: string, back: boolean): Motion => ({
  id,
  label,
  says,
  begins: ['enable'],
  commands: ['6040:00', '6060:00', '607A:00'],
  mode: () => 1,
  reach: (numbers) => [numbers('distance')],
  orders: (numbers, { scale }) => {
    const by = scale ? toDrive(scale, 'position', numbers('distance')) : NaN;
    const there = { do: 'move', by };
    return back ? Array.from({ length: Math.max(1, Math.round(numbers('times') || 1)) }, () => [there, { do: 'move', by: -by }]).flat() : [there];
  },
  records: (numbers, { scale, isVirtual }) => {
    const distance = numbers('distance');
    const drive = (kind: 'position' | 'velocity' | 'acceleration', value: number) => (scale ? toDrive(scale, kind, value) : NaN);
    const total_ms = 1000 * seconds(numbers, distance);
    return {
      // The recording triggers at a twentieth of the speed.
      channels: [
        { object: '606C:00', name: 'velocity', kind: 'velocity', role: 'velocity' },
        { object: '6064:00', name: 'position', kind: 'position', role: 'response' },
        { signal: 'following_error', name: 'following error', kind: 'position', role: 'error' },
      ],
      level: Math.sign(distance) * drive('velocity', numbers('velocity')) * 0.05,
      sign: Math.sign(distance),
      pre_ms: Math.round(0.15 * total_ms) + 20,
      duration_ms: Math.round(1.5 * total_ms) + 60,
      rate_hz: isVirtual ? 1000 : 100,
      request: { by: drive('position', distance), velocity: drive('velocity', numbers('velocity')), acceleration: drive('acceleration', numbers('acceleration')) },
    };
  },
});

const cyclicVelocity = 9;

const stepOfVelocity: Motion = {
  id: 'step',
  label: 'Measure a step',
  says: 'The axis is disabled and enabled, then runs at the step\'s velocity for the given time, then stands. If the drive has no cyclic synchronous velocity, the job makes the ramps 6083h and 6084h steep meanwhile and restores them.',
  begins: ['disable', 'enable'], // without the torque that friction holds from the motion before
  commands: ['6040:00', '6060:00', '60FF:00'],
  mode: () => 3,
  passes: [cyclicVelocity],
  reach: (numbers) => [numbers('amplitude') * numbers('seconds') * 1.2],
  orders: (numbers, { scale }) => [{
    do: 'step', of: 'velocity', amplitude: scale ? toDrive(scale, 'velocity', numbers('amplitude')) : NaN, seconds: numbers('seconds'),
    travel: scale ? toDrive(scale, 'position', Math.abs(numbers('amplitude')) * numbers('seconds') * 2 + 0.1) : NaN,
  }],
  records: (numbers, { scale, isVirtual }) => {
    const amplitude = scale ? toDrive(scale, 'velocity', numbers('amplitude')) : NaN;
    return {
      channels: [
        { object: '60FF:00', name: 'target', kind: 'velocity', role: 'demand' },
        { object: '606C:00', name: 'velocity', kind: 'velocity', role: 'response' },
      ],
      level: amplitude / 2,
      sign: Math.sign(amplitude),
      pre_ms: Math.round(numbers('seconds') * 120),
      duration_ms: Math.round(numbers('seconds') * 1100),
      end_ms: numbers('seconds') * 970,
      rate_hz: isVirtual ? 4000 : 100,
      request: { amplitude },
    };
  },
};

const tune: Motion = {
  id: 'tune',
  label: 'Measure the loop and propose gains',
  says: 'The axis moves slowly forward and back with a small test signal. No gain is written: the proposed gains appear above. The axis is disabled at the end, and keeps the mode of operation of the measurement until a later motion or an undo.',
  begins: [],
  commands: ['6040:00', '6060:00', '60FF:00'],
  mode: ({ gains }) => gains?.velocity_mode ?? cyclicVelocity,
  reach: (numbers) => [numbers('travel')],
  orders: (numbers) => [{
    do: 'tune', apply: false, travel: numbers('travel'), torque_percent: numbers('percent'), seconds: 8,
    ...(Number.isFinite(numbers('bandwidth')) ? { bandwidth_hz: numbers('bandwidth') } : {}),
  }],
  isMissing: ({ gains, axis, entries }) => (gains ? missingForTune(gains, axis.product, (object) => entries.has(object)) : ''),
};

// The API explains the position gain of every product with this sentence (docs/bench-api.md, "gains").
const isPositionGain = (does: string) => does.startsWith('the axis reaches its target sooner');

// The proposed gains, or else the first set that the drive has: the position gains, or all others.
function gainFields(facts: Facts, position: boolean): Field[] {
  const gains = (facts.gains?.gains ?? []).filter(({ object }) => has(facts, object));
  const { proposed } = facts;
  const wanted = gains.filter(({ does }) => isPositionGain(does) === position);
  const named = wanted.filter(({ object }) => object in proposed);
  const first = wanted.filter(({ set }) => set === wanted[0]?.set);
  return (named.length > 0 ? named : first).map(({ object }, i) => {
    const entry = facts.entries.get(object);
    const now = facts.values[object];
    return {
      ...(i === 0 ? { group: 'Gains of the drive' } : {}), key: object, label: entry?.name ?? object, unit: entry?.unit ?? '', objects: [object],
      usual: proposed[object] ?? (typeof now === 'number' ? now : NaN), minimum: entry?.minimum ?? undefined, maximum: entry?.maximum ?? undefined, isGain: true,
    } as Field;
  });
}

export function noGains(facts: Facts): string {
  const gains = facts.gains?.gains;
  if (gains === undefined || facts.entries.size === 0 || gains.some(({ object }) => has(facts, object))) return '';
  const reason = gains.length === 0
    ? `The manual of ${facts.axis.product} documents no gains: there are none to write.`
    : `The gains of ${facts.axis.product} are no objects on its bus: set them on the drive itself.`;
  return `${reason} A step can be measured.`;
}

// 607Dh by the names of its sub-indices, since makers exchange them.
function softLimits(facts: Facts): Field[] {
  const ends = [['lowest', 'Lowest position', /negative|min/i], ['highest', 'Highest position', /positive|max/i]] as const;
  return ends.flatMap(([key, label, name]) => {
    const entry = ['607D:01', '607D:02'].map((object) => facts.entries.get(object)).find((each) => each && name.test(each.name));
    if (!entry) return [];
    return [{ key, label, kind: 'position' as const, objects: [addressOf(entry)], usual: softLimit(facts, key) }];
  });
}

const margin = 0.25; // revolutions between a soft limit and the switch or stop

type End = 'lowest' | 'highest';

// The limit switch or the stop at an end of the travel, as a position of 6064h. Null: it is not known.
function endOfTravel({ geometry, axis, ...facts }: Facts, end: End): { name: string; at: number } | null {
  const side = (end === 'highest') === isReversed(facts.polarity) ? 'negative' : 'positive';
  const [name, mark] = typeof geometry?.[`${side}_limit`] === 'number' ? [`the ${side} limit switch`, geometry[`${side}_limit`]] : [`the ${side} stop`, geometry?.[`${side}_stop`]];
  const at = typeof mark === 'number' ? positionAt(axis, reachOf({ geometry, axis, ...facts }), mark) : null;
  return at === null ? null : { name, at };
}

// Inside the limit switch or the stop. NaN: the travel is not known.
function softLimit(facts: Facts, end: End): number {
  const { at } = endOfTravel(facts, end) ?? { at: NaN };
  return Math.round((at + (end === 'lowest' ? margin : -margin)) * 100) / 100;
}

function refusedSoftLimits(facts: Facts, state: StepState): string {
  const numbers = keptOf(state, softLimits(facts));
  if (numbers('lowest') >= numbers('highest')) return 'The lowest position must be below the highest.';
  const text = (turns: number) => positionText(facts, turns);
  return ([['lowest', -1], ['highest', 1]] as const).flatMap(([key, sign]) => {
    const end = endOfTravel(facts, key);
    return end && (numbers(key) - end.at) * sign > slack ? [`The ${key} position, ${text(numbers(key))}, lies beyond ${end.name} at ${text(end.at)}: choose one inside.`] : [];
  }).join(' ');
}

function homingFields(facts: Facts): Field[] {
  const { methods = [], index_available } = facts.homing ?? {};
  const reason = (each: (typeof methods)[number]) => cannotHome(each, facts.geometry, index_available);
  const possible = methods.filter(({ supported }) => supported).sort((a, b) => Number(reason(a) !== '') - Number(reason(b) !== ''));
  const usual = proposedMethod(possible, facts.geometry, index_available)?.method ?? NaN;
  const text = (each: (typeof methods)[number]) => `${each.method}: ${each.legs.map(({ direction, until }) => `${direction} to ${until.replaceAll('_', ' ')}`).join(', ') || 'at the present position'}`;
  return [
    { key: 'method', label: 'Method', objects: ['6098:00'], usual, options: possible.map((each) => [each.method, text(each), reason(each)] as const) },
    { key: 'fast', label: 'Speed during search for switch', kind: 'velocity', objects: ['6099:01'], usual: within(facts, 'velocity', 2), minimum: 0 },
    { key: 'slow', label: 'Speed during search for zero', kind: 'velocity', objects: ['6099:02'], usual: 0.5, minimum: 0 },
    { key: 'acceleration', label: 'Acceleration', kind: 'acceleration', objects: ['609A:00'], usual: within(facts, 'acceleration', 20), minimum: 0 },
  ];
}

// The direction of counting: CiA 402 has bits 7 and 6 of 607Eh, a drive whose 607Eh is 0 or 1 has one bit.
const oneWay = (entry: ObjectEntry | undefined) => (entry?.maximum === 1 ? 1 : 0xc0);

function polarity(facts: Facts, state: StepState): Field[] {
  const entry = facts.entries.get('607E:00');
  if (!entry || state.typed.polarity === undefined) return [];
  const one = oneWay(entry);
  return [{ key: 'polarity', label: 'Polarity (607Eh)', objects: ['607E:00'], usual: NaN, options: [[0, '0: as delivered'], [one, `${one}: reversed`]] }];
}

// The other direction of counting than the drive's present one.
export function reversedPolarity({ entries, values }: Facts): number | undefined {
  const now = values['607E:00'];
  return typeof now === 'number' ? now ^ oneWay(entries.get('607E:00')) : undefined;
}

function inputFields({ entries, values }: Facts): Field[] {
  return [...entries.entries()].filter(([, { terminal, access }]) => terminal === 'Functions of the inputs' && access.includes('w')).map(([object, entry], i) => {
    const now = values[object];
    const choices = namedOf(entry.enumeration);
    const present = typeof now === 'number' ? now : NaN;
    const known = choices.some(({ value }) => value === present) || !Number.isFinite(present);
    return {
      ...(i === 0 ? { group: 'Functions of the inputs' } : {}),
      key: object, label: entry.name, unit: entry.unit, objects: [object], usual: present, minimum: entry.minimum ?? undefined, maximum: entry.maximum ?? undefined,
      ...(choices.length > 0 ? { options: [...choices.map(({ value, name }) => [value, `${value}: ${name}`] as const), ...(known ? [] : [[present, String(present)] as const])] } : {}),
    } as Field;
  });
}

// Inputs to which the machine's switches are wired. The wiring of a simulated axis is known. A drive on a bus shows only 60FDh:
// every bit with a name counts, except those that the person marks as not wired.
export const namedInputs = ({ entries }: Facts) => namedOf(entries.get('60FD:00')?.bits);
export const wiredInputs = (facts: Facts, { found }: StepState): string[] =>
  facts.isVirtual ? [...new Set(Object.values(facts.geometry?.inputs ?? {}).map(String))] : namedInputs(facts).map(({ name }) => name).filter((name) => !found.notWired?.includes(name));

// Objects that tell which motor and encoder the drive has: by their names, since each maker has its own.
const ofMotor = /^(?!.*(temperature|reset|utilization)).*\b(motor|encoder|rated)\b/i;
const motorObjects = ({ entries }: Facts) =>
  [...entries].filter(([, { name, access }]) => ofMotor.test(name) && access.includes('r')).map(([object]) => object);

const formNotInDrive = (fields: Field[], facts: Facts, state: StepState) => notInDrive(facts, fields, keptOf(state, fields));

const isMeasured = (state: StepState) => (state.found.first || state.found.last ? '' : 'No measurement yet.');

export const identify: Step = {
  id: 'identify', title: 'Identify', view: 'identify', reads: ['1008:00', '1009:00', '100A:00', '1018:01', '1018:02', '1018:03', '1018:04', '6402:00', '6075:00', '6076:00', '608F:01', '608F:02', '607F:00', '6080:00', '60C5:00', '60C6:00', '6502:00'],
  also: (facts) => [...motorObjects(facts), ...torqueOf(facts)],
  why: 'Compare product, motor, encoder and limits with the nameplate before anything moves: a wrong motor or encoder shows here first.',
  check: 'The values were compared with the nameplate, and agree.',
  open: (facts, { found }) => {
    const { shown } = objectsOf(identify, facts, []);
    if (shown.length === 0 || shown.some((object) => facts.values[object] === undefined)) return 'The objects have not been read yet.';
    return found.agrees ? '' : 'Compare the values with the nameplate.';
  },
};

export const steps: Step[] = [
  {
    id: 'find', title: 'Find the drive', view: 'find', reads: ['1000:00'],
    why: 'A drive that answers on its bus can be commissioned. The list has the drives of this line, or those that the studio found on its buses when it started. Scan a bus to see what answers on it now.',
    check: 'The drive has power and answers.',
    open: ({ axis }) => (axis.powered && !axis.problem ? '' : 'The drive does not answer.'),
  },
  identify,
  {
    id: 'units', title: 'Units', view: 'units', reads: ['608F:*', '6091:*', '6092:*', '6093:*', '6094:*', '6096:*', '6097:*'],
    why: 'Positions and speeds are shown in the units of the machine from here on. The page keeps them; the factors in the drive stay as they are.',
    check: 'The drive\'s units per revolution are known.',
    open: noScale,
  },
  {
    id: 'inputs', title: 'Inputs and switches', view: 'inputs', reads: ['60FD:00'], fields: inputFields,
    why: 'Press every switch, or force its input here, and see the drive react. A limit switch that does not react cannot stop the axis.',
    lacks: (facts) => (facts.isVirtual || namedInputs(facts).length > 0 ? '' : `${facts.axis.product} has no object 60FDh (digital inputs) with named bits: its inputs cannot be seen over the bus.`),
    check: (facts, state) => (wiredInputs(facts, state).length > 0 ? 'Every wired input was seen at both levels.' : facts.isVirtual ? 'No switch is wired to this drive.' : 'Every input is marked as not wired.'),
    open: (facts, state) => {
      if (facts.isVirtual ? !facts.geometry : facts.entries.size === 0) return 'The wiring is not known yet.';
      const missing = wiredInputs(facts, state).filter((input) => !state.found.seen?.[input]?.every(Boolean));
      return missing.length === 0 ? '' : `Not seen at both levels yet: ${missing.join(', ')}.`;
    },
  },
  {
    id: 'direction', title: 'Direction and encoder', view: 'direction', reads: ['6061:00', '6064:00'], also: () => ['607E:00'],
    why: 'A small, slow move with little torque shows the direction and that the encoder counts as far as the shaft turns.',
    fields: (facts, state) => [
      { key: 'distance', label: 'Distance', kind: 'position', usual: 0.1, least: leastOfDirection(facts) },
      ...profile(within(facts, 'velocity', 0.5), within(facts, 'acceleration', 5)),
      ...torqueField(facts, 0.2, 'Torque limit during the move'),
      ...polarity(facts, state),
    ],
    lacks: lacksScale,
    motions: [moves('move', 'Make the small move', 'One move by the distance, at the velocity and with the torque limit above. Abort halts it.', false)],
    check: '6064h moved by the distance, and the machine moved the right way.',
    open: (facts, { found: { moved, way } }) => {
      if (!moved || Math.abs(moved.asked) < (1 - 1e-9) * leastOfDirection(facts).size) return 'The small move has not been made yet.';
      if (Math.abs(moved.drive - moved.asked) > 0.02 + 0.02 * Math.abs(moved.asked)) return '6064h did not move by the distance: check the encoder and the units.';
      if (moved.shaft !== null && Math.abs(Math.abs(moved.shaft) - Math.abs(moved.drive)) > 0.02) return 'The shaft turned by another angle than 6064h: check the encoder\'s resolution.';
      return way === 'right' ? '' : way === 'wrong' ? 'Reverse the direction, move again, and look again.' : 'Say which way the machine moved.';
    },
  },
  {
    id: 'torque', title: 'Torque limit', reads: ['6075:00', '6076:00'], also: () => torqueLimits.flat(),
    why: 'The greatest torque protects the machine from a collision. The step before left a low limit; this is the one to work with. Proposed is the factory value.',
    fields: (facts) => torqueField(facts, 1, 'Torque or current limit'),
    lacks: noTorqueLimit,
    check: 'The drive has the limit.',
    open: (facts, state) => formNotInDrive(torqueField(facts, 1, 'Torque or current limit'), facts, state),
  },
  {
    id: 'velocity', title: 'Velocity loop', view: 'loop', reads: [],
    why: 'The velocity loop decides how stiff and how fast the axis is. Measure a step and the loop, write the proposed gains, then measure both again.',
    fields: (facts) => [
      { key: 'amplitude', label: 'Velocity of the step', kind: 'velocity', usual: within(facts, 'velocity', 1) },
      { key: 'seconds', label: 'Duration of the step', unit: 's', usual: 0.2, minimum: 0.02, maximum: 2 },
      { key: 'travel', label: 'Travel of the measurement', unit: 'motor rev', usual: 3, minimum: 0.5, maximum: 1000 },
      { key: 'percent', label: 'Torque limit of the measurement', unit: '% of rated', usual: 60, minimum: 1, maximum: 300 },
      { key: 'bandwidth', label: 'Target bandwidth (blank: at least 60 % of maximum)', unit: 'Hz', usual: NaN, minimum: 1, maximum: 1000, mayBeEmpty: true },
      ...gainFields(facts, false),
    ],
    lacks: lacksScale,
    motions: [stepOfVelocity, tune],
    check: 'A step is measured; after new gains, again.',
    open: (facts, state) => lostGains(facts, 'velocity') || isMeasured(state),
  },
  {
    id: 'position', title: 'Position loop', view: 'response', reads: [],
    why: 'The position gain decides how closely the axis follows its target. A higher gain leaves less following error; above about a third of the velocity loop\'s bandwidth the axis oscillates.',
    fields: (facts) => [
      { key: 'distance', label: 'Distance', kind: 'position', usual: 0.5, least: leastOfMeasurement(facts) },
      ...profile(within(facts, 'velocity', 2), within(facts, 'acceleration', 20)),
      ...gainFields(facts, true),
    ],
    lacks: lacksScale,
    motions: [moves('move', 'Measure a move', 'One move by the distance; position and following error are recorded.', false)],
    check: 'A move is measured; after a new gain, again.',
    open: (facts, state) => lostGains(facts, 'position') || isMeasured(state),
  },
  {
    id: 'homing', title: 'Homing', view: 'homing', reads: ['607C:00', '6064:00'],
    why: 'Homing gives the position its zero. The drawing shows the path of the method over the switches.',
    fields: homingFields,
    lacks: (facts) => lacksScale(facts) || (facts.homing && facts.homing.methods.every(({ supported }) => !supported) ? `${facts.axis.product} has no homing method.` : ''),
    motions: [{
      id: 'home', label: 'Home', begins: ['enable'], commands: ['6040:00', '6060:00'], mode: () => 6, orders: () => [{ do: 'home' }],
      says: 'The axis follows the drawing at the speeds above and stops at a limit switch that the method does not use.',
    }],
    check: 'The drive reports home, and the axis stands.',
    open: ({ axis }, { found }) => (found.homedBy !== undefined && axis.homed !== false ? '' : 'The axis has not been homed here yet.'),
  },
  {
    id: 'limits', title: 'Soft limits', reads: ['607D:*'],
    why: 'The drive goes to no target beyond its soft limits. They count from the zero that homing has set, and lie inside the limit switches.',
    fields: softLimits,
    lacks: (facts) => lacksScale(facts) || (softLimits(facts).length === 2 ? '' : `${facts.axis.product} has no object 607Dh (software position limit): only switches and stops end its travel.`),
    check: 'The drive has the limits.',
    refuses: refusedSoftLimits,
    open: (facts, state) => formNotInDrive(softLimits(facts), facts, state),
  },
  {
    id: 'cycle', title: 'First cycle', view: 'response', reads: [],
    why: 'There and back at working speed: the first cycle of the machine. The report shows the recorded move there.',
    fields: (facts) => [
      { key: 'distance', label: 'Distance', kind: 'position', usual: 2, least: leastOfMeasurement(facts) },
      ...profile(within(facts, 'velocity', 5), within(facts, 'acceleration', 50)),
      { key: 'times', label: 'Cycles', usual: 1, minimum: 1, maximum: 100, isWhole: true },
    ],
    lacks: lacksScale,
    motions: [moves('move', 'There and back', 'The axis moves by the distance and returns, for the given number of cycles. Abort halts it.', true)],
    check: 'The axis is back where it began.',
    open: (_, state) => isMeasured(state) || (state.found.moved && Math.abs(state.found.moved.drive) > 0.01 ? 'The axis did not return to its start.' : ''),
  },
  {
    id: 'store', title: 'Store', view: 'store', reads: ['1010:01'],
    why: 'The written values act at once, and are lost at power-off unless the drive stores them. The guide can undo a value, not a storing: after an undo, store again.',
    check: (_, { found }) => (found.stored?.stored ? 'The drive has stored its parameters.' : 'The drive has no store command.'),
    open: (_, { found }) => (found.stored ? '' : 'Not stored yet.'),
  },
  {
    id: 'report', title: 'Report', view: 'report', reads: [],
    why: 'Everything that was done and measured, on one page: to save as a file, or to print as PDF.',
    check: 'The report is saved with the machine\'s papers.',
    open: (_, { found }) => (found.saved ? '' : 'The report is not saved yet: save it as a file, or print it and say so.'),
  },
];

export const checkOf = ({ check }: Step, facts: Facts, state: StepState) => (typeof check === 'string' ? check : check(facts, state));

// Why the numbers of the form are not used: those of a field by itself, and those that do not fit together. Empty: they are.
export function refusedBy(step: Step, facts: Facts, state: StepState): string {
  const fields = fieldsOf(step, facts, state);
  return refusedIn(facts, fields, keptOf(state, fields)) || (step.refuses?.(facts, state) ?? '');
}

// The condition of a step that is not met yet; empty: the step is complete.
export const openOf = (step: Step, facts: Facts, state: StepState) => refusedBy(step, facts, state) || step.open(facts, state);

export const fieldsOf = (step: Step, facts: Facts, state: StepState): Field[] => step.fields?.(facts, state) ?? [];

// The objects of a step that this drive has, and those that it lacks.
export function objectsOf(step: Step, facts: Facts, fields: Field[]): { shown: string[]; absent: string[]; all: string[] } {
  const shown: string[] = [];
  const absent: string[] = [];
  for (const object of step.reads) {
    const found = object.endsWith('*') ? [...facts.entries.keys()].filter((each) => each.startsWith(object.slice(0, 5)) && each.slice(5) !== '00') : has(facts, object) ? [object] : [];
    if (found.length === 0) absent.push(object.replace(':*', '').replace(':00', ''));
    shown.push(...found);
  }
  for (const object of step.also?.(facts) ?? []) if (has(facts, object) && !shown.includes(object)) shown.push(object);
  const written = fields.flatMap(({ objects = [] }) => objects.filter((object) => has(facts, object)));
  const commanded = (step.motions ?? []).flatMap(({ commands }) => commands.filter((object) => has(facts, object)));
  return { shown, absent, all: [...new Set([...shown, ...written, ...commanded])] };
}
