import { useId, useState } from 'react';
import type { ObjectEntry } from '../api/types';
import { axisPath } from '../commands';
import { addressOf, isReadable, isWritable } from '../model/objects';
import { channelOf, objectOf, textOfChannel } from '../model/scope';
import { useResource } from '../resource';
import { useLine, usePowered } from '../store';
import { Button, Choice } from '../parts/controls';

const noSignals: string[] = [];

// Chooses an axis and one of its signals or objects: "AXIS/SIGNAL", "AXIS/6064:00".
export function ChannelInput({ label, value, first, onlyWritable = false, onChange }: {
  label: string;
  value: string;
  first?: string | undefined; // the axis, as long as there is no value
  onlyWritable?: boolean;
  onChange: (to: string) => void;
}) {
  const order = useLine((line) => line.order);
  const signals = useLine(({ line }) => line?.signals) ?? noSignals;
  const given = channelOf(value);
  const [axis, setAxis] = useState(given?.axis ?? first ?? order[0]);
  const [what, setWhat] = useState(given?.object ?? given?.signal ?? '');
  const powered = usePowered(axis);
  const objects = useResource<{ objects: ObjectEntry[] }>(powered ? `${axisPath(axis)}/objects` : null).value?.objects ?? [];
  const listId = useId();
  const tell = (toAxis: string, toWhat: string) => {
    setAxis(toAxis);
    setWhat(toWhat);
    const object = objectOf(toWhat);
    onChange(toWhat.trim() === '' ? '' : textOfChannel(object ? { axis: toAxis, object } : { axis: toAxis, signal: toWhat.trim() }));
  };
  const offered = objects.filter((entry) => Number(entry.index) >= 0x1000 && (onlyWritable ? isWritable(entry) : isReadable(entry)));
  return (
    <div className="channel-input">
      <Choice label={`Axis of ${label.toLowerCase()}`} value={axis} options={order.map((each) => [each, each] as const)} onChange={(to) => tell(to, what)} />
      <label className="field">
        <span>{label}</span>
        <input className="input" list={listId} value={what} autoComplete="off" placeholder={onlyWritable ? '6083:00' : 'position_counts, 6064:00'} onChange={(event) => tell(axis, event.target.value)} />
      </label>
      <datalist id={listId}>
        {!onlyWritable && signals.map((signal) => <option key={signal} value={signal} />)}
        {offered.map((entry) => <option key={addressOf(entry)} value={addressOf(entry)}>{entry.name}</option>)}
      </datalist>
    </div>
  );
}

export function ChannelsInput({ label, value, most, onChange }: { label: string; value: string[]; most: number; onChange: (to: string[]) => void }) {
  const [next, setNext] = useState('');
  const [round, setRound] = useState(0); // a new input after each addition
  const fits = channelOf(next) !== null && !value.includes(next) && value.length < most;
  return (
    <fieldset className="channels-input">
      <legend>{label} <span className="quiet">{value.length} of {most}</span></legend>
      <ul className="channels">
        {value.map((text) => (
          <li key={text}>
            <span className="name">{text.replace('/', ' ')}</span>
            <Button kind="bare" aria-label={`Remove ${text}`} onPress={() => onChange(value.filter((each) => each !== text))}>×</Button>
          </li>
        ))}
      </ul>
      <ChannelInput key={round} label="Signal or object to add" value="" first={channelOf(value[value.length - 1] ?? '')?.axis} onChange={setNext} />
      <Button isDisabled={!fits} onPress={() => { onChange([...value, next]); setNext(''); setRound(round + 1); }}>Add to the list</Button>
    </fieldset>
  );
}
