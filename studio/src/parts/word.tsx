import { hex, type Bit } from '../model/cia402';

// The bits of a controlword or statusword, the highest first as in the standard.
export function Word({ name, value, bits }: { name: string; value: number | undefined; bits: Bit[] }) {
  return (
    <div className="word">
      <h3>
        {name} <span className="mono">{value === undefined ? '–' : hex(value, 4)}</span>
      </h3>
      <ol reversed aria-label={`Bits of the ${name.toLowerCase()}`}>
        {[...bits].reverse().map(({ bit, name: text, on }) => (
          <li key={bit} className={on ? 'on' : ''}>
            <span className="number">{bit}</span>
            <span className="lamp" role="img" aria-label={on ? 'set' : 'clear'} />
            <span className="text">{text}</span>
          </li>
        ))}
      </ol>
    </div>
  );
}
