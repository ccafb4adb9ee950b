import { memo, useState } from 'react';
import type { AxisView, BusView, Geometry, Words } from '../api/types';
import { axisPath, power, runJob } from '../commands';
import { AxisRows } from '../parts/axis_rows';
import { Button, Choice, HaltButton, Link, Panel, Readout, Scroll, Search } from '../parts/controls';
import { Gantry } from '../parts/gantry';
import { Dial, Legend } from '../parts/mechanism';
import { StateChip } from '../parts/state';
import { Travel, useGeometry } from '../parts/travel';
import { hex, isFault, manufacturerSpecific, modeSpecific, modeText, statusBits } from '../model/cia402';
import { coupledWith, describe, filterOf, fitting, manyAxes, pairsOf, stateFilters, type StateFilter } from '../model/machine';
import { hasPowerStage } from '../model/motion_objects';
import { fixed } from '../model/units';
import { attempt } from '../notices';
import { useResource } from '../resource';
import { keep, useRoute } from '../route';
import { useAxis, useLine } from '../store';
import '../line.css';

export function LinePage() {
  const { query } = useRoute();
  const order = useLine((line) => line.order);
  const filter = filterOf(query);
  // The names are joined to one text, so that a message that changes no name causes no rendering of the page.
  const names = useLine((line) => fitting(line.order, line.axes, filter).join('\n')).split('\n').filter(Boolean);
  const pairs = useLine((line) => pairsOf(line.order, line.axes).map((pair) => pair.join('\n')).join('\n\n')).split('\n\n').filter(Boolean).map((pair) => pair.split('\n'));
  const isLarge = order.length >= manyAxes;
  const view = query.get('view') ?? (isLarge ? 'rows' : 'cards');
  // If the command of one axis fails, the others still get theirs.
  const all = (request: string) => () => void Promise.all(order.map((name) => runJob(name, { do: request })));
  return (
    <>
      <div className="line-tools">
        <div className="buttons" role="group" aria-label="All axes">
          <Button onPress={all('enable')}>Enable all</Button>
          <HaltButton onHalt={all('stop')}>Halt all</HaltButton>
          <HaltButton onHalt={all('disable')}>Disable all</HaltButton>
        </div>
        <div className="toolbar">
          {isLarge && <Filters shown={names.length} all={order.length} />}
          <div className="segments" role="group" aria-label="View">
            {views.map(([id, text]) => <button key={id} type="button" aria-pressed={view === id} onClick={() => keep({ view: id })}>{text}</button>)}
          </div>
          <Legend />
        </div>
      </div>
      {pairs.filter((pair) => pair.some((name) => names.includes(name))).map(([first, second]) => <Gantry key={first} first={first} second={second} />)}
      {view === 'rows' ? (
        <AxisRows names={names} />
      ) : (
        <div className="cards">
          {names.map((name) => (
            <AxisCard key={name} name={name} />
          ))}
        </div>
      )}
      <Buses />
    </>
  );
}

const views = [['cards', 'Cards'], ['rows', 'Rows']] as const;

function Filters({ shown, all }: { shown: number; all: number }) {
  const { query } = useRoute();
  const { text, state, bus } = filterOf(query);
  const buses = useLine(({ line }) => line?.buses);
  return (
    <>
      <Search label="Axis, product or bus" value={text} onChange={(q) => keep({ q })} />
      <Choice<StateFilter> label="State" hideLabel value={state} options={stateFilters} onChange={(to) => keep({ state: to })} />
      <Choice label="Bus" hideLabel value={bus} options={[['', 'Any bus'] as const, ...(buses ?? []).map((each) => [each, each] as const)]} onChange={(to) => keep({ bus: to })} />
      <span className="quiet" role="status">{shown} of {all} axes</span>
    </>
  );
}

// In revolutions of the motor if the encoder's counts per revolution are known.
export function positionOf(axis: AxisView, geometry: Geometry | undefined): { value: string; unit: string } {
  const counts = geometry?.index_every ?? geometry?.mechanics?.counts_per_revolution;
  return counts ? { value: fixed(axis.position_counts / counts, 3), unit: 'rev' } : { value: fixed(axis.position_counts, 0), unit: unitOf(axis) };
}

