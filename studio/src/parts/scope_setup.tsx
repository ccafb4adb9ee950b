import { useState } from 'react';
import type { BusView, ObjectEntry, Trigger } from '../api/types';
import { axisPath } from '../commands';
import { states } from '../model/cia402';
import { addressOf, isReadable } from '../model/objects';
import { any, axisOf, longestBefore, mostChannels, objectOf, ofAllAxes, textOfChannel, without, type Setup } from '../model/scope';
import { ratesOf } from '../model/sampling';
import { useResource } from '../resource';
import { useLine, useMissing } from '../store';
import { Button, Choice, Panel } from './controls';
import { NumberInput } from './number_input';
import { swatchOf } from './lanes';

const noSignals: string[] = [];
const numeric = /^(U?INT|INTEGER|UNSIGNED|REAL|BOOLEAN)/;

export function ScopeSetup({ setup, onChange }: { setup: Setup; onChange: (to: Setup) => void }) {
  const { channels, trigger } = setup;
  const isImmediate = trigger.kind === 'now';
  const isReal = useLine(({ line }) => line?.kind === 'real');
  const buses = useResource<{ buses: BusView[] }>(isReal ? '/buses' : null).value?.buses;
  const most = ratesOf(channels.map(({ axis }) => axis), buses);
  const offered = most.includes(setup.rate_hz) ? most : [...most, setup.rate_hz];
  return (
    <Panel title="Channels" aside={<span className="quiet">{channels.length} of {mostChannels}</span>}>
      <ul className="channels">
        {channels.map((channel, i) => (
          <li key={textOfChannel(channel)}>
            <span className={swatchOf(i)} aria-hidden="true" />
            <span className="name">{channel.axis} {channel.signal ?? channel.object}</span>
            <Button kind="bare" aria-label={`Remove ${textOfChannel(channel)}`} isDisabled={channels.length === 1} onPress={() => onChange(without(setup, i))}>×</Button>
          </li>
        ))}
      </ul>
      {channels.length < mostChannels && <AddChannel setup={setup} onChange={onChange} />}
      <div className="form">
        <Choice label="Rate" value={setup.rate_hz} options={offered.map((rate) => [rate, `${rate} Hz`] as const)} onChange={(rate_hz) => onChange({ ...setup, rate_hz, pre_ms: Math.min(setup.pre_ms, longestBefore(setup.duration_ms, rate_hz)) })} />
        <NumberInput whenLeft label="Duration" unit="ms" value={setup.duration_ms} minimum={1} maximum={600000} onChange={(duration_ms) => onChange({ ...setup, duration_ms, pre_ms: Math.min(setup.pre_ms, longestBefore(duration_ms, setup.rate_hz)) })} />
        <NumberInput whenLeft label="Pre-trigger time" unit="ms" value={setup.pre_ms} minimum={0} maximum={longestBefore(setup.duration_ms, setup.rate_hz)} isDisabled={isImmediate} hint={isImmediate ? 'none: an immediate recording begins at once' : undefined} onChange={(pre_ms) => onChange({ ...setup, pre_ms })} />
        <TriggerFields setup={setup} onChange={onChange} />
      </div>
    </Panel>
  );
}

// A choice of an axis. It ends when the axis of the setup becomes another one, for example by a layout.
export function useAxisChoice(ofSetup: string): [string, (to: string) => void] {
  const [before, setBefore] = useState(ofSetup);
  const [axis, setAxis] = useState(ofSetup);
  if (ofSetup !== before) {
    setBefore(ofSetup);
    setAxis(ofSetup);
  }
  return [axis, setAxis];
}

