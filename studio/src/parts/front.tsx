import type { AxisView, Lamp } from '../api/types';
import { Panel } from './controls';

// The front of the drive: its lamps, the levels of its outputs, and its warnings.
export function Front({ axis }: { axis: AxisView }) {
  const { lamps = [], outputs = {}, warnings = [] } = axis;
  const levels = Object.entries(outputs);
  if (lamps.length === 0 && levels.length === 0 && warnings.length === 0) return null;
  return (
    <Panel title="Lamps and outputs">
      <ul className="bit-list front">
        {lamps.map((lamp) => (
          <li key={lamp.name}>
            <span className={`lamp front ${lamp.light === 'off' ? '' : lamp.colour}`} role="img" aria-label={lightOf(lamp)} /> {lamp.name} <span className="quiet">{lightOf(lamp)}</span>
          </li>
        ))}
        {levels.map(([name, level]) => (
          <li key={name}>
            <span className={level ? 'lamp on' : 'lamp'} role="img" aria-label={level ? 'on' : 'off'} /> {name}
          </li>
        ))}
      </ul>
      {warnings.map(({ code, name }) => (
        <p key={code + name} className="note">Warning {code.slice(2)}h: {name}</p>
      ))}
    </Panel>
  );
}

function lightOf({ light, flashes }: Lamp): string {
  if (light !== 'flashes') return light;
  return flashes === 1 ? 'single flash' : `${flashes} flashes`;
}
