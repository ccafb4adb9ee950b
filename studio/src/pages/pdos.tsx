import { useState } from 'react';
import { problemOf, put } from '../api/client';
import type { AxisView, Problem } from '../api/types';
import { axisPath } from '../commands';
import { Button, Panel, Toggle, Trouble } from '../parts/controls';
import { NumberForm, NumberInput, NumbersButton } from '../parts/number_input';
import { bitsOf, changesOf, moved, type Mapped, type Pdo, type Pdos } from '../model/pdos';
import { tell } from '../notices';
import { useResource } from '../resource';
import { useAxis } from '../store';

const directions = [['receive', 'Receive PDOs, to the drive'], ['transmit', 'Transmit PDOs, from the drive']] as const;

// A warning if another master may be using the PDOs now.
function masterOf(axis: AxisView | undefined): string | null {
  if (axis?.nmt_state === 'operational') return 'The node is in NMT state Operational: a master may be exchanging these PDOs now and does not notice a change.';
  if (axis?.al_state === 'Operational' || axis?.al_state === 'Safe-Operational') return `The slave is in ${axis.al_state}: a master is exchanging these PDOs now. They can be changed in Pre-Operational only.`;
  if (axis?.al_state !== undefined && axis.al_state !== 'Pre-Operational') return `The slave is in ${axis.al_state}: PDOs can be changed in Pre-Operational only, and a master must request that state.`;
  return null;
}

export function PdoView({ name }: { name: string }) {
  const axis = useAxis(name);
  const path = `${axisPath(name)}/pdos`;
  const { value, problem, again } = useResource<Pdos>(axis?.powered ? path : null, 2000);
  // The edited PDOs, and the PDOs when the editing began.
  const [draft, setDraft] = useState<{ before: Pdos; after: Pdos } | null>(null);
  const [refusal, setRefusal] = useState<Problem | undefined>();
  const [busy, setBusy] = useState(false);
  const shown = draft?.after ?? value;
  if (!shown) return <Trouble problem={problem} />;
  const changes = draft && changesOf(draft.before, draft.after);
  const edit = (after: Pdos) => setDraft({ before: draft?.before ?? shown, after });
  const editPdo = (pdo: Pdo) => edit({ ...shown, pdos: shown.pdos.map((each) => (each.index === pdo.index ? pdo : each)) });
  const apply = () => {
    if (!changes) return;
    setBusy(true);
    put<Pdos>(path, changes)
      .then(
        () => {
          setDraft(null);
          setRefusal(undefined);
          tell(`PDOs of ${name} written`);
        },
        (error: unknown) => setRefusal(problemOf(error)),
      )
      .finally(() => {
        setBusy(false);
        again();
      });
  };
  const revert = () => {
    setDraft(null);
    setRefusal(undefined);
  };
  const master = masterOf(axis);

  return (
    <NumberForm>
      <div className="column">
        <Panel
          title="Process data"
          aside={
            <>
              <span className="quiet" role="status">{changes ? 'changed, not written' : 'as in the drive'}</span>
              <NumbersButton kind="main" isDisabled={!changes || busy} onPress={apply}>Write to the drive</NumbersButton>
              <Button isDisabled={!draft || busy} onPress={revert}>Revert</Button>
            </>
          }
        >
          <p className="note">
            Changes are written in the order that the standard requires. If the drive rejects one, the previous configuration is restored.
            Changes that are not stored are lost at power-off.
          </p>
          {master && <p className="warning" role="status">{master}</p>}
          <Trouble problem={refusal ?? problem} />
        </Panel>
        {directions.map(([direction, title]) => (
          <section key={direction} aria-label={title}>
            <h2 className="section">{title}</h2>
            <div className="panels">
              {shown.pdos.filter((pdo) => pdo.direction === direction).map((pdo) => (
                <PdoPanel key={pdo.index} pdo={pdo} pdos={shown} onPdo={editPdo} onAssigned={(list) => edit({ ...shown, [direction]: list })} />
              ))}
            </div>
          </section>
        ))}
      </div>
    </NumberForm>
  );
}

const hexIndex = (index: string) => `${index.slice(2)}h`;