function AddChannel({ setup, onChange }: { setup: Setup; onChange: (to: Setup) => void }) {
  const order = useLine((line) => line.order);
  const [axis, setAxis] = useAxisChoice(axisOf(setup));
  const [what, setWhat] = useState('');
  const signals = useLine(({ line }) => line?.signals) ?? noSignals;
  const hasInputs = useMissing('inputs') === undefined;
  const objects = useResource<{ objects: ObjectEntry[] }>(`${axisPath(axis)}/objects`).value?.objects ?? [];
  const inputs = useResource<{ inputs: Record<string, unknown> }>(hasInputs ? `${axisPath(axis)}/inputs` : null).value?.inputs ?? {};
  const offered = [
    ...[...signals, ...Object.keys(inputs)].map((signal) => [signal, ''] as const),
    ...objects.filter((entry) => Number(entry.index) >= 0x1000 && isReadable(entry) && numeric.test(entry.type)).map((entry) => [addressOf(entry), entry.name] as const),
  ];
  const object = objectOf(what);
  const known = offered.some(([id]) => id === (object ?? what.trim()));
  const channel = object ? { axis, object } : { axis, signal: what.trim() };
  const taken = setup.channels.some((each) => textOfChannel(each) === textOfChannel(channel));
  return (
    <form
      className="form add"
      onSubmit={(event) => {
        event.preventDefault();
        if (!known || taken) return;
        onChange({ ...setup, channels: [...setup.channels, channel] });
        setWhat('');
      }}
    >
      <Choice label="Axis" value={axis} options={order.map((each) => [each, each] as const)} onChange={setAxis} />
      <label className="field">
        <span>Signal or object</span>
        <input className="input" list="offered" value={what} onChange={(event) => setWhat(event.target.value)} placeholder={`${signals[2] ?? '6041:00'}, 6064:00`} autoComplete="off" />
      </label>
      <datalist id="offered">
        {offered.map(([id, text]) => <option key={id} value={id}>{text}</option>)}
      </datalist>
      <Button type="submit" isDisabled={!known || taken}>Add</Button>
      {order.length > 1 && (
        <Button isDisabled={!known || (object !== null && object < '6000')} onPress={() => { onChange(ofAllAxes(setup, channel, order)); setWhat(''); }}>Of all axes</Button>
      )}
    </form>
  );
}

const kinds = [['now', 'immediate'], ['edge', 'edge'], ['level', 'level'], ['state', 'state of an axis'], ['fault', 'fault of an axis']] as const;

function TriggerFields({ setup, onChange }: { setup: Setup; onChange: (to: Setup) => void }) {
  const { trigger, channels } = setup;
  const order = useLine((line) => line.order);
  const set = (to: Partial<Trigger>) => onChange({ ...setup, trigger: { ...trigger, ...to } });
  const start = (kind: Trigger['kind']) => {
    if (kind === 'edge' || kind === 'level') onChange({ ...setup, trigger: { kind, channel: 0, level: 0, slope: 'rising' } });
    else if (kind === 'state') onChange({ ...setup, trigger: { kind, axis: order[0], state: 'operation enabled' } });
    else if (kind === 'fault') onChange({ ...setup, trigger: { kind, axis: order[0] } });
    else onChange({ ...setup, trigger: { kind } });
  };
  const isLevel = trigger.kind === 'edge' || trigger.kind === 'level';
  return (
    <>
      <Choice label="Trigger" value={trigger.kind} options={kinds} onChange={start} />
      {isLevel && (
        <>
          <Choice label="of channel" value={trigger.channel ?? 0} options={channels.map((channel, i) => [i, textOfChannel(channel)] as const)} onChange={(channel) => set({ channel })} />
          <NumberInput whenLeft label="Level" value={trigger.level ?? 0} onChange={(level) => set({ level })} />
          <Choice label="Slope" value={trigger.slope ?? 'rising'} options={[['rising', 'rising'], ['falling', 'falling']]} onChange={(slope) => set({ slope })} />
        </>
      )}
      {(trigger.kind === 'state' || trigger.kind === 'fault') && (
        <Choice
          label="of axis"
          value={trigger.axis ?? any}
          options={[...(trigger.kind === 'fault' ? [[any, 'any'] as const] : []), ...order.map((each) => [each, each] as const)]}
          onChange={(axis) => onChange({ ...setup, trigger: axis === any ? { kind: trigger.kind } : { ...trigger, axis } })}
        />
      )}
      {trigger.kind === 'state' && (
        <Choice
          label="State"
          value={trigger.state ?? any}
          options={[[any, 'any change'], ...states.map((each) => [each, each] as const)]}
          onChange={(state) => {
            const { kind, axis = order[0] } = trigger;
            onChange({ ...setup, trigger: state === any ? { kind, axis } : { kind, axis, state } });
          }}
        />
      )}
    </>
  );
}
