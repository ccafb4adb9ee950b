import { useEffect, useRef, useState } from 'react';
import { Tab, TabList, TabPanel, Tabs } from 'react-aria-components';
import type { AxisView, Geometry, HomingMethod, Limits, ObjectEntry, StatesView, Units } from '../api/types';
import { axisPath, following, power, runJob, writeObject } from '../commands';
import { AxisTabs, usePageAxis } from '../parts/axis_tabs';
import { Button, Choice, HaltButton, Panel, Readout, Toggle } from '../parts/controls';
import { Front } from '../parts/front';
import { NumberForm, NumberInput, NumbersButton, useNumbersAreRight } from '../parts/number_input';
import { HomingFigure } from '../parts/homing_figure';
import { useReplay } from '../replay';
import { JobLine } from '../parts/job_line';
import { JogButton } from '../parts/jog';
import { LiveLanes } from '../parts/live';
import { useHoming, usePolarity } from '../parts/reach';
import { StateChip } from '../parts/state';
import { StateDiagram } from '../parts/state_diagram';
import { Travel, useGeometry } from '../parts/travel';
import { Word } from '../parts/word';
import { controlBits, isStop, modeText, motionHindrance, statusBits } from '../model/cia402';
import { cannotHome, proposedMethod } from '../model/homing';
import { controlTip, statusTip } from '../model/meanings';
import { addressOf } from '../model/objects';
import { endOf, hindrance, isReversed, type Ghost, type Reach } from '../model/plan';
import { predict, seconds } from '../model/predict';
import { fixed, fromDrivePosition, greatestOf, holdsOf, isKnown, proposed, significant, type Greatest, type Holds } from '../model/units';
import { attempt } from '../notices';
import { useResource } from '../resource';
import { keep, useRoute } from '../route';
import { snapshot, useAxis, useLine, useMissing } from '../store';
import { Commands, Speed, Torque, unitOf, usePositionLabel, useWords } from './line';

export function AxisPage() {
  const name = usePageAxis(useRoute().name);
  const axis = useAxis(name);
  const words = useWords(name);
  if (!axis) return null;
  return (
    <>
      <AxisTabs page="axis" name={name} />
      <div className="axis-page">
        <div className="column">
          <Motion axis={axis} />
          <Curves name={name} powered={axis.powered} />
        </div>
        <div className="column">
          <Power axis={axis} />
          <Panel title="Words">
            <div className="words">
              <Word name="Controlword" value={axis.controlword} bits={controlBits(axis.controlword ?? 0, axis.mode, axis.product)} tipOf={(bit, name) => controlTip(bit, name, axis.mode ?? 0, axis.product)} />
              <Word name="Statusword" value={axis.statusword} bits={statusBits(axis.statusword ?? 0, axis.mode, words)} tipOf={(bit, name) => statusTip(bit, name, axis.mode ?? 0, axis.product)} />
            </div>
          </Panel>
          <Front axis={axis} />
        </div>
      </div>
    </>
  );
}

function Power({ axis }: { axis: AxisView }) {
  const { name, state, powered } = axis;
  // The possible transitions depend on the state only, so they are requested again when it changes.
  const { value } = useResource<StatesView>(powered ? `${axisPath(name)}/states#${encodeURIComponent(state ?? '')}` : null);
  const transitions = value && value.state === state ? value.transitions : [];
  const missing = useMissing('power');
  // A job, not only a controlword, enables and resets faults: for example, it clears old targets before it enables.
  const ask = (command: string, to: string, controlword: number) => {
    if (command.includes('reset')) return runJob(name, { do: 'reset_fault' });
    if (to === 'operation enabled') return runJob(name, { do: 'enable' });
    return writeObject(name, 0x6040, 0, controlword);
  };
  return (
    <Panel title="State machine" aside={<StateChip axis={axis} />}>
      <StateDiagram state={powered ? state : undefined} transitions={transitions} product={axis.product} />
      <div className="buttons" role="group" aria-label="Transitions allowed now">
        {transitions.map(({ number, name: command, to, controlword }) => {
          const act = () => attempt(() => ask(command, to, controlword));
          const text = <><span className="quiet">{number}</span> {command} <span className="quiet">→ {to}</span></>;
          return isStop(state, to) ? <HaltButton key={number} onHalt={act}>{text}</HaltButton> : <Button key={number} onPress={act}>{text}</Button>;
        })}
        {missing === undefined && (powered ? (
          <Button onPress={() => attempt(() => power(name, 'cycle'))}>Power cycle</Button>
        ) : (
          <Button kind="main" onPress={() => attempt(() => power(name, 'on'))}>Power on</Button>
        ))}
      </div>
    </Panel>
  );
}

