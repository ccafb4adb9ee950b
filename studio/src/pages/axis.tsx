import { useState } from 'react';
import { Tab, TabList, TabPanel, Tabs } from 'react-aria-components';
import type { AxisView, Geometry, HomingMethod, StatesView, Units } from '../api/types';
import { axisPath, cancelJob, power, runJob, writeObject } from '../commands';
import { AxisTabs, usePageAxis } from '../parts/axis_tabs';
import { Button, Choice, NumberInput, Panel, Readout } from '../parts/controls';
import { Front } from '../parts/front';
import { HomingFigure } from '../parts/homing_figure';
import { useReplay } from '../replay';
import { JogButton } from '../parts/jog';
import { LiveLanes } from '../parts/live';
import { StateChip } from '../parts/state';
import { StateDiagram } from '../parts/state_diagram';
import { useTarget } from '../parts/target';
import { Travel, useGeometry } from '../parts/travel';
import { Word } from '../parts/word';
import { controlBits, modeText, statusBits } from '../model/cia402';
import { fixed, fromDrivePosition } from '../model/units';
import { attempt } from '../notices';
import { useResource } from '../resource';
import { keep, useRoute } from '../route';
import { useAxis, useLine, useMissing } from '../store';
import { Commands, Speed, Torque, unitOf } from './line';

export function AxisPage() {
  const name = usePageAxis(useRoute().name);
  const axis = useAxis(name);
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
              <Word name="Controlword" value={axis.controlword} bits={controlBits(axis.controlword ?? 0, axis.mode)} />
              <Word name="Statusword" value={axis.statusword} bits={statusBits(axis.statusword ?? 0, axis.mode)} />
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
  // What a master may ask for depends on the state alone: asked again when it changes.
  const { value } = useResource<StatesView>(powered ? `${axisPath(name)}/states?now=${encodeURIComponent(state ?? '')}` : null);
  const transitions = value && value.state === state ? value.transitions : [];
  const missing = useMissing('power');
  return (
    <Panel title="State machine" aside={<StateChip state={state} powered={powered} />}>
      <StateDiagram state={powered ? state : undefined} transitions={transitions} />
      <div className="buttons" role="group" aria-label="Transitions allowed now">
        {transitions.map(({ number, name: command, to, controlword }) => (
          <Button
            key={number}
            onPress={() => attempt(() => (command.includes('reset') ? runJob(name, { do: 'reset_fault' }) : writeObject(name, 0x6040, 0, controlword)))}
          >
            <span className="quiet">{number}</span> {command} <span className="quiet">→ {to}</span>
          </Button>
        ))}
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
    <Panel title="Last ten seconds" aside={<Button kind="bare" onPress={() => setRunning(!running)}>{running ? 'Pause' : 'Go on'}</Button>}>
      {powered && isReal !== undefined ? (
        <LiveLanes
          label="Live curves"
          channels={[{ axis: name, signal: 'position_counts' }, { axis: name, signal: isReal ? 'velocity' : 'velocity_rpm' }, { axis: name, signal: 'following_error' }]}
          rate_hz={100}
          seconds={10}
          running={running}
          laneHeight={96}
        />
      ) : (
        <p className="empty">{isReal ? 'The drive does not answer.' : 'No power.'}</p>
      )}
    </Panel>
  );
}

const kinds = [['position', 'Position'], ['velocity', 'Velocity'], ['torque', 'Torque'], ['jog', 'Jog'], ['home', 'Homing']] as const;

function Motion({ axis }: { axis: AxisView }) {
  const { name } = axis;
  const kind = useRoute().query.get('do') ?? 'position';
  const geometry = useGeometry(name);
  const units = useResource<Units>(axis.powered ? `${axisPath(name)}/units` : null).value;
  const job = useLine((line) => line.jobs[name]);
  const target = useTarget(axis, geometry);
  const turns = geometry?.index_every ? axis.position_counts / geometry.index_every : axis.velocity === undefined ? null : fromDrivePosition(units, axis.position_counts);
  const enabled = axis.powered && axis.state === 'operation enabled';
  return (
    <Panel title="Motion" aside={<span className="quiet">{axis.product}, {axis.mode === 0 ? 'no mode' : modeText(axis.mode)}</span>}>
      <Travel axis={axis} geometry={geometry} target={target} />
      <dl className="readouts">
        <Readout label="position" {...(turns === null ? { value: fixed(axis.position_counts, 0), unit: unitOf(axis) } : { value: fixed(turns, 4), unit: 'rev' })} title={`${axis.position_counts} counts`} />
        <Speed axis={axis} />
        <Torque axis={axis} />
        {axis.current_a !== null && <Readout label="current" value={fixed(axis.current_a, 2)} unit="A" />}
      </dl>
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
        <TabPanel id="position"><PositionMove name={name} units={units} /></TabPanel>
        <TabPanel id="velocity"><VelocityMove name={name} units={units} /></TabPanel>
        <TabPanel id="torque"><TorqueMove name={name} /></TabPanel>
        <TabPanel id="jog"><JogMove name={name} units={units} enabled={enabled} /></TabPanel>
        <TabPanel id="home"><HomeMove axis={axis} units={units} geometry={geometry} /></TabPanel>
      </Tabs>
    </Panel>
  );
}

