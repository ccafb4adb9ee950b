import { useState } from 'react';
import { put, post, remove } from '../api/client';
import type { BusView, FaultList, Inputs, Plant } from '../api/types';
import { axisPath, power } from '../commands';
import { AxisTabs, usePageAxis } from '../parts/axis_tabs';
import { Button, Choice, Panel, Scroll, Toggle, Trouble } from '../parts/controls';
import { NumberForm, NumberInput, NumbersButton } from '../parts/number_input';
import { ForceInput } from '../parts/force_input';
import { Terminals } from '../parts/terminals';
import { useGeometry } from '../parts/travel';
import { quantities } from '../model/plant';
import { attempt } from '../notices';
import { useResource } from '../resource';
import { useRoute } from '../route';
import { useLine, useMissing, usePowered } from '../store';

export function PlantPage() {
  const name = usePageAxis(useRoute().name);
  const bus = useLine((line) => line.axes[name]?.bus);
  const missing = useMissing('plant');
  if (missing === null) return null;
  if (missing !== undefined) {
    return (
      <>
        <AxisTabs page="plant" name={name} />
        <div className="panels">
          <Terminals axis={name} />
          <Panel title="No simulated plant">
            <p className="note">Only simulated drives have inputs to force, a load, a supply and injectable faults: {missing}.</p>
          </Panel>
        </div>
      </>
    );
  }
  return (
    <>
      <AxisTabs page="plant" name={name} />
      <div className="panels">
        <InputsPanel name={name} />
        <PlantPanel name={name} />
        <FaultPanel name={name} />
        <PowerPanel name={name} />
        {bus && <NumberForm><DisturbancePanel bus={bus} axis={name} /></NumberForm>}
        <Terminals key={name} axis={name} />
      </div>
    </>
  );
}

function InputsPanel({ name }: { name: string }) {
  const path = `${axisPath(name)}/inputs`;
  const { value, problem, again } = useResource<{ inputs: Inputs }>(path, 500);
  const wires = Object.entries(useGeometry(name)?.inputs ?? {});
  const force = (input: string, level: boolean | null) => attempt(() => put(path, { [input]: level }).then(again));
  return (
    <Panel title="Input wiring">
      <Trouble problem={problem} />
      <Scroll label="Table of inputs">
        <table className="table">
          <thead>
            <tr><th scope="col">input</th><th scope="col" className="wide">wired to</th><th scope="col">level</th><th scope="col">force</th></tr>
          </thead>
          <tbody>
            {Object.entries(value?.inputs ?? {}).map(([input, { level, forced }]) => (
              <tr key={input}>
                <th scope="row">{input}</th>
                <td className="text">{wires.filter(([, wire]) => wire === input).map(([what]) => what.replaceAll('_', ' ')).join(', ')}</td>
                <td><span className={level ? 'lamp on' : 'lamp'} role="img" aria-label={level ? 'on' : 'off'} /></td>
                <td>
                  <ForceInput input={input} level={level} forced={forced} onForce={force} />
                </td>
              </tr>
            ))}
          </tbody>
        </table>
      </Scroll>
    </Panel>
  );
}

function PlantPanel({ name }: { name: string }) {
  const path = `${axisPath(name)}/plant`;
  const { value, problem, again } = useResource<Plant>(path, 1000);
  const change = (to: Partial<Plant>) => attempt(() => put(path, to).finally(again));
  return (
    <Panel title="Plant">
      <Trouble problem={problem} />
      {value && (
        <div className="form">
          {quantities.map(({ key, label, unit }) => (
            <NumberInput whenLeft key={key} label={label} unit={unit} value={value[key] as number} onChange={(to) => change({ [key]: to })} />
          ))}
          <Toggle isSelected={value.locked_rotor} onChange={(locked_rotor) => change({ locked_rotor })}>Locked rotor</Toggle>
        </div>
      )}
    </Panel>
  );
}