function Curves({ name, powered }: { name: string; powered: boolean }) {
  const [running, setRunning] = useState(true);
  const isReal = useLine(({ line }) => line && line.kind === 'real') ?? undefined;
  return (
    <Panel title="Last ten seconds" className="curves" aside={<Button kind="bare" onPress={() => setRunning(!running)}>{running ? 'Pause' : 'Resume'}</Button>}>
      {powered && isReal !== undefined ? (
        <LiveLanes
          label="Live curves"
          channels={[{ axis: name, signal: 'position_counts' }, { axis: name, signal: isReal ? 'velocity' : 'velocity_rpm' }, { axis: name, signal: 'following_error' }]}
          rate_hz={100}
          seconds={10}
          running={running}
          fill
        />
      ) : (
        <p className="empty">{isReal ? 'The drive does not answer.' : 'No power.'}</p>
      )}
    </Panel>
  );
}

const kinds = [['position', 'Position'], ['velocity', 'Velocity'], ['torque', 'Torque'], ['jog', 'Jog'], ['home', 'Homing']] as const;

const limits_ms = 3000; // interval of reading the limits of a simulated drive; a bus has no time for that

function Motion({ axis }: { axis: AxisView }) {
  const { name } = axis;
  const kind = useRoute().query.get('do') ?? 'position';
  const words = useWords(name);
  const [ghost, setGhost] = useState<Ghost | null>(null);
  const geometry = useGeometry(name);
  const positionLabel = usePositionLabel();
  const units = useResource<Units>(axis.powered ? `${axisPath(name)}/units` : null).value;
  const job = useLine((line) => line.jobs[name]);
  const turns = geometry?.index_every ? axis.position_counts / geometry.index_every : axis.velocity === undefined ? null : fromDrivePosition(units, axis.position_counts);
  const enabled = axis.powered && axis.state === 'operation enabled';
  const isVirtual = useLine(({ line }) => line?.kind === 'virtual');
  const limits = useResource<Limits>(axis.powered && !axis.problem ? `${axisPath(name)}/limits` : null, isVirtual ? limits_ms : 0);
  const reason = motionHindrance(axis);
  const polarity = usePolarity(name);
  // The proposed numbers depend on the limits, so no motion starts before these are known.
  const isFree = reason === '' && job?.state !== 'running' && Boolean(limits.value ?? limits.problem);
  const move = { name, names: useUnitNames(name, units, limits.value), isFree, reason };
  return (
    <Panel title="Motion" aside={<span className="quiet">{[axis.product, modeText(axis.mode, words)].filter(Boolean).join(', ')}</span>}>
      <Travel axis={axis} geometry={geometry} ghost={ghost} />
      <dl className="readouts">
        <Readout label={positionLabel} {...(turns === null ? { value: fixed(axis.position_counts, 0), unit: unitOf(axis) } : { value: fixed(turns, 4), unit: 'rev' })} title={`${axis.position_counts} ${unitOf(axis)}`} />
        {axis.position_actual !== undefined && <Readout label="drive's position (6064h)" value={units?.position_per_revolution ? fixed(fromDrivePosition(units, axis.position_actual), 4) : fixed(axis.position_actual, 0)} unit={units?.position_per_revolution ? 'rev' : 'units'} title={`${axis.position_actual} units of the drive`} />}
        <Speed axis={axis} />
        <Torque axis={axis} />
        {axis.current_a !== null && <Readout label="current" value={fixed(axis.current_a, 2)} unit="A" />}
      </dl>
      {axis.position_actual !== undefined && (
        <p className="quiet note">The true position is that of the simulated shaft; 6064h counts from the drive's zero, which homing sets. Targets are positions of 6064h.</p>
      )}
      {axis.watch === null && (
        <p className="warning" role="note">The drive does not monitor this connection: if the program ends or the cable fails while the axis moves, the axis keeps moving. Keep the emergency stop within reach.</p>
      )}
      <div className="buttons">
        <Commands axis={axis} />
        <JobLine job={job} units={units} />
      </div>
      <Tabs className="moves" selectedKey={kind} onSelectionChange={(key) => keep({ do: String(key) })}>
        <TabList className="tabs" aria-label="Kind of motion">
          {kinds.map(([id, text]) => (
            <Tab key={id} id={id} className="tab">{text}</Tab>
          ))}
        </TabList>
        <TabPanel id="position"><NumberForm><PositionMove {...move} axis={axis} reach={{ geometry, units, limits: limits.value, polarity }} onPlan={setGhost} /></NumberForm></TabPanel>
        <TabPanel id="velocity"><NumberForm><VelocityMove {...move} /></NumberForm></TabPanel>
        <TabPanel id="torque"><NumberForm><TorqueMove {...move} /></NumberForm></TabPanel>
        <TabPanel id="jog"><NumberForm><JogMove {...move} enabled={enabled} /></NumberForm></TabPanel>
        <TabPanel id="home"><NumberForm><HomeMove {...move} axis={axis} geometry={geometry} polarity={polarity} /></NumberForm></TabPanel>
      </Tabs>
    </Panel>
  );
}