function JobLine({ job, units }: { job: ReturnType<typeof useJob>; units: Units | undefined }) {
  if (!job) return null;
  const position = job.result?.position;
  const at = position === undefined ? null : job.units === 'revolutions' ? position : fromDrivePosition(units, position);
  return (
    <p className={`job ${job.state}`} role="status">
      {job.do}: {job.state}
      {at !== null && ` at ${fixed(at, 4)} rev`}
      {job.result?.seconds !== undefined && ` after ${fixed(job.result.seconds, 2)} s`}
      {job.error && ` · ${job.error.what}`}
      {job.state === 'running' && <Button kind="bare" onPress={() => attempt(() => cancelJob(job))}>Cancel</Button>}
    </p>
  );
}

const useJob = (name: string) => useLine((line) => (line.jobs[name] as (typeof line.jobs)[string] | undefined));

// Revolutions, rpm and revolutions per s^2 where the drive's units are known, else its own units.
interface UnitNames {
  units: 'revolutions' | 'drive';
  position: string;
  velocity: string;
  acceleration: string;
  speed: (value: number) => number; // of what was typed, as the job wants it
}

function namesOf(units: Units | undefined): UnitNames {
  const known = units?.position_per_revolution && units.velocity_per_rps && units.acceleration_per_rps2;
  return known
    ? { units: 'revolutions', position: 'rev', velocity: 'rpm', acceleration: 'rev/s²', speed: (rpm) => rpm / 60 }
    : { units: 'drive', position: 'units', velocity: 'units', acceleration: 'units', speed: (value) => value };
}

interface MoveProps {
  name: string;
  units: Units | undefined;
}

async function enableAnd(name: string, request: { do: string } & Record<string, unknown>) {
  const enabled = await runJob(name, { do: 'enable' });
  if (enabled?.state === 'done') await runJob(name, request);
}

function PositionMove({ name, units }: MoveProps) {
  const [how, setHow] = useState<'by' | 'to'>('by');
  const [distance, setDistance] = useState(1);
  const [velocity, setVelocity] = useState(300);
  const [acceleration, setAcceleration] = useState(50);
  const names = namesOf(units);
  const start = (sign: number) =>
    attempt(() =>
      enableAnd(name, {
        do: 'move', units: names.units, [how]: sign * distance, velocity: names.speed(velocity), acceleration, deceleration: acceleration,
      }),
    );
  return (
    <div className="form">
      <Choice label="Move" value={how} options={[['by', 'by a distance'], ['to', 'to a position']]} onChange={setHow} />
      <NumberInput label={how === 'by' ? 'Distance' : 'Position'} unit={names.position} value={distance} onChange={setDistance} />
      <NumberInput label="Velocity" unit={names.velocity} value={velocity} onChange={setVelocity} minimum={0} />
      <NumberInput label="Acceleration" unit={names.acceleration} value={acceleration} onChange={setAcceleration} minimum={0} />
      <div className="buttons">
        {how === 'by' && <Button onPress={() => start(-1)}>− Back</Button>}
        <Button kind="main" onPress={() => start(1)}>{how === 'by' ? 'Move +' : 'Move'}</Button>
      </div>
    </div>
  );
}

function VelocityMove({ name, units }: MoveProps) {
  const [velocity, setVelocity] = useState(120);
  const [acceleration, setAcceleration] = useState(20);
  const names = namesOf(units);
  return (
    <div className="form">
      <NumberInput label="Velocity" unit={names.velocity} value={velocity} onChange={setVelocity} />
      <NumberInput label="Acceleration" unit={names.acceleration} value={acceleration} onChange={setAcceleration} minimum={0} />
      <div className="buttons">
        <Button kind="main" onPress={() => attempt(() => enableAnd(name, { do: 'velocity', units: names.units, velocity: names.speed(velocity), acceleration, deceleration: acceleration }))}>Run</Button>
        <Button onPress={() => attempt(() => runJob(name, { do: 'stop' }))}>Halt</Button>
      </div>
      <p className="quiet note">Runs until it is halted: mind the limit switches.</p>
    </div>
  );
}

