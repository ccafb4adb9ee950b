import { useEffect, useRef, useSyncExternalStore } from 'react';
import type { AxisView, Geometry, HomingMethod } from '../api/types';
import { followLeg, homingPath, schematicOf } from '../model/homing';

// A homing method as in the figures of the standard: the path leg by leg, and below it the ranges in which the switches are
// active, and the index pulses. The present position of the axis is on the path. Without a geometry, for a drive on a bus, it is
// a schematic over the switches that the legs name.

// The drawing is scaled to the window: in a narrow one it has less width, so that its texts can be read.
const narrow = matchMedia('(max-width: 760px)');
const onNarrow = (tell: () => void) => {
  narrow.addEventListener('change', tell);
  return () => narrow.removeEventListener('change', tell);
};
const legHeight = 22;
const margin = 16;
const names = 80; // width of the labels at the left

interface Figure {
  method: HomingMethod;
  axis: AxisView;
  start: number; // position in counts at which the homing began or would begin
}

// `isReversed`: by 607Eh. A schematic has the directions of the drive, the travel those of the shaft.
export function HomingFigure({ geometry, isReversed, ...of }: Figure & { geometry: Geometry | undefined; isReversed: boolean }) {
  const turns = geometry !== undefined && isReversed;
  const caption = turns ? 'The polarity (607Eh) is reversed: a positive leg turns the shaft towards smaller counts, to the left.'
    : geometry ? '' : 'Not to scale: the places of the switches are not known for a drive on a bus. The drawing shows the legs of the method over the switches that it needs.';
  return (
    <figure className="homing-figure">
      {geometry ? <Drawing {...of} geometry={geometry} isReversed={turns} /> : <Drawing {...of} {...schematicOf(of.method)} isReversed={false} isSchematic />}
      {caption && <figcaption className="quiet note">{caption}</figcaption>}
    </figure>
  );
}

function Drawing({ method, geometry, axis, start, isReversed, isSchematic = false }: Figure & { geometry: Geometry; isReversed: boolean; isSchematic?: boolean }) {
  const path = homingPath(method, geometry, start, isReversed);
  const leg = useRef(0);
  const width = useSyncExternalStore(onNarrow, () => narrow.matches) ? 340 : 640;
  useEffect(() => {
    leg.current = 0;
  }, [start, method.method]);
  leg.current = followLeg(path, leg.current, axis.position_counts, axis.velocity_rpm ?? 0);

  const turn = geometry.index_every ?? 131072;
  const points = [start, ...(isSchematic ? [] : [axis.position_counts]), ...path.map(({ to }) => to)];
  if (geometry.home_from !== null && geometry.home_to !== null) points.push(geometry.home_from, geometry.home_to);
  const span = Math.max(3 * turn, (Math.max(...points) - Math.min(...points)) * 1.3);
  const middle = (Math.max(...points) + Math.min(...points)) / 2;
  const from = middle - span / 2;
  const at = (counts: number) => names + Math.max(0, Math.min(1, (counts - from) / span)) * (width - names - margin);

  const pathTop = 18;
  const signalsTop = pathTop + Math.max(1, path.length) * legHeight + 10;
  const height = signalsTop + 4 * 20;
  const marks: number[] = [];
  if (span / turn <= 60 && !(isSchematic && geometry.index_at === null)) for (let k = Math.ceil((from - (geometry.index_at ?? 0)) / turn); k * turn + (geometry.index_at ?? 0) <= from + span; ++k) marks.push(k * turn + (geometry.index_at ?? 0));

  const level = (row: number, name: string, spans: [number, number][]) => {
    const low = signalsTop + row * 20 + 14;
    let line = `M${names} ${low}`;
    for (const [a, b] of spans.filter(([left, right]) => right > from && left < from + span && right > left)) line += ` H${at(a)} V${low - 9} H${at(b)} V${low}`;
    return (
      <g className="signal" key={name}>
        <path d={`${line} H${width - margin}`} />
        <text x={names - 6} y={low - 1}>{name}</text>
      </g>
    );
  };
  // A method without legs makes the present position the home position.
  const end = path[path.length - 1] as (typeof path)[number] | undefined;
  const found = method.legs.length === 0 ? start : end && (end.leg.then === undefined || end.leg.then === 'latch') ? end.to : null;
  const foundAt = pathTop + (Math.max(1, path.length) - 0.5) * legHeight;
  const here = pathTop + (Math.min(leg.current, Math.max(0, path.length - 1)) + 0.5) * legHeight;

  return (
    <svg className="homing" viewBox={`0 0 ${width} ${height}`} role="img" aria-label={`Homing method ${method.method}${isSchematic ? ', not to scale' : ''}: ${path.map(({ leg: { direction, until } }) => `${direction} until ${until.replaceAll('_', ' ')}`).join(', then ')}`}>
      <defs>
        <marker id="leg-end" viewBox="0 0 8 8" refX="7" refY="4" markerUnits="userSpaceOnUse" markerWidth="9" markerHeight="9" orient="auto">
          <path d="M0 0 L8 4 L0 8 z" />
        </marker>
      </defs>
      {path.map(({ from: a, to: b, leg: { speed, until } }, i) => {
        const y = pathTop + (i + 0.5) * legHeight;
        return (
          <g key={i} className={`leg ${speed} ${i === leg.current && axis.in_motion && !isSchematic ? 'now' : ''}`}>
            {i > 0 && <path className="turn" d={`M${at(a)} ${y - legHeight} V${y}`} />}
            <path d={`M${at(a)} ${y} H${at(b)}`} markerEnd="url(#leg-end)" />
            <text x={(at(a) + at(b)) / 2} y={y - 4}>{until.replaceAll('_', ' ')}</text>
          </g>
        );
      })}
      <circle className="begin" cx={at(start)} cy={pathTop + 0.5 * legHeight} r="4" />
      {found !== null && (
        <g className="found">
          <circle cx={at(found)} cy={foundAt} r="10" />
          <text x={at(found)} y={foundAt + 4}>{method.method}</text>
        </g>
      )}
      {!isSchematic && <path className="here" d={`M${at(axis.position_counts)} ${here - 8} V${height}`} />}
      {!isSchematic && <circle className="here" cx={at(axis.position_counts)} cy={here} r="4" />}
      {level(0, 'index', marks.map((mark) => [mark, mark + span / 400]))}
      {level(1, 'home', geometry.home_from !== null && geometry.home_to !== null ? [[geometry.home_from, geometry.home_to]] : [])}
      {level(2, 'negative limit', geometry.negative_limit !== null ? [[from, geometry.negative_limit]] : [])}
      {level(3, 'positive limit', geometry.positive_limit !== null ? [[geometry.positive_limit, from + span]] : [])}
    </svg>
  );
}
