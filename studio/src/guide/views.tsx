import { useEffect, useMemo, useState } from 'react';
import { get, post, put } from '../api/client';
import type { Inputs } from '../api/types';
import { axisPath } from '../commands';
import { namedOf } from '../model/objects';
import { isReversed } from '../model/plan';
import { attempt, complain } from '../notices';
import { ForceInput } from '../parts/force_input';
import { Button, Choice, Link, Scroll, Toggle } from '../parts/controls';
import { HomingFigure } from '../parts/homing_figure';
import { NumberInput } from '../parts/number_input';
import { StateChip } from '../parts/state';
import { useResource } from '../resource';
import { useAxis, useLine } from '../store';
import { machines, toUser, type Mechanics } from './mechanics';
import { Plot, type Line } from './plot';
import { figure } from './parts';
import { change, changeStep, type Found, type Guide, type StepState } from './state';
import { noteStored } from './actions';
import { namedInputs, noGains, reversedPolarity, wiredInputs } from './steps';
import { positionText, type Facts, type Numbers, type Step } from './step';

// The parts that only one step has; the table of steps names them (`view`).

export interface ViewProps {
  facts: Facts;
  step: Step;
  state: StepState;
  numbers: Numbers;
  guide: Guide;
}

interface Device { address: number; name: string; kind: string; product: string; axis: string | null }

// The devices that answer on a bus now. A device that is no axis yet becomes one when the studio is started again and
// finds it.
function BusScan({ bus }: { bus: string }) {
  const [found, setFound] = useState<Device[]>();
  const scan = () => attempt(async () => setFound((await post<{ found: Device[] }>(`/buses/${encodeURIComponent(bus)}/scan`, {})).found));
  return (
    <>
      <p><Button onPress={scan}>Scan {bus}</Button>{found && ` ${found.length} ${found.length === 1 ? 'device answers' : 'devices answer'}.`}</p>
      {found && found.length > 0 && (
        <Scroll label={`Devices on ${bus}`}>
          <table className="table" aria-label={`Devices on ${bus}`}>
            <thead><tr><th scope="col">node, position or station</th><th scope="col" className="wide">device</th><th scope="col" className="wide">axis</th></tr></thead>
            <tbody>
              {found.map(({ address, name, kind, product, axis }) => (
                <tr key={address}>
                  <th scope="row">{address}</th>
                  <td className="text">{[product || 'unknown product', name, kind].filter(Boolean).join(', ')}</td>
                  <td className="text">{axis ? <Link to={`/commission/${encodeURIComponent(axis)}`}>{axis}</Link> : 'none here: start the studio again to add it'}</td>
                </tr>
              ))}
            </tbody>
          </table>
        </Scroll>
      )}
    </>
  );
}

export function FindView({ facts }: ViewProps) {
  const order = useLine((line) => line.order);
  const axes = useLine((line) => line.axes);
  const kind = useLine(({ line }) => line?.kind);
  const buses = [...new Set(order.map((name) => axes[name].bus ?? axes[name].serial?.bus).filter((bus) => bus !== undefined && bus !== null))];
  return (
    <>
    <Scroll label="Drives">
      <table className="table" aria-label={kind === 'real' ? 'Drives that the studio found' : 'Drives of this line'}>
        <thead><tr><th scope="col">axis</th><th scope="col" className="wide">product</th><th scope="col" className="wide">bus</th><th scope="col" className="wide">node, position or station</th><th scope="col" className="wide">state</th></tr></thead>
        <tbody>
          {order.map((name) => {
            const each = axes[name];
            return (
              <tr key={name}>
                <th scope="row">{name === facts.axis.name ? <strong aria-current="true">{name}</strong> : <Link to={`/commission/${encodeURIComponent(name)}`}>{name}</Link>}</th>
                <td className="text">{each.product}</td>
                <td className="text">{each.bus ?? each.serial?.bus ?? '–'}</td>
                <td className="text">{each.node_id ?? each.position ?? each.serial?.station ?? '–'}</td>
                <td className="text"><StateChip axis={each} />{each.problem && ` ${each.problem.what}`}</td>
              </tr>
            );
          })}
        </tbody>
      </table>
    </Scroll>
      {buses.map((bus) => <BusScan key={bus} bus={bus} />)}
    </>
  );
}