const useJob = (name: string) => useLine((line) => (line.jobs[name] as (typeof line.jobs)[string] | undefined));

// Revolutions, rpm and rev/s^2 if the size of the drive's units is known, else the drive's own units. The page proposes no
// numbers in units of unknown size.
interface UnitNames {
  units: 'revolutions' | 'drive';
  known: boolean;
  unknown: boolean; // the drive has answered, and does not report them
  position: string;
  velocity: string;
  acceleration: string;
  speed: (value: number) => number; // converts a typed velocity to the units of the job
  velocity_scale: number; // the velocity that equals one position unit per second
  greatest: Greatest; // what the drive's limits permit, in the units of the form
  holds: Holds; // what its objects can hold
}

function useUnitNames(name: string, units: Units | undefined, limits: Limits | undefined): UnitNames {
  const known = isKnown(units);
  const greatest = greatestOf(units, limits);
  const holds = holdsOf(units);
  const objects = useResource<{ objects: ObjectEntry[] }>(units && !known ? `${axisPath(name)}/objects` : null).value?.objects;
  if (known) return { units: 'revolutions', known, unknown: false, position: 'rev', velocity: 'rpm', acceleration: 'rev/s²', speed: (rpm) => rpm / 60, velocity_scale: 60, greatest, holds };
  const position = objects?.find((entry) => addressOf(entry) === '607A:00')?.unit || 'units';
  // CiA 402 defines velocities as position units per second, accelerations as position units per second squared.
  return { units: 'drive', known, unknown: units !== undefined, position, velocity: `${position}/s`, acceleration: `${position}/s²`, speed: (value) => value, velocity_scale: 1, greatest: { velocity: limits?.velocity ?? Infinity, acceleration: limits?.acceleration ?? Infinity }, holds };
}

interface MoveProps {
  name: string;
  names: UnitNames;
  isFree: boolean; // a motion may begin, and no job runs
  reason: string; // title of the disabled buttons; empty: a motion may begin
}

async function enableAnd(name: string, request: { do: string } & Record<string, unknown>) {
  const enabled = await runJob(name, { do: 'enable' });
  if (enabled?.state === 'done') await runJob(name, { ...request, ...following(enabled) });
}

// The typed number; before typing `usual`, or the drive's limit if that is lower. NaN if the unit is not known.
function useNumber(usual: number, names: UnitNames, limit?: keyof Greatest): [number, (to: number) => void] {
  const [typed, setTyped] = useState<number | null>(null);
  return [typed ?? (names.known ? proposed(usual, limit ? names.greatest[limit] : Infinity) : NaN), setTyped];
}

const amount = (value: number, unit: string) => `${significant(value)} ${unit}`;