function TorqueMove({ name }: { name: string }) {
  const [percent, setPercent] = useState(5);
  return (
    <div className="form">
      <NumberInput label="Torque" unit="% of rated" value={percent} onChange={setPercent} minimum={-300} maximum={300} />
      <div className="buttons">
        <Button kind="main" onPress={() => attempt(() => enableAnd(name, { do: 'torque', percent }))}>Apply</Button>
        <Button onPress={() => attempt(() => runJob(name, { do: 'stop' }))}>Halt</Button>
      </div>
      <p className="quiet note">With no load against it the axis accelerates until it is halted.</p>
    </div>
  );
}

function JogMove({ name, units, enabled }: MoveProps & { enabled: boolean }) {
  const [velocity, setVelocity] = useState(60);
  const names = namesOf(units);
  const request = (sign: number) => ({ units: names.units, velocity: sign * names.speed(velocity) });
  return (
    <div className="form">
      <NumberInput label="Velocity" unit={names.velocity} value={velocity} onChange={setVelocity} minimum={0} />
      <div className="buttons">
        <JogButton axis={name} velocity={request(-1)} isDisabled={!enabled} label="Jog in negative direction">◀ −</JogButton>
        <JogButton axis={name} velocity={request(1)} isDisabled={!enabled} label="Jog in positive direction">+ ▶</JogButton>
      </div>
      <p className="quiet note">{enabled ? 'Moves while it is pressed: pointer, space or enter.' : 'Enable the axis first.'}</p>
    </div>
  );
}

function HomeMove({ axis, units, geometry }: { axis: AxisView; units: Units | undefined; geometry: Geometry | undefined }) {
  const { name } = axis;
  const methods = (useResource<{ methods: HomingMethod[] }>(`${axisPath(name)}/homing`).value?.methods ?? []).filter(({ supported }) => supported);
  const [chosen, setChosen] = useState<number | null>(null);
  const [fast, setFast] = useState(120);
  const [slow, setSlow] = useState(30);
  const [acceleration, setAcceleration] = useState(20);
  const [start, setStart] = useState<number | null>(null);
  const names = namesOf(units);
  const method = methods.find((each) => each.method === (chosen ?? 7)) ?? methods.find(({ legs }) => legs.length > 0) ?? methods[0];
  const job = useJob(name);
  const homing = job?.do === 'home' && job.state === 'running';
  const replay = useReplay(axis, homing);
  if (!method) return <p className="empty">This drive has no homing methods.</p>;
  return (
    <>
      <div className="form">
        <Choice label="Method" isLong value={method.method} options={methods.map(({ method: number, legs }) => [number, `${number}: ${textOf(legs)}`] as const)} onChange={setChosen} />
        <NumberInput label="Speed to the switch" unit={names.velocity} value={fast} onChange={setFast} minimum={0} />
        <NumberInput label="Speed to the zero" unit={names.velocity} value={slow} onChange={setSlow} minimum={0} />
        <NumberInput label="Acceleration" unit={names.acceleration} value={acceleration} onChange={setAcceleration} minimum={0} />
        <div className="buttons">
          <Button
            kind="main"
            isDisabled={homing}
            onPress={() => {
              setStart(axis.position_counts);
              attempt(() => enableAnd(name, { do: 'home', units: names.units, method: method.method, speed: names.speed(fast), zero_speed: names.speed(slow), acceleration }));
            }}
          >
            Home
          </Button>
          <Button onPress={() => attempt(() => runJob(name, { do: 'stop' }))}>Halt</Button>
          {geometry && replay.ready && <Button onPress={replay.playing ? replay.stop : replay.play}>{replay.playing ? 'End the replay' : 'Replay'}</Button>}
        </div>
      </div>
      {geometry && <HomingFigure method={method} geometry={geometry} axis={replay.axis} start={homing && start !== null ? start : axis.homed && start !== null ? start : axis.position_counts} />}
    </>
  );
}

function textOf(legs: HomingMethod['legs']): string {
  if (legs.length === 0) return 'here';
  const last = legs[legs.length - 1];
  const first = legs[0];
  const to = last.until.replaceAll('_', ' ');
  return legs.length === 1 ? `${first.direction} to ${to}` : `${first.direction} to ${first.until.replaceAll('_', ' ')}, then ${to}`;
}
