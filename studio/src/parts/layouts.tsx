import { useState } from 'react';
import { appliedOf, layoutOf, readLayouts, withLayout, type Layout } from '../model/layouts';
import { tell } from '../notices';
import { keep, useRoute } from '../route';
import { Saved, useSaved } from '../saved';
import { placeOf, useProject } from '../storage';
import { Button, Panel } from './controls';

const saved = new Saved<Layout[]>('servodrome.scope.layouts', [], readLayouts);

// Channels, trigger, math channels and plot under a name, in the storage of the page.
export function Layouts() {
  const { query } = useRoute();
  const layouts = useSaved(saved);
  const project = useProject();
  const [name, setName] = useState('');
  const save = () => {
    const given = name.trim();
    if (given === '') return;
    saved.set(withLayout(layouts, layoutOf(given, query)));
    tell(`layout "${given}" saved in ${placeOf(project)}`);
    setName('');
  };
  return (
    <Panel title="Layouts">
      <ul className="channels">
        {layouts.map((layout) => (
          <li key={layout.name}>
            <button type="button" className="name link" onClick={() => keep(appliedOf(layout))}>{layout.name}</button>
            <Button kind="bare" aria-label={`Delete layout ${layout.name}`} onPress={() => saved.set(layouts.filter((each) => each !== layout))}>×</Button>
          </li>
        ))}
      </ul>
      <form className="write" onSubmit={(event) => { event.preventDefault(); save(); }}>
        <label className="field"><span>Name of the layout</span><input className="input" value={name} maxLength={60} onChange={(event) => setName(event.target.value)} autoComplete="off" /></label>
        <Button type="submit" isDisabled={name.trim() === ''}>Save</Button>
      </form>
    </Panel>
  );
}