function Prediction({ names, distance, velocity, acceleration }: { names: UnitNames; distance?: number; velocity: number; acceleration: number }) {
  const { unknown, velocity_scale, greatest } = names;
  const right = useNumbersAreRight();
  const limited = Math.sign(velocity) * Math.min(Math.abs(velocity), greatest.velocity);
  const given = right ? predict({ velocity: limited, acceleration: Math.min(acceleration, greatest.acceleration), velocity_scale, ...(distance === undefined ? {} : { distance }) }) : null;
  let text = 'Enter all values to see the predicted motion.';
  if (given) {
    const way = distance === undefined ? '' : `, ${amount(Math.abs(distance), names.position)} in ${seconds(given.total_s ?? 0)}`;
    // The server's Jobs::longest_halt is 250 ms.
    text = `Reaches ${amount(given.top, names.velocity)} in ${seconds(given.ramp_s)}${way}; a halt takes ${seconds(given.ramp_s)} and ${amount(given.braking, names.position)} (a halt longer than 250 ms becomes a quick stop).`;
  }
  return (
    <p className="quiet note" role="note">
      {text}
      {right && Math.abs(velocity) > greatest.velocity && ` The drive's limit (607Fh, 6080h) is ${amount(greatest.velocity, names.velocity)}.`}
      {right && acceleration > greatest.acceleration && ` The drive's limit (60C5h, 60C6h) is ${amount(greatest.acceleration, names.acceleration)}.`}
      {unknown && ' The drive does not report its units per revolution: begin with small values.'}
    </p>
  );
}

function PositionMove({ name, names, isFree, reason, axis, reach, onPlan }: MoveProps & {
  axis: AxisView;
  reach: Reach;
  onPlan: (ghost: Ghost | null) => void;
}) {
  const [how, setHow] = useState<'by' | 'to'>('by');
  const [distance, setDistance] = useNumber(1, names);
  const [velocity, setVelocity] = useNumber(300, names, 'velocity');
  const [acceleration, setAcceleration] = useNumber(50, names, 'acceleration');
  const [repeats, setRepeats] = useState(false);
  const repeating = useRef(false);
  repeating.current = repeats;
  const { greatest, holds, velocity_scale, known } = names;
  const right = useNumbersAreRight();
  const { geometry } = reach;
  const request = { do: 'move', units: names.units, velocity: names.speed(velocity), acceleration, deceleration: acceleration };
  const start = (where: { by: number } | { to: number }) => attempt(() => enableAnd(name, { ...request, ...where }));
  // Moves there and back; repeats this while the switch is on, every move succeeds and the axis gets no other command.
  const thereAndBack = () =>
    attempt(async () => {
      let last = await runJob(name, { do: 'enable' });
      do {
        for (const by of [distance, -distance]) {
          if (last?.state !== 'done' || snapshot().jobs[name]?.id !== last.id) return;
          last = await runJob(name, { ...request, by, ...following(last) }); // refused after any other command
        }
      } while (repeating.current);
    });
  const cannot = !isFree || !(velocity > 0) || !(acceleration > 0);
  const there = how === 'by' ? { by: distance } : { to: distance };
  const forward = known ? endOf(axis, reach, there) : null;
  const reasonFor = (move: { by: number } | { to: number }) => (known && right ? hindrance(axis, reach, move) : '');
  const [ahead, behind, zero] = [reasonFor(there), how === 'by' ? reasonFor({ by: -distance }) : '', reasonFor({ to: 0 })];
  const turn = geometry?.index_every;
  const given = right && forward !== null && turn ? predict({ velocity: Math.min(velocity, greatest.velocity), acceleration: Math.min(acceleration, greatest.acceleration), velocity_scale, distance: (forward - axis.position_counts) / turn }) : null;
  const text = given ? `${amount(given.top, names.velocity)}, ${seconds(given.total_s ?? 0)}` : '';
  // A shaft that holds its position moves by some counts, which must not cause a new drawing of the plan.
  const shown = forward === null || text === '' || axis.in_motion || !turn ? null : (Math.round((1000 * forward) / turn) * turn) / 1000;
  useEffect(() => {
    onPlan(shown === null ? null : { to: shown, text });
    return () => onPlan(null);
  }, [onPlan, shown, text]);
  useEffect(() => () => {
    repeating.current = false; // the page was left
  }, []);
  return (
    <div className="form">
      <Choice label="Move" value={how} options={[['by', 'by a distance'], ['to', 'to a position']]} onChange={setHow} />
      <NumberInput label={how === 'by' ? 'Distance' : 'Position'} unit={names.position} value={distance} onChange={setDistance} minimum={-holds.position} maximum={holds.position} />
      <NumberInput label="Velocity" unit={names.velocity} value={velocity} onChange={setVelocity} above={0} maximum={holds.speed} />
      <NumberInput label="Acceleration" unit={names.acceleration} value={acceleration} onChange={setAcceleration} above={0} maximum={holds.acceleration} />
      <div className="buttons">
        {how === 'by' && <NumbersButton title={reason} isDisabled={cannot || behind !== ''} onPress={() => start({ by: -distance })}>− Back</NumbersButton>}
        <NumbersButton kind="main" title={reason} isDisabled={cannot || ahead !== ''} onPress={() => start(there)}>{how === 'by' ? 'Move +' : 'Move'}</NumbersButton>
        {how === 'by' && <NumbersButton title={reason} isDisabled={cannot || ahead !== ''} onPress={thereAndBack}>There and back</NumbersButton>}
        <NumbersButton title={reason} isDisabled={cannot || zero !== ''} onPress={() => start({ to: 0 })}>Go to zero</NumbersButton>
        {how === 'by' && <Toggle isSelected={repeats} onChange={setRepeats}>repeat there and back</Toggle>}
      </div>
      {ahead !== '' && <p className="trouble" role="alert">{ahead}</p>}
      <Prediction names={names} velocity={velocity} acceleration={acceleration} {...(how === 'by' ? { distance } : {})} />
    </div>
  );
}

