import { memo } from 'react';
import type { AxisView, Geometry } from '../api/types';
import { axisPath } from '../commands';
import type { Ghost } from '../model/plan';
import { indexes, travelScale, type Scale } from '../model/travel';
import { fixed } from '../model/units';
import { useResource } from '../resource';
import { useMissing } from '../store';

// `axis` null: there is no axis, so nothing is requested.
export function useGeometry(axis: string | null): Geometry | undefined {
  const there = useMissing('geometry') === undefined;
  return useResource<Geometry>(there && axis !== null ? `${axisPath(axis)}/geometry` : null).value;
}

const percent = (share: number) => `${(100 * share).toFixed(3)}%`;

// The travel seen from above: hard stops, the ranges in which limit and home switches are active, the index pulses, the
// target of an enabled axis, and the axis. A page that draws planned moves passes `ghost`, null while there is none: the
// height includes the text of the move then, so that the buttons below (Halt) keep their place.
export function Travel({ axis, geometry, ghost }: { axis: AxisView; geometry: Geometry | undefined; ghost?: Ghost | null }) {
  const missing = useMissing('geometry');
  if (typeof missing === 'string') return null; // drives on buses do not report their travel
  // Until the geometry has arrived there is no scale, and so no place for the axis.
  const waits = !geometry;
  const target = axis.state === 'operation enabled' && !waits ? axis.target_counts : null;
  const scale = travelScale(geometry, axis.position_counts);
  const turns = geometry?.index_every ? fixed(axis.position_counts / geometry.index_every, 2) : null;
  const text = turns ? `${turns} revolutions` : `${axis.position_counts} counts`;
  const [from, to] = [scale.at(axis.position_counts), ghost ? scale.at(ghost.to) : 0];
  return (
    <svg className="travel" role="img" aria-label={`${axis.name} is at ${text}${ghost ? `, the move: ${ghost.text}` : ''}`} height={ghost === undefined ? 34 : 48} width="100%">
      <Fixed geometry={geometry} from={scale.from} to={scale.to} />
      {ghost && !waits && (
        <g className="ghost">
          <line x1={percent(from)} x2={percent(to)} y1="11" y2="11" />
          <svg x={percent(to)} overflow="visible">
            <path d="M-6 4 h12 v8 l-6 6 l-6 -6 z" />
          </svg>
          <text x={percent((from + to) / 2)} y="44" textAnchor={(from + to) / 2 < 0.15 ? 'start' : (from + to) / 2 > 0.85 ? 'end' : 'middle'}>{ghost.text}</text>
        </g>
      )}
      {target !== null && target !== undefined && (
        <svg x={percent(scale.at(target))} overflow="visible">
          <path className="target" d="M0 19 l-5 9 h10 z" />
        </svg>
      )}
      {!waits && (
        <svg x={percent(scale.at(axis.position_counts))} overflow="visible">
          <path className={axis.powered ? 'carriage' : 'carriage dead'} d="M-6 4 h12 v8 l-6 6 l-6 -6 z" />
        </svg>
      )}
    </svg>
  );
}

const Fixed = memo(function Fixed({ geometry, from, to }: { geometry: Geometry | undefined; from: number; to: number }) {
  const scale: Scale = { from, to, at: (counts) => Math.max(0, Math.min(1, (counts - from) / (to - from))) };
  const span = (a: number, b: number) => ({ x: percent(scale.at(a)), width: percent(scale.at(b) - scale.at(a)) });
  return (
    <>
      <line className="rail" x1="0" x2="100%" y1="19" y2="19" />
      {indexes(geometry, scale).map((mark) => (
        <line key={mark} className="index" x1={percent(scale.at(mark))} x2={percent(scale.at(mark))} y1="16" y2="22" />
      ))}
      {geometry && (
        <>
          {geometry.negative_limit !== null && <rect className="limit" {...span(from, geometry.negative_limit)} y="22" height="5" />}
          {geometry.positive_limit !== null && <rect className="limit" {...span(geometry.positive_limit, to)} y="22" height="5" />}
          {geometry.home_from !== null && geometry.home_to !== null && (
            <rect className="home" {...span(geometry.home_from, geometry.home_to)} y="22" height="5" />
          )}
          {geometry.negative_stop !== null && <rect className="hard" {...span(from, geometry.negative_stop)} y="8" height="22" />}
          {geometry.positive_stop !== null && <rect className="hard" {...span(geometry.positive_stop, to)} y="8" height="22" />}
        </>
      )}
    </>
  );
});