function PdoPanel({ pdo, pdos, onPdo, onAssigned }: { pdo: Pdo; pdos: Pdos; onPdo: (pdo: Pdo) => void; onAssigned: (list: string[]) => void }) {
  const title = `${pdo.direction === 'receive' ? 'RPDO' : 'TPDO'} ${pdo.number}, ${hexIndex(pdo.index)}`;
  const assigned = pdos[pdo.direction];
  const place = assigned?.indexOf(pdo.index) ?? -1;
  const bits = bitsOf(pdo.objects);
  const set = (objects: Mapped[]) => onPdo({ ...pdo, objects });
  const number = (key: 'can_id' | 'transmission_type' | 'inhibit_time_us' | 'event_timer_ms', label: string, unit = '', step = 1) =>
    pdo[key] !== undefined && (
      <NumberInput whenLeft key={key} label={label} unit={unit} value={pdo[key]} minimum={0} step={step} isHexadecimal={key === 'can_id'} onChange={(to) => onPdo({ ...pdo, [key]: to })} />
    );
  return (
    <Panel
      title={title}
      className="pdo"
      aside={<span className={pdos.bus === 'can' && bits > 64 ? 'chip bad' : 'quiet'}>{bits} {pdos.bus === 'can' ? 'of 64 ' : ''}bits</span>}
    >
      <div className="toolbar">
        {pdo.enabled !== undefined && <Toggle isSelected={pdo.enabled} onChange={(enabled) => onPdo({ ...pdo, enabled })}>in use</Toggle>}
        {assigned && (
          <Toggle
            isDisabled={pdos[`${pdo.direction}_fixed`] ?? false}
            isSelected={place >= 0}
            onChange={(on) => onAssigned(on ? [...assigned, pdo.index].sort() : assigned.filter((index) => index !== pdo.index))}
          >
            {place >= 0 ? `assigned, ${place + 1} of ${assigned.length}` : 'assigned'}
          </Toggle>
        )}
        {pdo.fixed && <span className="chip plain">fixed by the manufacturer</span>}
      </div>
      <ol className="mapped" aria-label={`Objects of ${title}`}>
        {pdo.objects.map((mapped, i) => (
          // The key contains the position, since the same object may be mapped twice.
          <li key={`${i} ${mapped.object}`}>
            <span className="mono">{mapped.object}</span>
            <span className="name">{mapped.name}</span>
            <span className="quiet">{mapped.bits}</span>
            {!pdo.fixed && (
              <span className="buttons">
                <Button kind="bare" aria-label={`Move ${mapped.object} up`} isDisabled={i === 0} onPress={() => set(moved(pdo.objects, i, -1))}>↑</Button>
                <Button kind="bare" aria-label={`Move ${mapped.object} down`} isDisabled={i === pdo.objects.length - 1} onPress={() => set(moved(pdo.objects, i, 1))}>↓</Button>
                <Button kind="bare" aria-label={`Remove ${mapped.object}`} onPress={() => set(pdo.objects.filter((_, k) => k !== i))}>×</Button>
              </span>
            )}
          </li>
        ))}
        {pdo.objects.length === 0 && <li className="empty">no objects</li>}
      </ol>
      {!pdo.fixed && pdo.objects.length < pdo.most && <AddObject title={title} offered={pdos.mappable[pdo.direction]} onAdd={(mapped) => set([...pdo.objects, mapped])} />}
      {pdo.can_id !== undefined && (
        <div className="form">
          {number('can_id', 'COB-ID (hexadecimal)')}
          {number('transmission_type', 'Transmission type')}
          {number('inhibit_time_us', 'Inhibit time', 'µs', 100)}
          {number('event_timer_ms', 'Event timer', 'ms')}
        </div>
      )}
    </Panel>
  );
}

function AddObject({ title, offered, onAdd }: { title: string; offered: Mapped[]; onAdd: (mapped: Mapped) => void }) {
  const [what, setWhat] = useState('');
  const typed = what.trim().toUpperCase();
  const padding = /^0000:00\/(8|16|32)$/.exec(typed);
  const found: Mapped | undefined = padding ? { object: '0000:00', name: 'padding', bits: Number(padding[1]) } : offered.find(({ object }) => object === typed);
  // An object that is not listed as mappable is accepted all the same: the drive refuses it and gives the reason.
  const asked = /^([0-9A-F]{4}:[0-9A-F]{2})\/(8|16|32)$/.exec(typed);
  const mapped = found ?? (asked ? { object: `${asked[1]}/${asked[2]}`, name: 'not listed as mappable', bits: Number(asked[2]) } : undefined);
  const id = `mappable ${title}`.replaceAll(' ', '-');
  return (
    <form
      className="write"
      onSubmit={(event) => {
        event.preventDefault();
        if (!mapped) return;
        onAdd(mapped);
        setWhat('');
      }}
    >
      <label className="field">
        <span>Object to map</span>
        <input className="input" list={id} value={what} onChange={(event) => setWhat(event.target.value)} placeholder="607A:00, or INDEX:SUB/BITS" autoComplete="off" spellCheck={false} />
      </label>
      <datalist id={id}>
        {offered.map(({ object, name, bits }) => <option key={object} value={object}>{name}, {bits} bits</option>)}
      </datalist>
      <Button type="submit" isDisabled={!mapped}>Map</Button>
    </form>
  );
}
