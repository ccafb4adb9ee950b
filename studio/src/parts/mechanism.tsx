import type { AxisView, Geometry, Mechanics } from '../api/types';
import { describe, sliderAt, turnsOf } from '../model/machine';

// The rotating part of an axis, seen from the side: the shaft of a rotary axis, an arm with its weight, a crank with its
// slider. The positive direction is anticlockwise, and 0 turns of an arm are horizontal. A linear axis has only its travel.
export function Dial({ axis, geometry, size = 64 }: { axis: AxisView; geometry: Geometry | undefined; size?: number }) {
  const mechanics = geometry?.mechanics;
  if (!mechanics || mechanics.kind === 'linear') return null;
  const turns = turnsOf(mechanics, axis.position_counts);
  return (
    <svg className={axis.powered ? 'dial' : 'dial dead'} viewBox="-32 -32 64 64" width={size} height={size} role="img" aria-label={`${describe(mechanics)}, at ${Math.round(360 * turns)}°`}>
      {mechanics.kind === 'crank' ? <Crank mechanics={mechanics} turns={turns} /> : <Pointer isArm={mechanics.kind === 'arm'} turns={turns} />}
    </svg>
  );
}

const place = (turns: number, radius: number) => [radius * Math.cos(2 * Math.PI * turns), -radius * Math.sin(2 * Math.PI * turns)] as const;

function Pointer({ isArm, turns }: { isArm: boolean; turns: number }) {
  const [x, y] = place(turns, 24);
  return (
    <>
      <circle className="ring" r="28" />
      {isArm ? <line className="level" x1="-28" x2="28" y1="0" y2="0" /> : [0, 0.25, 0.5, 0.75].map((at) => <line key={at} className="mark" x1={place(at, 25)[0]} y1={place(at, 25)[1]} x2={place(at, 28)[0]} y2={place(at, 28)[1]} />)}
      <line className={isArm ? 'arm' : 'hand'} x1="0" y1="0" x2={x} y2={y} />
      <circle className="hub" r="4" />
      {isArm && <circle className="weight" cx={x} cy={y} r="5" />}
    </>
  );
}

const [center, radius, stroke] = [-16, 11, 22];

function Crank({ mechanics, turns }: { mechanics: Mechanics; turns: number }) {
  const [x, y] = place(turns, radius);
  const slider = 6 + stroke * sliderAt(turns, mechanics.crank_ratio) - 2;
  return (
    <>
      <circle className="ring" cx={center} r={radius} />
      <line className="level" x1="0" x2="31" y1="6" y2="6" />
      <line className="arm" x1={center} y1="0" x2={center + x} y2={y} />
      <line className="hand" x1={center + x} y1={y} x2={slider} y2="0" />
      <circle className="hub" cx={center} r="3" />
      <rect className="weight" x={slider - 4} y="-5" width="8" height="10" />
    </>
  );
}

// The symbols of the drawings.
export function Legend() {
  return (
    <details className="legend">
      <summary>Legend</summary>
      <ul>
        {signs.map(([text, sign]) => (
          <li key={text}><svg className="travel" width="30" height="24" aria-hidden="true">{sign}</svg> {text}</li>
        ))}
        {dials.map(([text, kind]) => (
          <li key={text}><Dial size={28} axis={sample} geometry={{ mechanics: { ...still, kind } } as Geometry} /> {text}</li>
        ))}
      </ul>
    </details>
  );
}

const signs = [
  ['position of the axis', <path key="" className="carriage" d="M9 3 h12 v8 l-6 6 l-6 -6 z" />],
  ['last target', <path key="" className="target" d="M15 6 l-5 9 h10 z" />],
  ['index of the encoder', <line key="" className="index" x1="15" x2="15" y1="7" y2="17" />],
  ['home switch is active', <rect key="" className="home" x="4" y="10" width="22" height="5" />],
  ['limit switch is active', <rect key="" className="limit" x="4" y="10" width="22" height="5" />],
  ['beam of a gantry between its two axes', <g key="" className="gantry"><path className="rail" d="M1 5 h28 M1 19 h28" /><line className="beam" x1="15" x2="15" y1="5" y2="19" /></g>],
  ['hard stop', <rect key="" className="hard" x="8" y="1" width="14" height="22" />],
] as const;
const dials = [['rotary axis: the shaft in its turn', 'rotary'], ['arm with its weight; the line is horizontal', 'arm'], ['crank with its slider', 'crank']] as const;
const still: Mechanics = { kind: 'rotary', counts_per_revolution: 8, cycle_revolutions: 1, cycle_offset_turns: 0, crank_ratio: 0.25, hangs: false, belt: false, elastic: false };
const sample = { position_counts: 1, powered: true } as AxisView;
