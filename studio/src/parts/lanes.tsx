import { useEffect, useRef, useState } from 'react';
import uPlot from 'uplot';
import 'uplot/dist/uPlot.min.css';
import { gaps } from '../model/gaps';
import { decadeTicks, isLabelled, ticksText } from '../model/units';
import { color } from '../theme';

// Curves over a common x axis, with a lane and a scale for each unit.

export interface Curve {
  name: string;
  unit: string;
  tone: number; // index of the colour in the palette
  values: ArrayLike<number>;
  faint?: boolean | number; // a curve of another recording; a number, from 1: of which of the overlays
}

export interface LanesProps {
  x: ArrayLike<number>;
  curves: Curve[];
  range: [number, number] | null; // visible range of x; null: all
  onRange?: (range: [number, number] | null) => void;
  cursors?: [number | null, number | null];
  onCursor?: (which: 0 | 1, x: number) => void;
  laneHeight?: number;
  fill?: boolean; // true: the lanes share the height that the window has
  unit?: string; // unit of x
  logarithmic?: boolean; // logarithmic x axis; x must be positive
  label: string;
}

const tones = 8;
export const swatchOf = (tone: number) => `swatch tone-${tone % tones}${tone >= tones ? ' dashed' : ''}`;
// Dashes tell overlays apart, since they have the colours of the present curves.
const overlayDashes = [[], [7, 3], [2, 3], [9, 3, 2, 3]];
const toneNames = Array.from({ length: tones }, (_, i) => `curve-${i}`);

interface Looks {
  ink: string;
  grid: string;
  cursor: string;
  curves: string[];
}

function looks(): Looks {
  return { ink: color('ink-2'), grid: color('grid'), cursor: color('accent'), curves: toneNames.map(color) };
}

export function useLooks(): Looks {
  const [now, set] = useState(looks);
  useEffect(() => {
    const renew = () => set(looks());
    const media = matchMedia('(prefers-color-scheme: dark)');
    addEventListener('theme', renew);
    media.addEventListener('change', renew);
    return () => {
      removeEventListener('theme', renew);
      media.removeEventListener('change', renew);
    };
  }, []);
  return now;
}

export function Lanes(props: LanesProps) {
  const keys = [...new Set(props.curves.map(laneOf))];
  return (
    <div className={props.fill ? 'lanes fill' : 'lanes'} role="img" aria-label={`${props.label}: ${props.curves.map(({ name }) => name).join(', ')}`}>
      {keys.map((key, i) => {
        const curves = props.curves.filter((curve) => laneOf(curve) === key);
        return <Lane key={key} {...props} curves={curves} last={i === keys.length - 1} title={curves[0].unit} />;
      })}
    </div>
  );
}

// A following error has the unit of the position but is much smaller, so it gets a lane of its own.
const laneOf = ({ unit, name }: Curve) => (/error|deviation/.test(name) ? `${unit}, error` : unit);

const font = '11px system-ui, sans-serif';

