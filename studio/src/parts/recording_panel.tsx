import { useMemo, useRef } from 'react';
import { post } from '../api/client';
import type { Recording } from '../api/types';
import { formulaOf, mathsOf } from '../model/formula';
import { withMaths } from '../model/mathematics';
import { eventful } from '../model/measure';
import { parquetOf } from '../model/parquet';
import { alongside, fileNameOf, isOver, labelOf, same, titleOf, zoomed, type Samples } from '../model/scope';
import { fixed, significant } from '../model/units';
import { attempt } from '../notices';
import { keep, useRoute } from '../route';
import { BodePlot } from './bode';
import { Button, Panel } from './controls';
import { Lanes, type Curve } from './lanes';
import { MeasureTable } from './measure_table';
import { NumberInput } from './number_input';
import { SampledList } from './sampled_list';
import { saveBytes, savePicture } from './save';
import { SpectrumPlot } from './spectrum_plot';
import { XyPlot } from './xy';

const plots = [[null, 'Time'], ['xy', 'XY'], ['fft', 'Spectrum'], ['bode', 'Bode']] as const;

// The part of a recording that the address selects: cursors and the visible range, in ms.
function usePlaces() {
  const { query } = useRoute();
  const [a, b, from, to] = ['a', 'b', 'from', 'to'].map((key) => (query.get(key) === null ? null : Number(query.get(key))));
  const range = useMemo<[number, number] | null>(() => (from !== null && to !== null ? [from, to] : null), [from, to]);
  return { a, b, range };
}

export function RecordingPanel({ recording, samples, others }: { recording: Recording; samples: Samples | null; others: Samples[] }) {
  const { query } = useRoute();
  const title = titleOf(recording);
  const math = query.get('math');
  const maths = useMemo(() => mathsOf(math).filter(({ formula }) => typeof formulaOf(formula, recording.channels.length) === 'function'), [math, recording.channels.length]);
  const shown = useMemo(() => samples && withMaths(samples, maths), [samples, maths]);
  const laid = useMemo(() => others.map((other) => withMaths(other, maths)), [others, maths]);
  const plot = query.get('plot');
  return (
    <Panel
      title={title}
      aside={
        <>
          <span className="quiet" role="status">
            {recording.state}
            {isOver(recording) && `, ${fixed(recording.samples, 0)} samples of ${recording.channels.length} channels, ${fixed((1000 * recording.samples) / recording.rate_hz, 0)} ms at ${fixed(recording.rate_hz, 0)} Hz`}
          </span>
          {!isOver(recording) && <Button onPress={() => attempt(() => post(`/recordings/${recording.id}/stop`))}>Stop</Button>}
          <div className="segments" role="group" aria-label="Plot">
            {plots.map(([id, text]) => (
              <button key={text} type="button" aria-pressed={plot === id} onClick={() => keep({ plot: id })}>{text}</button>
            ))}
          </div>
          <Button kind="bare" onPress={() => keep({ rec: null, plot: null, a: null, b: null, from: null, to: null, with: null })}>Live</Button>
        </>
      }
    >
      {!shown ? (
        <p className="empty">{isOver(recording) ? 'Loading.' : recording.state === 'armed' ? 'Armed: waiting for the trigger.' : 'Recording.'}</p>
      ) : (
        <Plot plot={plot} title={title} samples={shown} others={laid} />
      )}
    </Panel>
  );
}

function Plot({ plot, title, samples, others }: { plot: string | null; title: string; samples: Samples; others: Samples[] }) {
  const { a, b, range } = usePlaces();
  const { recording } = samples;
  if (plot === 'bode') {
    // The server computes the plot from the channels that it recorded.
    const recorded = { ...recording, channels: recording.channels.filter(({ axis }) => axis !== '') };
    return <BodePlot key={recording.id} recording={recorded} earlier={others[0]?.recording} />;
  }
  if (plot === 'xy') return <XyPlot label={title} samples={samples} others={others} range={range} />;
  if (plot === 'fft') return <SpectrumPlot label={title} samples={samples} part={a !== null && b !== null && a !== b ? [a, b] : range} />;
  return <TimePlot title={title} samples={samples} others={others} />;
}

