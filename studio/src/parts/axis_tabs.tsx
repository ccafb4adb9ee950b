import { toneOf } from '../model/cia402';
import { go } from '../route';
import { useLine } from '../store';
import { Choice, Link } from './controls';

// Selects the axis of a page: links for up to 10 axes, a list for more.
export function AxisTabs({ page, name }: { page: string; name: string }) {
  const order = useLine((line) => line.order);
  const to = (axis: string) => `/${page}/${encodeURIComponent(axis)}`;
  if (order.length > 10) {
    return <Choice label="Axis" value={name} options={order.map((axis) => [axis, axis] as const)} onChange={(axis) => go(to(axis))} />;
  }
  return (
    <nav className="tabs axes" aria-label="Axes">
      {order.map((axis) => (
        <Link key={axis} to={to(axis)} {...(axis === name ? { 'aria-current': 'page' as const } : {})}>
          <Dot axis={axis} /> {axis}
        </Link>
      ))}
    </nav>
  );
}

function Dot({ axis }: { axis: string }) {
  const state = useLine((line) => line.axes[axis]?.powered ? line.axes[axis].state : undefined);
  return <span className={`dot ${toneOf(state)}`} aria-hidden="true" />;
}

// The axis `name` of the address if the line has it, else the line's first axis.
export function usePageAxis(name: string): string {
  return useLine((line) => (line.order.includes(name) ? name : line.order[0]));
}