function Lane({ x, curves, range, onRange, cursors, onCursor, laneHeight = 150, fill = false, last, title, unit = 'ms', logarithmic = false }: LanesProps & { last: boolean; title: string }) {
  const box = useRef<HTMLDivElement>(null);
  const plot = useRef<uPlot | null>(null);
  const look = useLooks();
  // The latest properties, for the callbacks of a uPlot that was created earlier.
  const now = useRef({ range, onRange, cursors, onCursor, x });
  now.current = { range, onRange, cursors, onCursor, x };
  const shape = JSON.stringify(curves.map(({ name, tone, faint }) => [name, tone, faint]));

  useEffect(() => {
    const element = box.current!;
    const asked = JSON.parse(shape) as [string, number, (boolean | number)?][];
    // With many curves the lines are one pixel wide, because the browser draws these faster: it fills wider lines as shapes.
    // Without a GPU, sixteen noisy curves with wide lines reach only 13 frames per second.
    const many = asked.length > tones;
    const series = asked.map(([name, tone, faint]) => ({
      label: name,
      stroke: look.curves[tone % tones],
      width: faint || many ? 1 : 1.5,
      alpha: faint ? 0.6 : 1,
      dash: faint ? overlayDashes[(Number(faint) - 1) % overlayDashes.length] : tone >= tones ? [6, 4] : [],
      points: { show: false },
    }));
    const axis = { stroke: look.ink, font, grid: { stroke: look.grid, width: 1 }, ticks: { stroke: look.grid, width: 1, size: 4 } };
    const decades = {
      splits: (_: uPlot, _axis: number, min: number, max: number) => decadeTicks(min, max),
      filter: (u: uPlot, ticks: number[]) => {
        const { min = 1, max = 10 } = u.scales.x;
        const decade = u.bbox.width / devicePixelRatio / Math.log10(max / min);
        return ticks.map((tick) => (isLabelled(tick, decade) ? tick : null));
      },
    };
    const mark = (u: uPlot, at: number | null | undefined, text: string, stroke: string, dash: number[]) => {
      if (at === null || at === undefined) return;
      const place = Math.round(u.valToPos(at, 'x', true));
      if (place < u.bbox.left || place > u.bbox.left + u.bbox.width) return;
      const ratio = devicePixelRatio;
      u.ctx.save();
      u.ctx.strokeStyle = stroke;
      u.ctx.fillStyle = stroke;
      u.ctx.lineWidth = ratio;
      u.ctx.setLineDash(dash.map((d) => d * ratio));
      u.ctx.beginPath();
      u.ctx.moveTo(place, u.bbox.top);
      u.ctx.lineTo(place, u.bbox.top + u.bbox.height);
      u.ctx.stroke();
      u.ctx.font = `${11 * ratio}px system-ui, sans-serif`;
      u.ctx.fillText(text, place + 3 * ratio, u.bbox.top + 11 * ratio);
      u.ctx.restore();
    };
    // Above the curves, so that a name covers none.
    const legend = (u: uPlot) => {
      const ratio = devicePixelRatio;
      u.ctx.save();
      u.ctx.font = `${11 * ratio}px system-ui, sans-serif`;
      u.ctx.textAlign = 'right';
      let right = u.bbox.left + u.bbox.width - 4 * ratio;
      for (const { label, stroke, alpha, dash } of [...series].reverse()) {
        if (alpha < 1) continue;
        const text = dash.length > 0 ? `- - ${label}` : label;
        u.ctx.fillStyle = stroke;
        u.ctx.fillText(text, right, u.bbox.top - 5 * ratio);
        right -= u.ctx.measureText(text).width + 12 * ratio;
        if (right < u.bbox.left + u.bbox.width / 3) break;
      }
      u.ctx.restore();
    };
    const extent = (): [number, number] => {
      const { range: asked, x: all } = now.current;
      return asked ?? (all.length > 1 ? [all[0], all[all.length - 1]] : [0, 1]);
    };
    const size = () => ({ width: Math.max(100, element.clientWidth), height: fill ? element.clientHeight : laneHeight + (last ? 26 : 0) });
    const made = new uPlot(
      {
        ...size(),
        padding: [18, 18, last ? 0 : 4, 0],
        legend: { show: false },
        scales: { x: { time: false, range: extent, distr: logarithmic ? 3 : 1 } },
        axes: [
          { ...axis, size: last ? 30 : 0, ...(logarithmic ? decades : {}), ...(last ? { values: (u: uPlot, ticks: (number | null)[]) => {
            const texts = ticksText(ticks);
            // The unit is beside the last tick with room for it.
            const { min = 0, max = 0 } = u.scales.x;
            const room = logarithmic ? max : max - 0.04 * (max - min);
            const end = texts.map((text, i) => text !== '' && (ticks[i] ?? Infinity) <= room).lastIndexOf(true);
            return texts.map((text, i) => (i === end ? `${text} ${unit}` : text));
          } } : { values: () => [] }) },
          { ...axis, size: 62, space: 22, values: (_, ticks) => ticksText(ticks), label: title, labelSize: 14, labelFont: font, labelGap: 0 },
        ],
        series: [{}, ...series],
        cursor: { sync: { key: 'lanes' }, drag: { x: true, y: false, setScale: false }, y: false, points: { show: false }, bind: { dblclick: () => () => { now.current.onRange?.(null); return null; } } },
        hooks: {
          draw: [
            (u) => {
              legend(u);
              if (!logarithmic) mark(u, 0, '', look.grid, []);
              mark(u, now.current.cursors?.[0], 'A', look.cursor, []);
              mark(u, now.current.cursors?.[1], 'B', look.cursor, [4, 3]);
            },
          ],
          setSelect: [
            (u) => {
              if (u.select.width > 4) now.current.onRange?.([u.posToVal(u.select.left, 'x'), u.posToVal(u.select.left + u.select.width, 'x')]);
              if (u.select.width > 0) u.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
            },
          ],
        },
      },
      [[], ...series.map(() => [])],
      element,
    );
    plot.current = made;
    let pressed = 0;
    made.over.addEventListener('mousedown', (event) => (pressed = event.clientX));
    made.over.addEventListener('click', (event) => {
      if (Math.abs(event.clientX - pressed) > 3) return;
      now.current.onCursor?.(event.shiftKey ? 1 : 0, made.posToVal(event.offsetX, 'x'));
    });
    made.over.addEventListener(
      'wheel',
      (event) => {
        if (!now.current.onRange || !event.ctrlKey) return;
        event.preventDefault();
        const [from, to] = extent();
        const at = made.posToVal(event.offsetX, 'x');
        const factor = event.deltaY < 0 ? 0.8 : 1.25;
        now.current.onRange([at - (at - from) * factor, at + (to - at) * factor]);
      },
      { passive: false },
    );
    const observer = new ResizeObserver(() => made.setSize(size()));
    observer.observe(element);
    return () => {
      observer.disconnect();
      made.destroy();
      plot.current = null;
    };
  }, [shape, look, laneHeight, fill, last, title, unit, logarithmic]);

  useEffect(() => {
    plot.current?.setData([x, ...curves.map(({ values }) => gaps(values))] as uPlot.AlignedData);
  }, [x, curves, shape, look, laneHeight, fill, last, title, unit, logarithmic]);

  const [from, to] = range ?? [NaN, NaN];
  useEffect(() => {
    const u = plot.current;
    if (u && Number.isFinite(from)) u.setScale('x', { min: from, max: to });
    else if (u) u.setData(u.data);
  }, [from, to]);
  const [a, b] = cursors ?? [null, null];
  useEffect(() => plot.current?.redraw(false), [a, b]);

  return <div className="lane" ref={box} />;
}
