import { useCallback, useEffect, useMemo, useRef, useState } from 'react';
import type { ObjectEntry, ObjectValue } from '../api/types';
import { axisPath, readValues, writeObject } from '../commands';
import { addressOf, hexValue, isReadable, isWritable, namedOf, showValue } from '../model/objects';
import { setsOfTerminals } from '../model/terminals';
import { attempt } from '../notices';
import { useResource } from '../resource';
import { usePowered } from '../store';
import { Choice, Link, Panel, Scroll, Toggle, Trouble } from './controls';
import { NumberInput } from './number_input';

const refresh_ms = 500;

// A drive's terminals by its objects: functions and levels of the inputs and outputs, and the touch probes.
export function Terminals({ axis }: { axis: string }) {
  const powered = usePowered(axis);
  const { value, problem } = useResource<{ objects: ObjectEntry[] }>(powered ? `${axisPath(axis)}/objects` : null);
  const entries = useMemo(() => (value?.objects ?? []).filter((entry) => entry.terminal !== undefined && isReadable(entry)), [value]);
  const [values, setValues] = useState<Record<string, ObjectValue>>({});
  const reading = useRef(false);
  const read = useCallback(async () => {
    if (reading.current) return; // one request at a time, for a slow bus
    reading.current = true;
    const now = await readValues(axis, entries.map(addressOf)).catch(() => undefined);
    reading.current = false;
    if (now) setValues((before) => (JSON.stringify(now) === JSON.stringify(before) ? before : now));
  }, [axis, entries]);
  useEffect(() => {
    if (entries.length === 0) return;
    void read();
    const timer = setInterval(() => void (document.hidden || read()), refresh_ms);
    return () => clearInterval(timer);
  }, [read, entries]);
  const write = (entry: ObjectEntry, to: number) =>
    attempt(async () => {
      if (!Number.isFinite(to) || to === values[addressOf(entry)]) return;
      try {
        await writeObject(axis, Number(entry.index), entry.sub, to);
      } finally {
        await read();
      }
    });
  if (!powered) return null;
  return (
    <>
      <Trouble problem={problem} />
      {setsOfTerminals(entries).map(([set, rows]) => (
        <Panel key={set} title={set}>
          <Scroll label={`Table: ${set}`}>
            <table className="table terminals" aria-label={set}>
              <thead><tr><th scope="col">object</th><th scope="col" className="wide">name</th><th scope="col">value</th></tr></thead>
              <tbody>
                {rows.map((entry) => (
                  <tr key={addressOf(entry)}>
                    <th scope="row" className="mono"><Link to={`/objects/${encodeURIComponent(axis)}?object=${addressOf(entry)}&q=${addressOf(entry)}`}>{addressOf(entry)}</Link></th>
                    <td className="text">{entry.name}</td>
                    <td><Value entry={entry} value={values[addressOf(entry)]} onChange={(to) => write(entry, to)} /></td>
                  </tr>
                ))}
              </tbody>
            </table>
          </Scroll>
        </Panel>
      ))}
    </>
  );
}

function Value({ entry, value, onChange }: { entry: ObjectEntry; value: ObjectValue | undefined; onChange: (to: number) => void }) {
  if (typeof value !== 'number') return <>{showValue(value)}</>;
  const writable = isWritable(entry);
  const choices = namedOf(entry.enumeration);
  const bits = namedOf(entry.bits);
  if (choices.length > 0) {
    const known = choices.some((choice) => choice.value === value);
    const options = [...choices.map(({ value: number, name }) => [number, name] as const), ...(known ? [] : [[value, `${value}`] as const])];
    return <Choice label={entry.name} hideLabel value={value} isDisabled={!writable} options={options} onChange={onChange} />;
  }
  if (bits.length > 0) {
    return (
      <ul className="bit-list terminals">
        {bits.map(({ value: bit, name }) => {
          const on = Math.floor(value / 2 ** bit) % 2 === 1;
          return (
            <li key={bit}>
              {writable ? (
                <Toggle isSelected={on} onChange={(to) => onChange(value + (to ? 1 : -1) * 2 ** bit)}>{name}</Toggle>
              ) : (
                <><span className={on ? 'lamp on' : 'lamp'} role="img" aria-label={on ? 'on' : 'off'} /> {name}</>
              )}
            </li>
          );
        })}
      </ul>
    );
  }
  if (!writable) return <>{showValue(value)} {entry.unit}</>;
  return (
    <span className="written">
      <NumberInput whenLeft label={entry.name} hideLabel value={value} minimum={entry.minimum ?? undefined} maximum={entry.maximum ?? undefined} step={1} unit={entry.unit} onChange={onChange} />
      <span className="quiet mono">{hexValue(entry, value)}</span>
    </span>
  );
}