function VelocityMove({ name, names, isFree, reason }: MoveProps) {
  const [velocity, setVelocity] = useNumber(120, names, 'velocity');
  const [acceleration, setAcceleration] = useNumber(20, names, 'acceleration');
  return (
    <div className="form">
      <NumberInput label="Velocity" unit={names.velocity} value={velocity} onChange={setVelocity} minimum={-names.holds.velocity} maximum={names.holds.velocity} />
      <NumberInput label="Acceleration" unit={names.acceleration} value={acceleration} onChange={setAcceleration} above={0} maximum={names.holds.acceleration} />
      <div className="buttons">
        <NumbersButton
          kind="main"
          title={reason}
          isDisabled={!isFree || !(acceleration > 0)}
          onPress={() => attempt(() => enableAnd(name, { do: 'velocity', units: names.units, velocity: names.speed(velocity), acceleration, deceleration: acceleration }))}
        >
          Run
        </NumbersButton>
        <HaltButton onHalt={() => attempt(() => runJob(name, { do: 'stop' }))}>Halt</HaltButton>
      </div>
      <Prediction names={names} velocity={velocity} acceleration={acceleration} />
      <p className="quiet note">Runs until it is halted. Watch the distance to the limit switches.</p>
    </div>
  );
}

function TorqueMove({ name, isFree, reason }: MoveProps) {
  const [percent, setPercent] = useState(5);
  return (
    <div className="form">
      <NumberInput label="Torque" unit="% of rated" value={percent} onChange={setPercent} minimum={-300} maximum={300} />
      <div className="buttons">
        <NumbersButton kind="main" title={reason} isDisabled={!isFree} onPress={() => attempt(() => enableAnd(name, { do: 'torque', percent }))}>Apply</NumbersButton>
        <HaltButton onHalt={() => attempt(() => runJob(name, { do: 'stop' }))}>Halt</HaltButton>
      </div>
      <p className="quiet note">Without an opposing load the axis accelerates until it is halted.</p>
    </div>
  );
}