function FaultPanel({ name }: { name: string }) {
  const path = `${axisPath(name)}/faults`;
  const { value, problem, again } = useResource<FaultList>(path, 1000);
  const [chosen, setChosen] = useState('encoder_loss');
  const options = [
    ...(value?.injectable.plant ?? []).map((fault) => [fault, fault.replaceAll('_', ' ')] as const),
    ...unique(value?.injectable.drive ?? []).map(({ code, name: text }) => [code, `${code.slice(2)}h ${text}`] as const),
  ];
  return (
    <Panel title="Fault injection">
      <Trouble problem={problem} />
      <div className="form">
        {options.length > 0 && <Choice label="Fault" value={chosen} options={options} onChange={setChosen} />}
        <Button onPress={() => attempt(() => post(path, { inject: chosen }).finally(again))}>Inject</Button>
      </div>
      {value && value.injected.length > 0 && (
        <ul className="plain-list">
          {value.injected.map((fault) => (
            <li key={fault}>
              {fault.replaceAll('_', ' ')} <Button kind="bare" aria-label={`Remove fault ${fault}`} onPress={() => attempt(() => remove(path, { inject: fault }).finally(again))}>Remove fault</Button>
            </li>
          ))}
          <li><Button kind="bare" onPress={() => attempt(() => remove(path).finally(again))}>Remove all faults</Button></li>
        </ul>
      )}
    </Panel>
  );
}

function unique<T extends { code: string }>(entries: T[]): T[] {
  return entries.filter(({ code }, i) => entries.findIndex((entry) => entry.code === code) === i);
}

function PowerPanel({ name }: { name: string }) {
  const powered = usePowered(name);
  return (
    <Panel title="Power" aside={<span className={`chip ${powered ? 'ready' : 'quiet'}`}>{powered ? 'on' : 'off'}</span>}>
      <p className="note">At power-off the drive loses the parameters that are not stored; the shaft keeps its position.</p>
      <div className="buttons">
        <Button isDisabled={powered} onPress={() => attempt(() => power(name, 'on'))}>On</Button>
        <Button isDisabled={!powered} onPress={() => attempt(() => power(name, 'off'))}>Off</Button>
        <Button isDisabled={!powered} onPress={() => attempt(() => power(name, 'cycle'))}>Power cycle</Button>
      </div>
    </Panel>
  );
}

function DisturbancePanel({ bus, axis }: { bus: string; axis: string }) {
  const path = `/buses/${encodeURIComponent(bus)}`;
  const { value, problem, again } = useResource<BusView>(path, 1000);
  const [drop, setDrop] = useState(5);
  const [corrupt, setCorrupt] = useState(0);
  const [delay, setDelay] = useState(0);
  const [delay_ms, setDelayMs] = useState(5);
  const [only, setOnly] = useState(false);
  const isCan = value?.type === 'can';
  const hasDelay = value?.type !== 'rs485';
  const disturb = () =>
    post(`${path}/disturb`, {
      drop: drop / 100, corrupt: corrupt / 100,
      ...(hasDelay ? { delay: delay / 100, delay_ms } : {}), ...(isCan && only ? { axis } : {}),
    }).finally(again);
  return (
    <Panel title={`Disturbance of ${bus}`} aside={value?.disturbance && <span className="chip warn">disturbed</span>}>
      <Trouble problem={problem} />
      <div className="form">
        <NumberInput label="Lost" unit="% of frames" value={drop} onChange={setDrop} minimum={0} maximum={100} />
        <NumberInput label="Corrupted" unit="% of frames" value={corrupt} onChange={setCorrupt} minimum={0} maximum={100} />
        {hasDelay && <NumberInput label="Delayed" unit="% of frames" value={delay} onChange={setDelay} minimum={0} maximum={100} />}
        {hasDelay && <NumberInput label="Delay" unit="ms" value={delay_ms} onChange={setDelayMs} minimum={0} maximum={60000} />}
        {isCan && <Toggle isSelected={only} onChange={setOnly}>Only frames sent by {axis}</Toggle>}
        <div className="buttons">
          <NumbersButton onPress={() => attempt(disturb)}>Disturb</NumbersButton>
          <Button isDisabled={!value?.disturbance} onPress={() => attempt(() => remove(`${path}/disturb`).finally(again))}>End</Button>
        </div>
      </div>
    </Panel>
  );
}
