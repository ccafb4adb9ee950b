import { useEffect, useRef, useState } from 'react';
import { get, problemOf } from '../api/client';
import type { BusView, Problem } from '../api/types';
import { Button, Choice, Panel, Scroll, Search, Trouble } from '../parts/controls';
import { fixed } from '../model/units';
import { useResource } from '../resource';
import { keep, useRoute } from '../route';
import { Load } from './line';

export function BusPage() {
  const { query } = useRoute();
  const buses = useResource<{ buses: BusView[] }>('/buses', 1000).value?.buses ?? [];
  const bus = buses.find(({ name }) => name === query.get('bus')) ?? buses[0];
  if (!bus) return null;
  return (
    <>
      <div className="toolbar">
        <Choice label="Bus" value={bus.name} options={buses.map(({ name }) => [name, name] as const)} onChange={(name) => keep({ bus: name })} />
        {bus.load_percent !== undefined && <Load percent={bus.load_percent} />}
      </div>
      <div className="panels">
        <Panel title="Links">
          <Scroll label="Table of links">
            <table className="table">
              <thead>
                <tr><th scope="col" className="wide">link</th><th scope="col">clients</th><th scope="col">to the bus</th><th scope="col">from it</th><th scope="col">dropped</th><th scope="col">malformed</th></tr>
              </thead>
              <tbody>
                {bus.links.map((link) => (
                  <tr key={link.name}>
                    <th scope="row" className="mono">{link.name}</th>
                    <td>{link.clients}</td><td>{fixed(link.to_bus, 0)}</td><td>{fixed(link.from_bus, 0)}</td><td>{link.dropped}</td><td>{link.malformed}</td>
                  </tr>
                ))}
              </tbody>
            </table>
          </Scroll>
        </Panel>
        <Panel title="Axes">
          <Scroll label="Table of axes"><AxesOfBus bus={bus} /></Scroll>
        </Panel>
      </div>
      <Traffic key={bus.name} bus={bus.name} />
    </>
  );
}

function AxesOfBus({ bus }: { bus: BusView }) {
  const axes = Object.entries(bus.axes);
  const columns = [...new Set(axes.flatMap(([, axis]) => Object.keys(axis)))];
  const show = (value: unknown) => (typeof value === 'number' ? fixed(value, Number.isInteger(value) ? 0 : 1) : typeof value === 'boolean' ? (value ? 'yes' : 'no') : typeof value === 'string' ? value : '–');
  return (
    <table className="table">
      <thead>
        <tr>
          <th scope="col">axis</th>
          {columns.map((column) => <th scope="col" key={column}>{column.replaceAll('_', ' ')}</th>)}
        </tr>
      </thead>
      <tbody>
        {axes.map(([name, axis]) => (
          <tr key={name}>
            <th scope="row">{name}</th>
            {columns.map((column) => <td key={column}>{show(axis[column])}</td>)}
          </tr>
        ))}
      </tbody>
    </table>
  );
}

interface TrafficFrame {
  n: number;
  time_ns: number;
  id?: number | string;
  address?: number | string;
  data: string;
  text: string;
}

const most = 2000;

function Traffic({ bus }: { bus: string }) {
  const [frames, setFrames] = useState<TrafficFrame[]>([]);
  const [running, setRunning] = useState(true);
  const [filter, setFilter] = useState('');
  const [problem, setProblem] = useState<Problem>();
  const after = useRef(-1);
  useEffect(() => {
    if (!running) return;
    let over = false;
    let timer: ReturnType<typeof setTimeout>;
    const ask = async () => {
      try {
        const query = after.current < 0 ? '' : `?after=${after.current}`;
        const { frames: fresh } = await get<{ frames: TrafficFrame[] }>(`/buses/${encodeURIComponent(bus)}/traffic${query}`);
        if (over) return;
        if (fresh.length > 0) {
          after.current = fresh[fresh.length - 1].n;
          setFrames((before) => [...before, ...fresh].slice(-most));
        }
        setProblem(undefined);
      } catch (error) {
        if (!over) setProblem(problemOf(error));
      }
      if (!over) timer = setTimeout(() => void ask(), 300);
    };
    void ask();
    return () => {
      over = true;
      clearTimeout(timer);
    };
  }, [bus, running]);

  const words = filter.toLowerCase();
  const shown = frames.filter(({ id, address, data, text }) => `${idText(id ?? address)} ${data} ${text}`.toLowerCase().includes(words)).slice(-300).reverse();
  const save = () => {
    const text = frames.map(({ time_ns, id, address, data, text: meaning }) => `(${(time_ns / 1e9).toFixed(6)}) ${bus} ${idText(id ?? address)}#${data} ; ${meaning}`).join('\n');
    const link = document.createElement('a');
    link.href = URL.createObjectURL(new Blob([text + '\n'], { type: 'text/plain' }));
    link.download = `${bus}.log`;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 1000);
  };
  return (
    <Panel
      title="Traffic"
      aside={
        <>
          <Search label="Filter" value={filter} onChange={setFilter} />
          <Button kind="bare" onPress={() => setRunning(!running)}>{running ? 'Pause' : 'Go on'}</Button>
          <Button kind="bare" onPress={save} isDisabled={frames.length === 0}>Save</Button>
        </>
      }
    >
      <Trouble problem={problem} />
      {shown.length === 0 && !problem && <p className="empty">{frames.length === 0 ? 'Nobody has spoken yet.' : 'Nothing fits the filter.'}</p>}
      {shown.length > 0 && (
        <Scroll label="Frames" className="traffic">
          <table className="table">
            <thead>
              <tr><th scope="col">time, s</th><th scope="col">id</th><th scope="col">data</th><th scope="col" className="wide">meaning</th></tr>
            </thead>
            <tbody>
              {shown.map((frame) => (
                <tr key={frame.n}>
                  <td>{(frame.time_ns / 1e9).toFixed(6)}</td>
                  <td className="mono">{idText(frame.id ?? frame.address)}</td>
                  <td className="mono text">{frame.data}</td>
                  <td className="text">{frame.text}</td>
                </tr>
              ))}
            </tbody>
          </table>
        </Scroll>
      )}
    </Panel>
  );
}

const idText = (id: number | string | undefined) => (typeof id === 'number' ? id.toString(16).toUpperCase().padStart(3, '0') : (id ?? ''));