// The value of a drive on a bus is that of its object.
export const usePositionLabel = () => useLine(({ line }) => (line?.kind === 'real' ? 'position (6064h)' : 'true position'));

export const useWords = (axis: string) => useResource<Words>(`${axisPath(axis)}/words`).value;

const isNamed = (text: string) => text !== manufacturerSpecific && text !== modeSpecific;

const address = (axis: AxisView) =>
  [
    axis.bus,
    axis.node_id !== undefined && `node ${axis.node_id}`,
    axis.position !== undefined && `position ${axis.position}`,
    axis.serial && `${axis.serial.bus} station ${axis.serial.station}`,
  ].filter(Boolean).join(' · ');

const AxisCard = memo(function AxisCard({ name }: { name: string }) {
  const axis = useAxis(name);
  const geometry = useGeometry(name);
  const job = useLine((line) => line.jobs[name]);
  const words = useWords(name);
  const positionLabel = usePositionLabel();
  if (!axis) return null;
  const faults = axis.faults ?? [];
  const set = statusBits(axis.statusword ?? 0, axis.mode, words).filter(({ on, name: text }) => on && isNamed(text));
  return (
    <article className="panel card" aria-label={name}>
      <header>
        <h2>
          <Link to={`/axis/${encodeURIComponent(name)}`}>{name}</Link>
        </h2>
        <span className="quiet">{axis.product}</span>
        <StateChip axis={axis} />
      </header>
      <div className="mechanism">
        <Dial axis={axis} geometry={geometry} />
        <Travel axis={axis} geometry={geometry} />
      </div>
      <dl className="readouts">
        <Readout label={positionLabel} title={`${fixed(axis.position_counts, 0)} ${unitOf(axis)}`} {...positionOf(axis, geometry)} />
        <Speed axis={axis} />
        <Torque axis={axis} />
        {axis.current_a !== null && <Readout label="current" value={fixed(axis.current_a, 2)} unit="A" />}
        {axis.temperature_c !== null && <Readout label="winding" value={fixed(axis.temperature_c, 1)} unit="°C" />}
        {axis.supply_v !== null && <Readout label="supply" value={fixed(axis.supply_v, 1)} unit="V" />}
      </dl>
      <div className="said">
        <p className="bits" title={`statusword ${hex(axis.statusword ?? 0, 4)}`}>
          {axis.powered && <span className="chip plain">{modeText(axis.mode, words)}</span>}
          {axis.homed && <span className="chip plain">homed</span>}
          {set.map(({ bit, name: text }) => (
            <span key={bit} className={text === 'fault' ? 'bit bad' : text === 'warning' ? 'bit warn' : 'bit'}>{text}</span>
          ))}
        </p>
        {faults.length > 0 && (
          <p className="fault">
            <Link to={`/faults/${encodeURIComponent(name)}`}>
              {faults.map(({ code, name: text }) => `${code.replace('0x', '')}h ${text}`).join('; ')}
            </Link>
          </p>
        )}
      </div>
      <footer>
        <span className="quiet address">{address(axis)}{geometry?.mechanics && ` · ${[describe(geometry.mechanics), coupledWith(axis)].filter(Boolean).join(', ')}`}</span>
        {job?.state === 'running' && <span className="busy">{job.do.replaceAll('_', ' ')}</span>}
        <Commands axis={axis} />
      </footer>
    </article>
  );
});

// For a simulated axis these show the true shaft; for a drive on a bus the values of its objects, in its own units.
export const unitOf = (axis: AxisView) => (axis.velocity === undefined ? 'counts' : 'units');

export const Speed = ({ axis }: { axis: AxisView }) =>
  axis.velocity === undefined
    ? <Readout label="velocity" value={fixed(axis.velocity_rpm, 1)} unit="rpm" />
    : <Readout label="velocity" value={fixed(axis.velocity, 0)} unit="units/s" />;