export function IdentifyView({ facts, state, step }: ViewProps) {
  const { name, product } = facts.axis;
  return (
    <Toggle isSelected={state.found.agrees ?? false} onChange={(agrees) => changeStep(name, product, step.id, (now) => ({ ...now, found: { ...now.found, agrees } }))}>
      The values agree with the nameplate
    </Toggle>
  );
}

export function UnitsView({ facts, guide }: ViewProps) {
  const { mechanics, scale, units } = facts;
  const { name } = facts.axis;
  const set = (to: Partial<Mechanics>) => change(name, guide.product, (now) => ({ ...now, mechanics: { ...now.mechanics, ...to } }));
  const { machine } = mechanics;
  const unknown = units !== undefined && !units.position_per_revolution;
  return (
    <>
      <div className="form guide-form">
        <Choice label="Machine" value={machine} options={machines} onChange={(to) => set({ machine: to })} />
        {machine === 'spindle' && <NumberInput label="Lead of the spindle" unit="mm" value={mechanics.feed_mm} minimum={0.001} maximum={10000} onChange={(feed_mm) => set({ feed_mm })} />}
        {machine === 'belt' && <NumberInput label="Travel per turn of pulley or pinion" unit="mm" value={mechanics.feed_mm} minimum={0.001} maximum={10000} onChange={(feed_mm) => set({ feed_mm })} />}
        <NumberInput label="Gear: revolutions of the motor" value={mechanics.motor_turns} minimum={0.001} maximum={100000} onChange={(motor_turns) => set({ motor_turns })} />
        <NumberInput label="for revolutions of the load" value={mechanics.load_turns} minimum={0.001} maximum={100000} onChange={(load_turns) => set({ load_turns })} />
        {unknown && <NumberInput label="Units of 6064h per motor revolution" value={mechanics.units_per_turn ?? NaN} minimum={1} maximum={1e9} onChange={(units_per_turn) => set({ units_per_turn })} />}
      </div>
      {scale && (
        <p className="note" role="note">
          One revolution of the motor is {figure(scale.user.position, 4)} {scale.unit.position} and {figure(scale.drive.position, 0)} units of 6064h.
          At 100 rpm of the motor the machine runs at {figure(toUser(scale, 'velocity', 100 / 60), 3)} {scale.unit.velocity}.
        </p>
      )}
    </>
  );
}

const poll_ms = 250;

const isOn = (word: number, bit: number) => Math.floor(word / 2 ** bit) % 2 === 1;

// The levels of the drive's inputs by name, and at which levels each was seen while the step was open.
function useInputs({ facts, step }: ViewProps): Inputs {
  const { axis, isVirtual, entries } = facts;
  const path = axisPath(axis.name);
  // A drive on a bus shows its inputs in 60FDh only. It is read on its own, so often that a switch pressed by hand is seen.
  const forced = useResource<{ inputs: Inputs }>(isVirtual ? `${path}/inputs` : null, poll_ms).value?.inputs;
  const word = useResource<{ values: Facts['values'] }>(isVirtual || !entries.has('60FD:00') ? null : `${path}/values?objects=60FD:00`, poll_ms).value?.values['60FD:00'];
  const inputs = useMemo<Inputs>(
    () => forced ?? (typeof word === 'number' ? Object.fromEntries(namedOf(entries.get('60FD:00')?.bits).map(({ value: bit, name }) => [name, { level: isOn(word, bit), forced: false }])) : {}),
    [forced, word, entries],
  );
  useEffect(() => {
    const levels = Object.entries(inputs);
    if (levels.length === 0) return;
    changeStep(axis.name, axis.product, step.id, (state) => {
      const seen = { ...state.found.seen };
      let isNew = false;
      for (const [name, { level }] of levels) {
        const [low, high] = seen[name] ?? [false, false];
        if (level ? high : low) continue;
        seen[name] = [low || !level, high || level];
        isNew = true;
      }
      return isNew ? { ...state, found: { ...state.found, seen } } : state;
    });
  }, [inputs, axis.name, axis.product, step.id]);
  return inputs;
}

// The switches that are wired to an input of a simulated axis.
export const wiresOf = ({ geometry }: Facts, name: string) =>
  Object.entries(geometry?.inputs ?? {}).filter(([, wire]) => wire === name).map(([what]) => what.replaceAll('_', ' ')).join(', ');

