import type { BusView } from '../api/types';
import { Choice, Link, Panel, Scroll } from '../parts/controls';
import { fixed } from '../model/units';
import { useResource } from '../resource';
import { keep, useRoute } from '../route';
import { Traffic } from './traffic';
import { Load } from './line';

export function BusPage() {
  const { name: part, query } = useRoute();
  const buses = useResource<{ buses: BusView[] }>('/buses', 1000).value?.buses ?? [];
  const asked = query.get('bus');
  const bus = asked === null ? buses[0] : buses.find(({ name }) => name === asked);
  const addressOf = (name: string) => `/bus${part === '' ? '' : `/${part}`}?bus=${encodeURIComponent(name)}`;
  if (buses.length === 0) return null;
  if (!bus) {
    return (
      <p className="empty" role="alert">
        There is no bus "{asked}".{' '}
        {buses.map(({ name }) => <Link key={name} className="button" to={addressOf(name)}>{name}</Link>)}
      </p>
    );
  }
  return (
    <>
      <div className="toolbar">
        <Choice label="Bus" value={bus.name} options={buses.map(({ name }) => [name, name] as const)} onChange={(name) => keep({ bus: name })} />
        {bus.load_percent !== undefined && <Load percent={bus.load_percent} />}
        <nav className="tabs" aria-label="Parts of the bus page">
          <Link to={`/bus?bus=${encodeURIComponent(bus.name)}`} {...(part === '' ? { 'aria-current': 'page' as const } : {})}>Links and axes</Link>
          <Link to={`/bus/traffic?bus=${encodeURIComponent(bus.name)}`} {...(part === 'traffic' ? { 'aria-current': 'page' as const } : {})}>Traffic</Link>
        </nav>
      </div>
      {part === 'traffic' ? <Traffic key={bus.name} bus={bus} /> : <LinksAndAxes bus={bus} />}
    </>
  );
}

function LinksAndAxes({ bus }: { bus: BusView }) {
  return (
    <>
      <div className="panels wide">
        <Panel title="Links">
          <Scroll label="Table of links">
            <table className="table">
              <thead>
                <tr><th scope="col" className="wide">link</th><th scope="col">clients</th><th scope="col">to the bus</th><th scope="col">from the bus</th><th scope="col">dropped</th><th scope="col">malformed</th></tr>
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
