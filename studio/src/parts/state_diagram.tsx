import type { Transition } from '../api/types';
import { edges, states, toneOf, type State } from '../model/cia402';
import { stateTip } from '../model/meanings';
import { useRoving } from './tips';

// CiA 402-2, figure "State machine of the power drive system". The present state and the transitions that a master may
// request now are highlighted.

const width = 172;
const height = 36;
const places: Record<State, [number, number]> = {
  'not ready to switch on': [40, 30],
  'switch on disabled': [40, 110],
  'ready to switch on': [40, 200],
  'switched on': [40, 290],
  'operation enabled': [40, 380],
  'quick stop active': [340, 380],
  'fault reaction active': [340, 30],
  fault: [340, 110],
};

// For each transition: the path of its line, and the x and y of its number.
const routes: Record<number, [string, number, number]> = {
  0: ['M126 6 V28', 126, 6],
  1: ['M126 66 V108', 126, 88],
  2: ['M86 146 V198', 86, 172],
  3: ['M86 236 V288', 86, 262],
  4: ['M86 326 V378', 86, 352],
  5: ['M166 380 V328', 166, 353],
  6: ['M166 290 V238', 166, 263],
  7: ['M166 200 V148', 166, 173],
  8: ['M40 392 H16 V214 H38', 16, 303],
  9: ['M212 386 H272 V132 H214', 272, 300],
  10: ['M212 304 H242 V141 H214', 242, 222],
  11: ['M212 396 H338', 305, 396],
  12: ['M426 380 V250 H300 V124 H214', 363, 250],
  13: ['M536 48 H514', 536, 48],
  14: ['M426 66 V108', 426, 88],
  15: ['M340 116 H214', 320, 116],
  16: ['M340 409 H214', 248, 409],
};

export function StateDiagram({ state, transitions, product }: { state: string | undefined; transitions: Transition[]; product: string }) {
  const { tabIndexOf, onKeyDown, onFocus } = useRoving();
  const open = new Set(transitions.map(({ number }) => number));
  // The transitions that are possible now are drawn last, over the others.
  const inOrder = [...edges].sort((a, b) => Number(open.has(a.number)) - Number(open.has(b.number)));
  return (
    // The drawing handles the arrow keys for its states, which get the focus to be explained.
    <svg className="states" viewBox="0 -8 556 432" role="group" aria-label={`CiA 402 state machine, now: ${state ?? 'not known'}`} onKeyDown={onKeyDown}>
      <defs>
        {['idle', 'open'].map((kind) => (
          <marker key={kind} id={`arrow-${kind}`} className={kind} viewBox="0 0 8 8" refX="6" refY="4" markerWidth="7" markerHeight="7" orient="auto">
            <path d="M0 0 L8 4 L0 8 z" />
          </marker>
        ))}
      </defs>
      {inOrder.map(({ number }) => {
        const [line, x, y] = routes[number];
        const kind = open.has(number) ? 'open' : 'idle';
        return (
          <g key={number} className={`edge ${kind}`}>
            <path d={line} markerEnd={`url(#arrow-${kind})`} />
            <circle cx={x} cy={y} r="9" />
            <text x={x} y={y + 3.5}>{number}</text>
          </g>
        );
      })}
      {states.map((name, i) => {
        const [x, y] = places[name];
        return (
          <g key={name} role="img" aria-label={name} data-tip={stateTip(name, product)} tabIndex={tabIndexOf(i)} onFocus={() => onFocus(i)} className={`place ${name === state ? `now ${toneOf(name)}` : ''}`}>
            <rect x={x} y={y} width={width} height={height} rx="4" />
            <text x={x + width / 2} y={y + height / 2 + 4.5}>{name}</text>
          </g>
        );
      })}
    </svg>
  );
}
