import { significant, ticksText } from '../model/units';
import type { PlotCurve } from './measured';

// Curves as SVG, for the page and for the report as a file: lines, axes and texts have classes, colours are in report.css.

const width = 640;
const height = 190;
const edge = { left: 62, right: 12, top: 20, bottom: 28 };

export interface Line extends PlotCurve {
  x: number[];
  look: 'one' | 'two' | 'faint';
}

// Round numbers between two ends.
export function ticksBetween(from: number, to: number, about = 5): number[] {
  const span = to - from;
  if (!(span > 0)) return [from];
  const rough = span / about;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((k) => k * power).find((each) => each >= rough) ?? rough;
  return Array.from({ length: Math.floor(to / step + 1e-9) - Math.ceil(from / step - 1e-9) + 1 }, (_, i) => (Math.ceil(from / step - 1e-9) + i) * step);
}

export function Plot({ title, lines, xUnit }: { title: string; lines: Line[]; xUnit: string }) {
  const xs = lines.flatMap(({ x }) => x);
  const ys = lines.flatMap(({ values }) => values.filter((value) => value !== null));
  if (xs.length < 2 || ys.length < 2) return null;
  const [x0, x1] = [Math.min(...xs), Math.max(...xs)];
  const [low, high] = [Math.min(...ys), Math.max(...ys)];
  const room = (high - low || 1) * 0.06;
  const [y0, y1] = [low - room, high + room];
  const px = (x: number) => edge.left + ((x - x0) / (x1 - x0 || 1)) * (width - edge.left - edge.right);
  const py = (y: number) => height - edge.bottom - ((y - y0) / (y1 - y0)) * (height - edge.top - edge.bottom);
  const path = ({ x, values }: Line) =>
    values.map((value, i) => (value === null ? '' : `${i === 0 || values[i - 1] === null ? 'M' : 'L'}${px(x[i]).toFixed(1)} ${py(value).toFixed(1)}`)).join('');
  const [xTicks, yTicks] = [ticksBetween(x0, x1, 7), ticksBetween(y0, y1, 4)];
  const [xTexts, yTexts] = [ticksText(xTicks), ticksText(yTicks)];
  const { unit } = lines[0];
  const summary = lines.map(({ name, values }) => `${name} up to ${significant(values.reduce<number>((most, value) => Math.max(most, value ?? -Infinity), -Infinity))} ${unit}`).join(', ');
  return (
    <svg className="chart" viewBox={`0 0 ${width} ${height}`} role="img" aria-label={`${title}: ${summary}`}>
      {yTicks.map((tick, i) => (
        <g key={`y${tick}`}>
          <path className="grid" d={`M${edge.left} ${py(tick)} H${width - edge.right}`} />
          <text className="y" x={edge.left - 5} y={py(tick) + 3.5}>{yTexts[i]}</text>
        </g>
      ))}
      {xTicks.map((tick, i) => (
        <g key={`x${tick}`}>
          <path className="grid" d={`M${px(tick)} ${edge.top} V${height - edge.bottom}`} />
          <text className={px(tick) > width - 40 ? 'x end' : 'x'} x={px(tick) > width - 40 ? width - 2 : px(tick)} y={height - edge.bottom + 14}>{xTexts[i]}{i === xTicks.length - 1 ? ` ${xUnit}` : ''}</text>
        </g>
      ))}
      {[...lines].reverse().map((line) => <path key={line.name} className={`line ${line.look}`} d={path(line)} />)}
      <text className="unit" x={edge.left} y={12}>{unit}</text>
      {lines.map(({ name, look }, i) => (
        <g key={name}>
          <path className={`line ${look}`} d={`M${width - 170 * (lines.length - i)} 9 h18`} />
          <text className="name" x={width - 170 * (lines.length - i) + 24} y={12}>{name}</text>
        </g>
      ))}
    </svg>
  );
}