export const Torque = ({ axis }: { axis: AxisView }) =>
  axis.torque_percent === undefined
    ? <Readout label="torque" value={fixed(axis.torque_nm, 3)} unit="Nm" />
    : <Readout label="torque" value={fixed(axis.torque_percent, 1)} unit="% of rated" />;

// The button shows at once that it was pressed: a drive may need some time to reset its fault.
export function ClearFault({ name }: { name: string }) {
  const [busy, setBusy] = useState(false);
  const press = () => {
    setBusy(true);
    void runJob(name, { do: 'reset_fault' }).finally(() => setBusy(false));
  };
  return <Button kind="main" isDisabled={busy} onPress={press}>{busy ? 'Clearing' : 'Clear fault'}</Button>;
}

// The usual commands that the axis's state permits.
export function Commands({ axis }: { axis: AxisView }) {
  const { name, state } = axis;
  if (axis.problem) return null; // the state says it
  if (!axis.powered) return <Button onPress={() => attempt(() => power(name, 'on'))}>Power on</Button>;
  if (isFault(state)) return <ClearFault name={name} />;
  if (state === 'operation enabled' || state === 'quick stop active') {
    return (
      <>
        <HaltButton onHalt={() => void runJob(name, { do: 'stop' })}>Halt</HaltButton>
        <HaltButton onHalt={() => void runJob(name, { do: 'disable' })}>Disable</HaltButton>
      </>
    );
  }
  return (
    <>
      <Button onPress={() => void runJob(name, { do: 'enable' })}>Enable</Button>
      {hasPowerStage(state) && <HaltButton onHalt={() => void runJob(name, { do: 'disable' })}>Disable</HaltButton>}
    </>
  );
}

// A bus of drives on real buses counts accesses to objects in place of frames.
function Buses() {
  const isReal = useLine(({ line }) => line?.kind === 'real');
  const buses = useResource<{ buses: BusView[] }>('/buses', 1000).value?.buses ?? [];
  const count = (bus: BusView, keys: string[]) => fixed(keys.reduce((sum, key) => sum + (Number(bus[key]) || 0), 0), 0);
  return (
    <Panel title="Buses" aside={<Link to="/bus">links and axes</Link>}>
      <Scroll label="Table of buses">
        <table className="table">
          <thead>
            <tr>
              <th scope="col">bus</th><th scope="col" className="wide">kind</th><th scope="col">kbit/s</th><th scope="col">load</th>
              <th scope="col">{isReal ? 'accesses' : 'frames'}</th><th scope="col">errors</th><th scope="col">lost</th><th scope="col">clients</th>
            </tr>
          </thead>
          <tbody>
            {buses.map((bus) => (
              <tr key={bus.name}>
                <th scope="row">{bus.name}</th>
                <td className="text">{{ can: 'CAN', ethercat: 'EtherCAT', rs485: 'RS485' }[bus.type]}</td>
                <td>{bus.bit_rate ? fixed(bus.bit_rate / 1000, bus.bit_rate % 1000 ? 1 : 0) : bus.type === 'ethercat' ? '100\u2009000' : '–'}</td>
                <td>{bus.load_percent === undefined ? '–' : <Load percent={bus.load_percent} />}</td>
                <td>{count(bus, ['frames', 'characters'])}</td>
                <td className={['errors', 'malformed', 'collisions'].some((key) => bus[key]) ? 'bad' : ''}>{count(bus, ['errors', 'malformed', 'collisions'])}</td>
                <td>{count(bus, ['dropped', 'lost', 'disturbed'])}</td>
                <td>{bus.links.reduce((sum, { clients }) => sum + clients, 0)}</td>
              </tr>
            ))}
          </tbody>
        </table>
      </Scroll>
    </Panel>
  );
}

export function Load({ percent }: { percent: number }) {
  return (
    <span className="load">
      <meter min={0} max={100} high={80} value={percent} aria-label="bus load">{fixed(percent, 1)} %</meter>
      {fixed(percent, 1)} %
    </span>
  );
}