export const releaseInputs = async (axis: string) => {
  const { inputs } = await get<{ inputs: Inputs }>(`${axisPath(axis)}/inputs`);
  const forced = Object.entries(inputs).filter(([, { forced: is }]) => is);
  if (forced.length > 0) await put(`${axisPath(axis)}/inputs`, Object.fromEntries(forced.map(([name]) => [name, null])));
};

export function InputsView(props: ViewProps) {
  const { facts, state, step } = props;
  const { axis, isVirtual, values } = facts;
  const inputs = useInputs(props);
  const force = (name: string, level: boolean | null) => attempt(() => put(`${axisPath(axis.name)}/inputs`, { [name]: level }));
  const word = values['60FD:00'];
  const bits = isVirtual ? namedInputs(facts) : []; // otherwise they are the rows of the table
  const wired = wiredInputs(facts, state);
  const { notWired = [] } = state.found;
  const setWired = (name: string, isWired: boolean) =>
    changeStep(axis.name, axis.product, step.id, (now) => ({ ...now, found: { ...now.found, notWired: [...(now.found.notWired ?? []).filter((each) => each !== name), ...(isWired ? [] : [name])] } }));
  const isForced = Object.values(inputs).some(({ forced }) => forced);
  return (
    <>
      {wired.length === 0 && isVirtual && <p className="note">No switch is wired to this drive: the inputs can be tried, and the step is complete without that.</p>}
      <Scroll label="Inputs">
        <table className="table" aria-label="Inputs of the drive">
          <thead><tr><th scope="col">input</th><th scope="col" className="wide">wired to</th><th scope="col">now</th><th scope="col">seen 0</th><th scope="col">seen 1</th>{isVirtual && <th scope="col">force</th>}</tr></thead>
          <tbody>
            {Object.entries(inputs).map(([name, { level, forced }]) => (
              <tr key={name}>
                <th scope="row">{name}</th>
                <td className="text">
                  {isVirtual ? wiresOf(facts, name) : <Toggle isSelected={notWired.includes(name)} onChange={(isNot) => setWired(name, !isNot)}><span className="unseen">{name}: </span>not wired</Toggle>}
                </td>
                <td><span className={level ? 'lamp on' : 'lamp'} role="img" aria-label={level ? 'on' : 'off'} /></td>
                <td>{state.found.seen?.[name]?.[0] ? '✓' : '–'}</td>
                <td>{state.found.seen?.[name]?.[1] ? '✓' : '–'}</td>
                {isVirtual && (
                  <td>
                    <ForceInput input={name} level={level} forced={forced} onForce={force} />
                  </td>
                )}
              </tr>
            ))}
          </tbody>
        </table>
      </Scroll>
      {isForced && (
        <p className="warning" role="note">
          Forced inputs hide the machine's switches. <Button onPress={() => attempt(() => releaseInputs(axis.name))}>Release all inputs</Button>
        </p>
      )}
      {typeof word === 'number' && bits.length > 0 && (
        <h3 className="guide-bits">The drive's own view (60FDh)</h3>
      )}
      {typeof word === 'number' && bits.length > 0 && (
        <ul className="bit-list terminals" aria-label="The drive's digital inputs (60FDh)">
          {bits.map(({ value: bit, name }) => {
            const on = isOn(word, bit);
            return <li key={bit}><span className={on ? 'lamp on' : 'lamp'} role="img" aria-label={on ? 'on' : 'off'} /> {name}</li>;
          })}
        </ul>
      )}
    </>
  );
}

