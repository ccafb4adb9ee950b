import { memo, useEffect, useRef, useState } from 'react';
import { coupledWith, visibleRows } from '../model/machine';
import { fixed } from '../model/units';
import { Commands, positionOf, usePositionLabel } from '../pages/line';
import { useAxis } from '../store';
import { Link } from './controls';
import { Dial } from './mechanism';
import { StateChip } from './state';
import { Travel, useGeometry } from './travel';

const columns = ['axis', 'state', 'travel', 'position', 'velocity', 'torque', 'fault', 'commands'];
const usual_px = 40;

// The axes of a large line. All rows have the same height, which line.css defines, so only the visible rows are rendered.
export function AxisRows({ names }: { names: string[] }) {
  const box = useRef<HTMLDivElement>(null);
  const [top, setTop] = useState(0);
  const [height, setHeight] = useState(600);
  const [row_px, setRow] = useState(usual_px);
  const positionLabel = usePositionLabel();
  useEffect(() => {
    const observer = new ResizeObserver(([entry]) => {
      setHeight(entry.contentRect.height);
      setRow(Number(getComputedStyle(entry.target).getPropertyValue('--row-px')) || usual_px);
    });
    observer.observe(box.current!);
    return () => observer.disconnect();
  }, []);
  const [first, end] = visibleRows(top, height, row_px, names.length);
  return (
    <section className="panel axis-rows" aria-label="Axes">
      <div role="table" aria-label="Axes" aria-rowcount={names.length + 1}>
        <div role="rowgroup">
          <div role="row" className="axis-row head" aria-rowindex={1}>
            {columns.map((column) => <span key={column} role="columnheader" className={`of-${column}`}>{column === 'position' ? positionLabel : column}</span>)}
          </div>
        </div>
        {/* The keyboard scrolls the rows. */}
        {/* eslint-disable-next-line jsx-a11y/no-noninteractive-tabindex */}
        <div role="rowgroup" className="row-box" ref={box} tabIndex={0} onScroll={(event) => setTop(event.currentTarget.scrollTop)}>
          <div role="presentation" style={{ height: names.length * row_px, paddingTop: first * row_px }}>
            {names.slice(first, end).map((name, i) => <AxisRow key={name} name={name} index={first + i + 2} />)}
          </div>
        </div>
      </div>
      {names.length === 0 && <p className="empty">No axis fits the filter.</p>}
    </section>
  );
}

const AxisRow = memo(function AxisRow({ name, index }: { name: string; index: number }) {
  const axis = useAxis(name);
  const geometry = useGeometry(name);
  if (!axis) return null;
  const faults = (axis.faults ?? []).map(({ code, name: text }) => `${code.replace('0x', '')}h ${text}`).join('; ');
  const { value, unit } = positionOf(axis, geometry);
  const speed = axis.velocity === undefined ? `${fixed(axis.velocity_rpm, 1)} rpm` : `${fixed(axis.velocity, 0)} /s`;
  const torque = axis.torque_percent === undefined ? `${fixed(axis.torque_nm, 3)} Nm` : `${fixed(axis.torque_percent, 1)} %`;
  return (
    <div role="row" className="axis-row" aria-rowindex={index}>
      <span role="rowheader" className="of-axis"><Link to={`/axis/${encodeURIComponent(name)}`}>{name}</Link> <span className="quiet">{[axis.product, coupledWith(axis)].filter(Boolean).join(', ')}</span></span>
      <span role="cell" className="of-state"><StateChip axis={axis} /></span>
      <span role="cell" className="of-travel"><Dial axis={axis} geometry={geometry} size={32} /><Travel axis={axis} geometry={geometry} /></span>
      <span role="cell" className="of-position">{value} {unit}</span>
      <span role="cell" className="of-velocity">{speed}</span>
      <span role="cell" className="of-torque">{torque}</span>
      <span role="cell" className="of-fault">{faults && <Link to={`/faults/${encodeURIComponent(name)}`} title={faults}>{faults}</Link>}</span>
      <span role="cell" className="of-commands"><Commands axis={axis} /></span>
    </div>
  );
});
