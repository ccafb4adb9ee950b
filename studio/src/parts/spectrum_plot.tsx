import { useMemo, useRef, useState } from 'react';
import { fileNameOf, labelOf, span, zoomed, type Samples } from '../model/scope';
import { peaks, spectrum, windows } from '../model/spectrum';
import { significant } from '../model/units';
import { keep, useRoute } from '../route';
import { Button, Choice, Scroll } from './controls';
import { Lanes, swatchOf } from './lanes';
import { savePicture } from './save';

const nothing = new Float64Array();

// The mean is in the table. In the plot it would be far above all lines.
const withoutMean = (amplitude: Float64Array) => amplitude.map((value, k) => (k === 0 ? NaN : value));

// Amplitude spectra of the channels: between the cursors if both are set, else of the visible range.
export function SpectrumPlot({ label, samples, part }: { label: string; samples: Samples; part: [number, number] | null }) {
  const { query } = useRoute();
  const box = useRef<HTMLDivElement>(null);
  const [range, setRange] = useState<[number, number] | null>(null);
  const window = windows.find(({ id }) => id === query.get('win')) ?? windows[0];
  const { recording, x, values, interval_ms } = samples;
  const [from, to] = part ?? [NaN, NaN];
  const spectra = useMemo(() => {
    const [first, last] = Number.isFinite(from) ? span(x, from, to) : [0, x.length];
    return values.map((each) => spectrum(each, 1000 / interval_ms, window, first, last));
  }, [values, x, interval_ms, window, from, to]);
  const there = spectra.flatMap((each, i) => (typeof each === 'string' ? [] : [{ channel: recording.channels[i], tone: i, found: each }]));
  const hz = there[0]?.found.hz ?? nothing;
  const curves = useMemo(() => spectra.flatMap((each, i) => (typeof each === 'string' ? [] : [{ name: labelOf(recording.channels[i]), unit: recording.channels[i].unit, tone: i, values: withoutMean(each.amplitude) }])), [spectra, recording.channels]);
  return (
    <>
      <div ref={box}>
        <Lanes fill label={`${label}, spectrum`} x={hz} curves={curves} range={range} onRange={setRange} unit="Hz" />
      </div>
      <div className="toolbar wide">
        <Choice label="Window" value={window.id} options={windows.map(({ id, name, use }) => [id, `${name}: ${use}`] as const)} onChange={(id) => keep({ win: id === windows[0].id ? null : id })} />
        <span className="quiet">{part ? 'of the part between the cursors, or the visible one' : 'of the whole recording'}{hz.length > 1 && `, a line each ${significant(hz[1])} Hz`}</span>
        <span className="grow" />
        <div className="buttons" role="group" aria-label="Zoom">
          <Button aria-label="Lower" isDisabled={!range} onPress={() => setRange(zoomed(hz, range, 1, -0.5))}>◀</Button>
          <Button aria-label="Higher" isDisabled={!range} onPress={() => setRange(zoomed(hz, range, 1, 0.5))}>▶</Button>
          <Button aria-label="Zoom in" onPress={() => setRange(zoomed(hz, range, 0.5, range ? 0 : -0.5))}>+</Button>
          <Button aria-label="Zoom out" isDisabled={!range} onPress={() => setRange(zoomed(hz, range, 2))}>−</Button>
          <Button isDisabled={!range} onPress={() => setRange(null)}>All</Button>
        </div>
        <Button onPress={() => box.current && savePicture(box.current, `${fileNameOf(recording)}-spectrum.png`)}>PNG</Button>
      </div>
      <Scroll label="Lines of the spectra">
        <table className="table" aria-label="Spectrum">
          <thead>
            <tr><th scope="col" className="wide">channel</th><th scope="col" className="wide">unit</th><th scope="col">mean</th><th scope="col" className="wide">largest amplitudes</th></tr>
          </thead>
          <tbody>
            {spectra.map((each, i) => {
              const channel = recording.channels[i];
              return (
                <tr key={labelOf(channel)}>
                  <th scope="row"><span className={swatchOf(i)} aria-hidden="true" /> {labelOf(channel)}</th>
                  <td className="text">{channel.unit}</td>
                  <td>{typeof each === 'string' ? '–' : significant(each.amplitude[0])}</td>
                  <td className="text">{typeof each === 'string' ? each : peaks(each).map((line) => `${significant(line.amplitude)} at ${significant(line.hz)} Hz`).join('; ') || 'none'}</td>
                </tr>
              );
            })}
          </tbody>
        </table>
      </Scroll>
    </>
  );
}