export function DirectionView({ facts, state, step }: ViewProps) {
  const { axis } = facts;
  const { moved, way } = state.found;
  if (!moved) return null;
  const say = (way: 'right' | 'wrong') => {
    const polarity = way === 'wrong' ? reversedPolarity(facts) : undefined;
    changeStep(axis.name, axis.product, step.id, (now) => ({ ...now, found: { ...now.found, way }, typed: { ...now.typed, ...(polarity === undefined ? {} : { polarity }) } }));
  };
  return (
    <>
      <dl className="readouts" aria-label="The small move">
        <div className="readout"><dt>commanded</dt><dd>{positionText(facts, moved.asked)}</dd></div>
        <div className="readout"><dt>6064h moved by</dt><dd>{positionText(facts, moved.drive)}</dd></div>
        {moved.shaft !== null && <div className="readout"><dt>true shaft moved by</dt><dd>{positionText(facts, moved.shaft)}</dd></div>}
      </dl>
      <div className="buttons" role="group" aria-label="Which way did the machine move?">
        <span>Which way did the machine move?</span>
        <Button kind={way === 'right' ? 'main' : 'plain'} aria-pressed={way === 'right'} onPress={() => say('right')}>The right way</Button>
        <Button kind={way === 'wrong' ? 'main' : 'plain'} aria-pressed={way === 'wrong'} onPress={() => say('wrong')}>The wrong way</Button>
      </div>
      {way === 'wrong' && !facts.entries.has('607E:00') && (
        <p className="note">{axis.product} has no object 607Eh (polarity): reverse the direction in the master's program or in the drive's own parameters.</p>
      )}
    </>
  );
}

// The plots of a measurement: a target is in the plot of its response, before and after are in one plot.
function plotsOf({ first, last }: Found): { name: string; lines: Line[] }[] {
  const now = last ?? first;
  if (!now) return [];
  const line = (measured: typeof now, i: number, look: Line['look'], text: string): Line => ({ ...measured.curves[i], name: `${measured.curves[i].name}${text}`, x: measured.x, look });
  const isTarget = (i: number) => now.curves[i].name === 'target';
  return now.curves.flatMap(({ name }, i) => {
    if (isTarget(i)) return [];
    const target = now.curves.findIndex((other, k) => isTarget(k) && other.unit === now.curves[i].unit);
    const before = last && first && i in first.curves ? [line(first, i, 'faint', ' before')] : [];
    return [{ name, lines: [line(now, i, 'one', last ? ' after' : ''), ...before, ...(target < 0 ? [] : [line(now, target, 'two', '')])] }];
  });
}

export const Plots = ({ title, found }: { title: string; found: Found }) =>
  plotsOf(found).map(({ name, lines }) => <Plot key={name} title={`${title}: ${name}`} lines={lines} xUnit="ms" />);

export function Figures({ facts, found, inReport = false }: { facts: Facts; found: Found; inReport?: boolean }) {
  const { first, last, loop, loopLast, proposed } = found;
  const unit = facts.scale?.unit;
  const rows: [string, string, number, number | null | undefined, number | null | undefined, number | null | undefined][] = [
    ['Rise time, 10 to 90 %', 'ms', 2, first?.rise_ms, undefined, last?.rise_ms],
    ['Settling time to 2 %', 'ms', 2, first?.settling_ms, undefined, last?.settling_ms],
    ['Overshoot', '%', 1, first?.overshoot_percent, undefined, last?.overshoot_percent],
    ['Greatest following error', unit?.position ?? '', 5, first?.greatest_error, undefined, last?.greatest_error],
    ['Peak velocity', unit?.velocity ?? '', 1, first?.peak_velocity, undefined, last?.peak_velocity],
    ['Bandwidth, closed loop, -3 dB', 'Hz', 1, loop?.bandwidth_hz, proposed?.bandwidth_hz, loopLast?.bandwidth_hz],
    ['Phase margin', '°', 0, loop?.phase_margin_deg, proposed?.phase_margin_deg, loopLast?.phase_margin_deg],
  ];
  const shown = rows.filter(([, , , ...values]) => values.some((value) => typeof value === 'number'));
  if (shown.length === 0) return null;
  const table = (
    <table className="table" aria-label="Measured, before and after">
      <thead><tr><th scope="col" className="wide">measured</th><th scope="col">before</th><th scope="col">predicted</th><th scope="col">after</th><th scope="col" className="wide">unit</th></tr></thead>
      <tbody>
        {shown.map(([label, text, digits, before, predicted, after]) => (
          <tr key={label}><th scope="row">{label}</th><td className="figure">{figure(before, digits)}</td><td className="figure">{figure(predicted, digits)}</td><td className="figure">{figure(after, digits)}</td><td className="text">{text}</td></tr>
        ))}
      </tbody>
    </table>
  );
  return inReport ? table : <Scroll label="Measured, before and after">{table}</Scroll>; // the report wraps its texts, also in its file
}

