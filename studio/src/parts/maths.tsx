import { useId, useState } from 'react';
import type { ChannelRequest } from '../api/types';
import { formulaOf, functions, mathsOf, nameProblem, textOfMaths } from '../model/formula';
import { keep, useRoute } from '../route';
import { Button, Panel } from './controls';
import { swatchOf } from './lanes';

const nameOf = ({ axis, signal, object }: ChannelRequest) => `${axis} ${signal ?? object ?? ''}`;

// The math channels, which are in the address. Their numbers are those of the shown recording, else of the chosen channels.
export function Maths({ channels }: { channels: ChannelRequest[] }) {
  const { query } = useRoute();
  const maths = mathsOf(query.get('math'));
  const set = (to: typeof maths) => keep({ math: textOfMaths(to) });
  const [name, setName] = useState('');
  const [formula, setFormula] = useState('');
  const [asked, setAsked] = useState(false); // the user wanted to add it
  const problemId = useId();
  const found = formulaOf(formula, channels.length);
  const wrongName = nameProblem(name, maths.map((each) => each.name));
  const wrongFormula = typeof found === 'function' ? (formula.includes(';') ? 'A formula must not contain ";".' : undefined) : `${found.problem}${formula === '' ? '' : `, at character ${found.at + 1}`}`;
  const isShown = formula !== '' || asked;
  const add = () => {
    setAsked(true);
    if (wrongName || wrongFormula) return;
    set([...maths, { name: name.trim(), formula: formula.trim() }]);
    setName('');
    setFormula('');
    setAsked(false);
  };
  return (
    <Panel title="Mathematics" aside={<span className="quiet">of recordings</span>}>
      <ul className="channels">
        {maths.map((math, i) => {
          const fits = formulaOf(math.formula, channels.length);
          return (
            <li key={math.name}>
              <span className={swatchOf(channels.length + i)} aria-hidden="true" />
              <span className="name" title={math.formula}>{math.name} = {math.formula}</span>
              {typeof fits !== 'function' && <span className="refusal" role="alert">{fits.problem}</span>}
              <Button kind="bare" aria-label={`Remove ${math.name}`} onPress={() => set(maths.filter((each) => each !== math))}>×</Button>
            </li>
          );
        })}
      </ul>
      <form className="form maths" onSubmit={(event) => { event.preventDefault(); add(); }}>
        <label className="field">
          <span>Name of the math channel</span>
          <input className="input" value={name} onChange={(event) => setName(event.target.value)} aria-invalid={asked && wrongName !== undefined} {...(asked && wrongName ? { 'aria-describedby': `${problemId}-name` } : {})} autoComplete="off" />
          {asked && wrongName && <span className="refusal" id={`${problemId}-name`}>{wrongName}</span>}
        </label>
        <label className="field formula">
          <span>Formula</span>
          <input
            className="input mono" value={formula} placeholder="derivative(c1) - 2 * c2" autoComplete="off" spellCheck={false}
            aria-invalid={isShown && wrongFormula !== undefined} {...(isShown && wrongFormula ? { 'aria-describedby': problemId } : {})}
            onChange={(event) => setFormula(event.target.value)}
          />
          {isShown && wrongFormula && <span className="refusal" id={problemId} role="status">{wrongFormula}</span>}
        </label>
        <Button type="submit">Add the math channel</Button>
      </form>
      <details className="report">
        <summary>Channels and functions</summary>
        <dl className="facts">
          {channels.map((channel, i) => <div key={nameOf(channel)}><dt className="mono">c{i + 1}</dt><dd>{nameOf(channel)}</dd></div>)}
          <div><dt className="mono">+ − * / ( )</dt><dd>as usual; x / 0 is a gap</dd></div>
          {Object.entries(functions).map(([id, { does }]) => <div key={id}><dt className="mono">{id}</dt><dd>{does}</dd></div>)}
        </dl>
      </details>
    </Panel>
  );
}