function curvesOf(samples: Samples, others: Samples[]): Curve[] {
  const { channels } = samples.recording;
  const own = channels.map((channel, i) => ({ name: labelOf(channel), unit: channel.unit, tone: i, values: samples.values[i] }));
  const laid = others.flatMap((other, n) =>
    other.recording.channels.flatMap((channel, i) => {
      const tone = channels.findIndex((each) => same(each, channel));
      if (tone < 0 || other.values[i].length === 0) return [];
      return [{ name: `${labelOf(channel)}, recording ${other.recording.id}`, unit: channels[tone].unit, tone, values: alongside(samples.x, other, other.values[i]), faint: n + 1 }];
    }),
  );
  return [...own, ...laid];
}

function TimePlot({ title, samples, others }: { title: string; samples: Samples; others: Samples[] }) {
  const box = useRef<HTMLDivElement>(null);
  const { a, b, range } = usePlaces();
  const { recording, x } = samples;
  const curves = useMemo(() => curvesOf(samples, others), [samples, others]);
  const show = (zoom: [number, number] | null) => keep({ from: zoom ? zoom[0].toFixed(4) : null, to: zoom ? zoom[1].toFixed(4) : null });
  const fit = () => {
    const part = eventful(samples.values);
    show(part && [x[part[0]], x[Math.min(part[1], x.length - 1)]]);
  };
  const name = fileNameOf(recording);
  // The cursors stay in the recording, to the millisecond.
  const [first, last] = x.length > 0 ? [Math.floor(x[0]), Math.ceil(x[x.length - 1])] : [undefined, undefined];
  const setCursor = (key: string, at: number) => keep({ [key]: Math.max(first ?? at, Math.min(last ?? at, at)).toFixed(4) });
  return (
    <>
      <div ref={box}>
        <Lanes fill label={title} x={x} curves={curves} range={range} onRange={show} cursors={[a, b]} onCursor={(which, at) => setCursor(which === 0 ? 'a' : 'b', at)} />
      </div>
      <div className="toolbar cursors">
        <NumberInput whenLeft mayBeEmpty label="Cursor A" unit="ms" value={a ?? NaN} minimum={first} maximum={last} onChange={(at) => keep({ a: Number.isFinite(at) ? String(at) : null })} />
        <NumberInput whenLeft mayBeEmpty label="Cursor B" unit="ms" value={b ?? NaN} minimum={first} maximum={last} onChange={(at) => keep({ b: Number.isFinite(at) ? String(at) : null })} />
        <span className="quiet">Δ {a !== null && b !== null ? `${significant(b - a)} ms, ${significant(1000 / Math.abs(b - a))} Hz` : '–'}</span>
        <span className="grow" />
        <div className="buttons" role="group" aria-label="Zoom">
          <Button aria-label="Earlier" isDisabled={!range} onPress={() => show(zoomed(x, range, 1, -0.5))}>◀</Button>
          <Button aria-label="Later" isDisabled={!range} onPress={() => show(zoomed(x, range, 1, 0.5))}>▶</Button>
          <Button aria-label="Zoom in" onPress={() => show(zoomed(x, range, 0.5))}>+</Button>
          <Button aria-label="Zoom out" isDisabled={!range} onPress={() => show(zoomed(x, range, 2))}>−</Button>
          <Button onPress={fit}>Fit</Button>
          <Button isDisabled={a === null || b === null || a === b} onPress={() => a !== null && b !== null && show([Math.min(a, b), Math.max(a, b)])}>A to B</Button>
          <Button isDisabled={!range} onPress={() => show(null)}>All</Button>
        </div>
        <div className="buttons" role="group" aria-label="Save as">
          <a className="button" href={`/api/v1/recordings/${recording.id}/data.csv`} download={`${name}.csv`}>CSV</a>
          <a className="button" href={`/api/v1/recordings/${recording.id}/data.mcap`} download={`${name}.mcap`}>MCAP</a>
          <Button onPress={() => attempt(async () => saveBytes(await parquetOf(samples), `${name}.parquet`))}>Parquet</Button>
          <Button onPress={() => box.current && savePicture(box.current, `${name}.png`)}>PNG</Button>
        </div>
      </div>
      <MeasureTable samples={samples} a={a} b={b} range={range} />
      <SampledList recording={recording} />
      <p className="quiet note">Click: cursor A; Shift and click: cursor B; drag, or Ctrl and wheel: zoom; double click: show all.</p>
    </>
  );
}