const startAgain = ({ axis }: Facts, step: Step) =>
  changeStep(axis.name, axis.product, step.id, (now) => ({ ...now, found: {} }));

export function ResponseView({ facts, state, step }: ViewProps) {
  const { found } = state;
  if (!found.first && !found.loop) return null;
  return (
    <div className="guide-found">
      <Figures facts={facts} found={found} />
      {found.loop && <p className="note">Measured inertia {found.loop.inertia}, friction {found.loop.friction}{found.loop.resonance_hz ? `, resonance ${figure(found.loop.resonance_hz, 0)} Hz` : ''}.</p>}
      <Plots title={step.title} found={found} />
      <div className="buttons"><Button kind="bare" onPress={() => startAgain(facts, step)}>Forget these measurements</Button></div>
    </div>
  );
}

export function LoopView(props: ViewProps) {
  const none = noGains(props.facts);
  const { loop, loopLast, proposed } = props.state.found;
  const missed = proposed?.bandwidth_hz && loopLast?.bandwidth_hz && Math.abs(loopLast.bandwidth_hz / proposed.bandwidth_hz - 1) > 0.15;
  const lowMargin = loopLast?.phase_margin_deg && loopLast.phase_margin_deg < 40;
  return (
    <>
      {none && <p className="note">{none}</p>}
      {loop && proposed && !loopLast && <p className="note">The proposed gains are in the form: write them, then measure the step and the loop again.</p>}
      {(missed || lowMargin) && <p className="trouble" role="alert">The new gains do not give what was predicted: undo this step, or choose a lower target bandwidth.</p>}
      <ResponseView {...props} />
    </>
  );
}

export function HomingView({ facts, numbers, guide }: ViewProps) {
  const { geometry, homing } = facts;
  const axis = useAxis(facts.axis.name) ?? facts.axis;
  const method = homing?.methods.find((each) => each.method === numbers('method'));
  if (!method) return null;
  if (facts.isVirtual && !geometry) return null;
  // From the start of the last homing if the guide has moved the axis no further since then, otherwise from the present position.
  const { run } = guide;
  const began = run?.step === 'homing' && run.values.method === method.method && run.from.shaft !== null ? run.from.shaft * (geometry?.index_every ?? 0) : null;
  return <HomingFigure method={method} geometry={geometry} axis={axis} start={began ?? axis.position_counts} isReversed={isReversed(facts.polarity)} />;
}

interface Stored {
  stored: boolean;
  keeps_at_once: boolean;
  lost_with_power: { object: string; name: string }[];
}

export function StoreView({ facts, state, step }: ViewProps) {
  const { axis } = facts;
  const [busy, setBusy] = useState(false);
  const [sure, setSure] = useState(false);
  const store = () => {
    setBusy(true);
    void post<Stored>(`${axisPath(axis.name)}/parameters/store`)
      .then(async ({ stored, keeps_at_once, lost_with_power }) => {
        if (stored || keeps_at_once) await noteStored(axis);
        changeStep(axis.name, axis.product, step.id, (now) => ({ ...now, found: { ...now.found, stored: { stored: stored || keeps_at_once, lost: lost_with_power.map(({ object, name }) => `${object} ${name}`) } } }));
      })
      .catch(complain)
      .finally(() => setBusy(false));
  };
  const { stored } = state.found;
  return (
    <>
      <p className="note">
        The command "store all parameters" is 65766173h ("save") at 1010h sub-index 1, or the drive's own command. It stores every value in the drive, also those that others have written.
      </p>
      <Toggle isSelected={sure} onChange={setSure}>Store the present values of the drive</Toggle>
      <div className="buttons"><Button kind="main" isDisabled={busy || !sure || !axis.powered || axis.state === 'operation enabled'} onPress={store}>Store in the drive</Button>
        {axis.state === 'operation enabled' && <span className="quiet">Disable the axis first.</span>}
      </div>
      {stored && (
        <p className="note" role="status">
          {stored.stored ? 'The drive has stored its parameters.' : 'The drive has no store command.'}
          {stored.lost.length > 0 && ` It cannot store these changed values, they are lost at power-off: ${stored.lost.join(', ')}.`}
        </p>
      )}
    </>
  );
}