function JogMove({ name, names, reason, enabled }: MoveProps & { enabled: boolean }) {
  const [velocity, setVelocity] = useNumber(60, names, 'velocity');
  const [acceleration, setAcceleration] = useNumber(20, names, 'acceleration');
  const right = useNumbersAreRight();
  const request = (sign: number) => ({ units: names.units, velocity: sign * names.speed(velocity), acceleration, deceleration: acceleration });
  const cannot = !enabled || !right || !(acceleration > 0);
  return (
    <div className="form">
      <NumberInput label="Velocity" unit={names.velocity} value={velocity} onChange={setVelocity} above={0} maximum={names.holds.velocity} />
      <NumberInput label="Acceleration" unit={names.acceleration} value={acceleration} onChange={setAcceleration} above={0} maximum={names.holds.acceleration} />
      <div className="buttons">
        <JogButton axis={name} velocity={request(-1)} isDisabled={cannot} title={reason} label="Jog in negative direction">◀ −</JogButton>
        <JogButton axis={name} velocity={request(1)} isDisabled={cannot} title={reason} label="Jog in positive direction">+ ▶</JogButton>
      </div>
      <Prediction names={names} velocity={velocity} acceleration={acceleration} />
      <p className="quiet note">{enabled ? 'Moves while the button is held: mouse, Space or Enter.' : reason || 'Enable the axis first.'}</p>
    </div>
  );
}

function HomeMove({ name, names, isFree, reason, axis, geometry, polarity }: MoveProps & { axis: AxisView; geometry: Geometry | undefined; polarity: unknown }) {
  const homingOf = useHoming(name, polarity);
  // The methods that the wiring permits come first.
  const reasonOf = (each: HomingMethod) => cannotHome(each, geometry, homingOf?.index_available);
  const methods = (homingOf?.methods ?? []).filter(({ supported }) => supported).sort((a, b) => Number(reasonOf(a) !== '') - Number(reasonOf(b) !== ''));
  const [chosen, setChosen] = useState<number | null>(null);
  const [fast, setFast] = useNumber(120, names, 'velocity');
  const [slow, setSlow] = useNumber(30, names, 'velocity');
  const [acceleration, setAcceleration] = useNumber(20, names, 'acceleration');
  const [start, setStart] = useState<number | null>(null);
  const method = methods.find((each) => each.method === chosen) ?? proposedMethod(methods, geometry, homingOf?.index_available);
  const job = useJob(name);
  const isOnBus = typeof useMissing('geometry') === 'string';
  const homing = job?.do === 'home' && job.state === 'running';
  const replay = useReplay(axis, homing);
  if (!method) return <p className="empty">{homingOf ? 'This drive supports no homing method.' : 'The methods are not known yet.'}</p>;
  return (
    <>
      <div className="form">
        <Choice label="Method" isLong value={method.method} options={methods.map((each) => [each.method, `${each.method}: ${textOf(each.legs)}`, reasonOf(each)] as const)} onChange={setChosen} />
        <NumberInput label="Speed during search for switch" unit={names.velocity} value={fast} onChange={setFast} above={0} maximum={names.holds.speed} />
        <NumberInput label="Speed during search for zero" unit={names.velocity} value={slow} onChange={setSlow} above={0} maximum={names.holds.speed} />
        <NumberInput label="Acceleration" unit={names.acceleration} value={acceleration} onChange={setAcceleration} above={0} maximum={names.holds.acceleration} />
        <div className="buttons">
          <NumbersButton
            kind="main"
            title={reason}
            isDisabled={!isFree || !(acceleration > 0)}
            onPress={() => {
              setStart(axis.position_counts);
              attempt(() => enableAnd(name, { do: 'home', units: names.units, method: method.method, speed: names.speed(fast), zero_speed: names.speed(slow), acceleration }));
            }}
          >
            Home
          </NumbersButton>
          <HaltButton onHalt={() => attempt(() => runJob(name, { do: 'stop' }))}>Halt</HaltButton>
          {geometry && replay.ready && <Button onPress={replay.playing ? replay.stop : replay.play}>{replay.playing ? 'Stop the replay' : 'Replay'}</Button>}
        </div>
      </div>
      <Prediction names={names} velocity={fast} acceleration={acceleration} />
      {(geometry ?? isOnBus) && <HomingFigure method={method} geometry={geometry} axis={replay.axis} start={homing && start !== null ? start : axis.homed && start !== null ? start : axis.position_counts} isReversed={isReversed(polarity)} />}
    </>
  );
}

function textOf(legs: HomingMethod['legs']): string {
  if (legs.length === 0) return 'at the present position';
  const last = legs[legs.length - 1];
  const first = legs[0];
  const to = last.until.replaceAll('_', ' ');
  return legs.length === 1 ? `${first.direction} to ${to}` : `${first.direction} to ${first.until.replaceAll('_', ' ')}, then ${to}`;
}
