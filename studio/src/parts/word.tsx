import { hex, type Bit } from '../model/cia402';
import { useRoving } from './tips';

// The bits of a controlword or statusword, the highest first as in the standard. `tipOf` explains a bit.
export function Word({ name, value, bits, tipOf }: { name: string; value: number | undefined; bits: Bit[]; tipOf: (bit: number, name: string) => string }) {
  const { tabIndexOf, onKeyDown, onFocus } = useRoving();
  return (
    <div className="word">
      <h3>
        {name} <span className="mono">{value === undefined ? '–' : hex(value, 4)}</span>
      </h3>
      {/* The list handles the arrow keys for its items, which get the focus to be explained. */}
      {/* eslint-disable jsx-a11y/no-noninteractive-element-interactions */}
      <ol reversed aria-label={`Bits of the ${name.toLowerCase()}`} onKeyDown={onKeyDown}>
        {[...bits].reverse().map(({ bit, name: text, on }, i) => (
          <li key={bit} className={on ? 'on' : ''} data-tip={tipOf(bit, text)} tabIndex={tabIndexOf(i)} onFocus={() => onFocus(i)}>
            <span className="number">{bit}</span>
            <span className="lamp" role="img" aria-label={on ? 'set' : 'clear'} />
            <span className="text">{text}</span>
          </li>
        ))}
      </ol>
      {/* eslint-enable jsx-a11y/no-noninteractive-element-interactions */}
    </div>
  );
}
