import { useEffect, useMemo, useRef } from 'react';
import uPlot from 'uplot';
import { fileNameOf, labelOf, same, span, type Samples } from '../model/scope';
import { ticksText } from '../model/units';
import { keep, useRoute } from '../route';
import { Button, Choice } from './controls';
import { useLooks } from './lanes';
import { savePicture } from './save';

interface Path {
  x: Float64Array;
  y: Float64Array;
}

const font = '11px system-ui, sans-serif';

// One channel over another, of the visible part of the recording, and the same two channels of the overlays.
export function XyPlot({ label, samples, others, range }: { label: string; samples: Samples; others: Samples[]; range: [number, number] | null }) {
  const { query } = useRoute();
  const box = useRef<HTMLDivElement>(null);
  const { channels } = samples.recording;
  const chosen = (key: string, otherwise: number) => Math.min(channels.length - 1, Math.max(0, Math.trunc(Number(query.get(key) ?? otherwise)) || 0));
  const [across, up] = [chosen('px', 0), chosen('py', 1)];
  const paths = useMemo(() => {
    const of = (each: Samples, i: number, j: number): Path => {
      const [from, to] = range ? span(each.x, range[0], range[1]) : [0, each.x.length];
      return { x: each.values[i].subarray(from, to), y: each.values[j].subarray(from, to) };
    };
    const laid = others.flatMap((other) => {
      const [i, j] = [across, up].map((k) => other.recording.channels.findIndex((each) => same(each, channels[k])));
      return i < 0 || j < 0 ? [] : [of(other, i, j)];
    });
    return [of(samples, across, up), ...laid];
  }, [samples, others, channels, across, up, range]);
  const options = channels.map((channel, i) => [i, labelOf(channel)] as const);
  const titles = [across, up].map((i) => `${labelOf(channels[i])}${channels[i].unit && `, ${channels[i].unit}`}`);
  return (
    <>
      <div ref={box} className="lanes fill" role="img" aria-label={`${label}: ${labelOf(channels[up])} over ${labelOf(channels[across])}`}>
        <Paths paths={paths} across={titles[0]} up={titles[1]} />
      </div>
      <div className="toolbar wide">
        <Choice label="Across" value={across} options={options} onChange={(to) => keep({ px: String(to) })} />
        <Choice label="Up" value={up} options={options} onChange={(to) => keep({ py: String(to) })} />
        <Button onPress={() => keep({ px: String(up), py: String(across) })}>Swap</Button>
        <span className="grow" />
        <Button onPress={() => box.current && savePicture(box.current, `${fileNameOf(samples.recording)}-xy.png`)}>PNG</Button>
      </div>
      <p className="quiet note">Of the part that is visible in the plot over time.</p>
    </>
  );
}

// All numbers of the paths' x (or y), with a margin; a path without numbers gives 0 to 1.
function extent(paths: Path[], key: keyof Path): [number, number] {
  let [from, to] = [Infinity, -Infinity];
  for (const path of paths) {
    for (const value of path[key]) {
      if (value < from) from = value;
      if (value > to) to = value;
    }
  }
  if (from > to) return [0, 1];
  const margin = (to - from) * 0.04 || Math.abs(to) * 0.1 || 1;
  return [from - margin, to + margin];
}

function Paths({ paths, across, up }: { paths: Path[]; across: string; up: string }) {
  const box = useRef<HTMLDivElement>(null);
  const look = useLooks();
  useEffect(() => {
    const element = box.current!;
    const size = () => ({ width: Math.max(100, element.clientWidth), height: element.clientHeight });
    const axis = { stroke: look.ink, font, grid: { stroke: look.grid, width: 1 }, ticks: { stroke: look.grid, width: 1, size: 4 }, labelFont: font, labelGap: 0, values: (_: uPlot, ticks: (number | null)[]) => ticksText(ticks) };
    const draw = (u: uPlot) => {
      const { ctx, bbox } = u;
      ctx.save();
      ctx.beginPath();
      ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
      ctx.clip();
      paths.forEach(({ x, y }, n) => {
        ctx.beginPath();
        let isDown = false;
        for (let i = 0; i < x.length; ++i) {
          const isPoint = Number.isFinite(x[i]) && Number.isFinite(y[i]);
          if (isPoint) ctx[isDown ? 'lineTo' : 'moveTo'](u.valToPos(x[i], 'x', true), u.valToPos(y[i], 'y', true));
          isDown = isPoint;
        }
        ctx.strokeStyle = look.curves[n % look.curves.length];
        ctx.lineWidth = devicePixelRatio * (n === 0 ? 1.5 : 1);
        ctx.lineJoin = 'round';
        ctx.stroke();
      });
      ctx.restore();
    };
    const made = new uPlot(
      {
        ...size(),
        padding: [8, 18, 4, 4],
        legend: { show: false },
        cursor: { show: false },
        scales: { x: { time: false, range: () => extent(paths, 'x') }, y: { range: () => extent(paths, 'y') } },
        axes: [{ ...axis, size: 32, label: across, labelSize: 16 }, { ...axis, size: 62, label: up, labelSize: 16 }],
        series: [{}, { show: true, points: { show: false }, paths: () => null }],
        hooks: { draw: [draw] },
      },
      // These data only set the scales: draw() draws the paths, because their x is not monotonic.
      [[0, 1], [0, 1]],
      element,
    );
    const observer = new ResizeObserver(() => made.setSize(size()));
    observer.observe(element);
    return () => {
      observer.disconnect();
      made.destroy();
    };
  }, [paths, look, across, up]);
  return <div className="lane" ref={box} />;
}
