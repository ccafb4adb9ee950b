import { findStep, statistics, valueAt } from '../model/measure';
import { labelOf, span, type Samples } from '../model/scope';
import { significant } from '../model/units';
import { Scroll } from './controls';
import { swatchOf } from './lanes';

// Levels have the resolution of a thousandth of the step.
function round(level: number, { from, to }: { from: number; to: number }): number {
  const unit = 10 ** Math.floor(Math.log10(Math.abs(to - from)) - 3);
  return Math.round(level / unit) * unit;
}

// Measurements of each channel: between the cursors if both are set, else over the visible range.
export function MeasureTable({ samples, a, b, range }: { samples: Samples; a: number | null; b: number | null; range: [number, number] | null }) {
  const { recording, x, values, interval_ms } = samples;
  if (x.length === 0) return null;
  const between = a !== null && b !== null && a !== b;
  const [from, to] = between ? span(x, a, b) : range ? span(x, range[0], range[1]) : [0, x.length];
  return (
    <Scroll label="Measured values">
      <table className="table measures" aria-label="Measurements">
        <caption>{between ? 'between the cursors' : range ? 'of what is shown' : 'of the whole recording'}</caption>
        <thead>
          <tr>
            <th scope="col" className="wide">channel</th><th scope="col" className="wide">unit</th>
            <th scope="col">A</th><th scope="col">B</th><th scope="col">B − A</th>
            <th scope="col">min</th><th scope="col">max</th><th scope="col">mean</th><th scope="col">RMS</th>
            <th scope="col" title="the highest step of this part: from one level to the next">step</th>
            <th scope="col" title="10 % to 90 % of the step">rise, ms</th><th scope="col" title="beyond the end value, of the step's height">overshoot</th><th scope="col" title="until it stays within 2 % of the step">settling, ms</th>
          </tr>
        </thead>
        <tbody>
          {recording.channels.map((channel, i) => {
            const at = (time: number | null) => (time === null ? null : valueAt(values[i], x[0], interval_ms, time));
            const [atA, atB] = [at(a), at(b)];
            const all = statistics(values[i], from, to);
            const step = findStep(values[i], interval_ms / 1000, from, to);
            const ms = (seconds: number | null | undefined) => significant(seconds === null || seconds === undefined ? null : seconds * 1000);
            return (
              <tr key={labelOf(channel)}>
                <th scope="row"><span className={swatchOf(i)} aria-hidden="true" /> {labelOf(channel)}</th>
                <td className="text">{channel.unit}</td>
                <td>{significant(atA)}</td>
                <td>{significant(atB)}</td>
                <td>{atA !== null && atB !== null ? significant(atB - atA) : '–'}</td>
                <td>{significant(all?.minimum)}</td>
                <td>{significant(all?.maximum)}</td>
                <td>{significant(all?.mean)}</td>
                <td>{significant(all?.rms)}</td>
                <td title={step ? `read from ${significant(x[step.begin])} to ${significant(x[step.end - 1])} ms` : undefined}>{step ? `${significant(round(step.from, step))} → ${significant(round(step.to, step))}` : '–'}</td>
                <td>{ms(step?.rise_s)}</td>
                <td>{step ? `${step.overshoot_percent.toFixed(2)} %` : '–'}</td>
                <td>{ms(step?.settling_s)}</td>
              </tr>
            );
          })}
        </tbody>
      </table>
    </Scroll>
  );
}
