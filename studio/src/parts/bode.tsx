import { useMemo, useRef, useState } from 'react';
import type { Recording } from '../api/types';
import { at, coherentValues, csvOf, firstPlot, gapNote, isCoherent, type Bode, type BodePoint } from '../model/bode';
import { labelOf } from '../model/scope';
import { fixed, significant } from '../model/units';
import { useResource } from '../resource';
import { Button, Choice, Readout, Scroll, Toggle, Trouble } from './controls';
import { NumberInput } from './number_input';
import { Lanes, type Curve } from './lanes';
import { savePicture, saveText } from './save';

// The frequency response between two channels of a recording, with that of an earlier recording of the same channels as an
// overlay.
export function BodePlot({ recording, earlier }: { recording: Recording; earlier: Recording | undefined }) {
  const [first, second] = firstPlot(recording.channels);
  const [input, setInput] = useState(first);
  const [output, setOutput] = useState(second);
  const [open, setOpen] = useState(false);
  const [a, setA] = useState<number | null>(null);
  const [b, setB] = useState<number | null>(null);
  const box = useRef<HTMLDivElement>(null);
  const query = `bode?input=${input}&output=${output}&from_hz=1&to_hz=1000`;
  const { value, problem } = useResource<Bode>(`/recordings/${recording.id}/${query}`);
  const fits = earlier !== undefined && earlier.channels[input]?.name === recording.channels[input].name && earlier.channels[output]?.name === recording.channels[output].name;
  const before = useResource<Bode>(fits ? `/recordings/${earlier.id}/${query}` : null).value;
  const pointsOf = (bode: Bode | undefined): BodePoint[] => (open && bode?.open_loop ? bode.open_loop.points : (bode?.points ?? []));
  const points = pointsOf(value);
  const earlierPoints = pointsOf(before);
  const x = useMemo(() => points.map(({ hz }) => hz), [points]);
  const curves: Curve[] = useMemo(() => {
    const own: Curve[] = [
      { name: 'gain', unit: 'dB', tone: 0, values: coherentValues(points, (point) => point.gain_db) },
      { name: 'phase', unit: '°', tone: 1, values: coherentValues(points, (point) => point.phase_deg) },
      ...(points[0]?.coherence === undefined ? [] : [{ name: 'coherence', unit: 'coherence', tone: 2, values: points.map((point) => point.coherence ?? NaN) }]),
    ];
    if (earlierPoints.length === 0) return own;
    const beside = x.map((hz) => at(earlierPoints, hz));
    return [
      ...own,
      { name: `gain, recording ${before?.recording}`, unit: 'dB', tone: 0, values: coherentValues(beside, (point) => point.gain_db), faint: true },
      { name: `phase, recording ${before?.recording}`, unit: '°', tone: 1, values: coherentValues(beside, (point) => point.phase_deg), faint: true },
    ];
  }, [points, earlierPoints, x, before]);

  const gaps = gapNote(points);
  const channels = recording.channels.map((channel, i) => [i, labelOf(channel)] as const);
  const file = `bode-${recording.id}${open && value?.open_loop ? '-open' : ''}`;
  const cursors: [string, number | null, (hz: number | null) => void][] = [['Cursor A', a, setA], ['Cursor B', b, setB]];
  return (
    <div className="bode">
      <div className="toolbar">
        <Choice label="Input" value={input} options={channels} onChange={setInput} />
        <Choice label="Output" value={output} options={channels} onChange={setOutput} />
        {value?.open_loop && <Toggle isSelected={open} onChange={setOpen}>open loop</Toggle>}
        {cursors.map(([label, hz, set]) => (
          <NumberInput whenLeft mayBeEmpty key={label} label={label} unit="Hz" value={hz ?? NaN} minimum={0} onChange={(to) => set(Number.isFinite(to) && to > 0 ? to : null)} />
        ))}
        <span className="grow" />
        <Button isDisabled={points.length < 2} onPress={() => saveText(csvOf(points), `${file}.csv`)}>CSV</Button>
        <Button isDisabled={points.length < 2} onPress={() => box.current && savePicture(box.current, `${file}.png`)}>PNG</Button>
      </div>
      <Trouble problem={problem} />
      {points.length > 1 && (
        <div ref={box}>
          <Lanes label="Bode plot" x={x} curves={curves} range={null} unit="Hz" logarithmic cursors={[a, b]} onCursor={(which, hz) => (which === 0 ? setA : setB)(Number(hz.toPrecision(4)))} />
        </div>
      )}
      {value && points.length <= 1 && <p className="empty">The input signal has no excitation: record a sweep or a step.</p>}
      {gaps && <p className="quiet note">{gaps}</p>}
      {value?.open_loop && <Margins bode={value} before={before} />}
      <Scroll label="Values at the cursors">
        <table className="table" aria-label="Response">
          <caption>{a === null && b === null ? 'Click in the plot: cursor A; Shift and click: cursor B' : 'at the cursors'}</caption>
          <thead><tr><th scope="col">cursor</th><th scope="col">frequency, Hz</th><th scope="col">gain, dB</th><th scope="col">gain</th><th scope="col">phase, °</th><th scope="col">coherence</th></tr></thead>
          <tbody>
            {cursors.map(([label, hz]) => {
              const there = hz === null ? null : at(points, hz);
              const point = there && isCoherent(there) ? there : null;
              return (
                <tr key={label}>
                  <th scope="row">{label.slice(-1)}</th>
                  <td>{hz === null ? '–' : significant(hz)}</td>
                  <td>{point ? fixed(point.gain_db, 2) : '–'}</td>
                  <td>{point ? significant(10 ** (point.gain_db / 20)) : '–'}</td>
                  <td>{point ? fixed(point.phase_deg, 1) : '–'}</td>
                  <td>{there?.coherence === undefined ? '–' : fixed(there.coherence, 3)}</td>
                </tr>
              );
            })}
          </tbody>
        </table>
      </Scroll>
    </div>
  );
}

function Margins({ bode, before }: { bode: Bode; before: Bode | undefined }) {
  const rows: [string, string, (from: Bode) => number | null | undefined, number, string][] = [
    ['Bandwidth', 'Hz', ({ bandwidth_hz }) => bandwidth_hz, 1, 'closed loop, -3 dB'],
    ['Crossover', 'Hz', ({ open_loop }) => open_loop?.crossover_hz, 1, 'open loop, 0 dB'],
    ['Phase margin', '°', ({ open_loop }) => open_loop?.phase_margin_deg, 1, 'open loop, at the crossover'],
    ['Gain margin', 'dB', ({ open_loop }) => open_loop?.gain_margin_db, 1, 'open loop, at -180°'],
  ];
  const text = (value: number | null | undefined, digits: number) => (value === null || value === undefined ? '–' : fixed(value, digits));
  return (
    <dl className="readouts" aria-label="Margins">
      {rows.map(([label, unit, of, digits, title]) => (
        <Readout key={label} label={before ? `${label} (now, earlier)` : label} title={title} unit={unit} value={before ? `${text(of(bode), digits)}, ${text(of(before), digits)}` : text(of(bode), digits)} />
      ))}
    </dl>
  );
}
