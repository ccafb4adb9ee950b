import { useLiveValue } from '../live_values';
import { basesOf } from '../model/bases';
import type { Widget } from '../model/boards';
import { Scroll } from '../parts/controls';
import { useObject } from './object';

export function WatchWidget({ widget }: { widget: Widget }) {
  const texts = widget.channels as string[];
  return (
    <Scroll label={`Watch list ${widget.title}`}>
      <table className="table watch" aria-label={widget.title || 'Watch list'}>
        <thead>
          <tr><th scope="col">signal or object</th><th scope="col" className="wide">name</th><th scope="col">decimal</th><th scope="col">hexadecimal</th><th scope="col">binary</th><th scope="col" className="wide">unit</th></tr>
        </thead>
        <tbody>{texts.map((text) => <Row key={text} text={text} />)}</tbody>
      </table>
    </Scroll>
  );
}

function Row({ text }: { text: string }) {
  const { value, problem } = useLiveValue(text);
  const about = useObject(text);
  const digits = typeof value === 'number' ? basesOf(value, about?.type) : null;
  return (
    <tr>
      <th scope="row">{text.replace('/', ' ')}</th>
      <td className="text">{problem ? <span className="refusal">{problem.what}</span> : about?.name}</td>
      {digits ? (
        <>
          <td className="mono">{digits.decimal}</td>
          <td className="mono">{digits.hexadecimal}</td>
          <td className="mono"><span className="binary">{digits.binary}</span></td>
        </>
      ) : (
        <td className="text" colSpan={3}>{typeof value === 'string' ? value : '–'}</td>
      )}
      <td className="text">{about?.unit}</td>
    </tr>
  );
}
