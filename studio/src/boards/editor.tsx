import { useId, useState } from 'react';
import { fieldsOf, problemsOf, widgets, type Field, type Widget } from '../model/boards';
import { useLine } from '../store';
import { Button, Choice, Panel } from '../parts/controls';
import { NumberForm, NumberInput, NumbersButton } from '../parts/number_input';
import { ChannelInput, ChannelsInput } from './channel_input';

// Edits a widget by the fields of its kind.
export function Editor({ widget, onSave, onCancel }: { widget: Widget; onSave: (widget: Widget) => void; onCancel: () => void }) {
  const [edited, setEdited] = useState(widget);
  const [asked, setAsked] = useState(false); // problems of empty fields are shown after the first try only
  const problems = problemsOf(edited);
  const set = (key: string, to: unknown) => setEdited((before) => (to === undefined ? without(before, key) : { ...before, [key]: to }));
  const save = () => {
    setAsked(true);
    if (Object.keys(problems).length === 0) onSave(edited);
  };
  const { title, does } = widgets[widget.kind];
  return (
    <Panel title={`${title}: settings`} className="editing">
      <NumberForm>
        <p className="quiet">{does}</p>
        <div className="form">
          {fieldsOf(widget.kind).map((field) => (
            <div key={field.key} className={`of-${field.kind}`}>
              <FieldInput field={field} value={edited[field.key]} onChange={(to) => set(field.key, to)} />
              {asked && problems[field.key] && <p className="refusal" role="alert">{field.label}: {problems[field.key]}</p>}
            </div>
          ))}
        </div>
        <div className="buttons">
          <NumbersButton kind="main" onPress={save}>Save the widget</NumbersButton>
          <Button onPress={onCancel}>Cancel</Button>
        </div>
      </NumberForm>
    </Panel>
  );
}

function without(widget: Widget, key: string): Widget {
  return Object.fromEntries(Object.entries(widget).filter(([each]) => each !== key)) as Widget;
}

function FieldInput({ field, value, onChange }: { field: Field; value: unknown; onChange: (to: unknown) => void }) {
  const order = useLine((line) => line.order);
  const id = useId();
  const { label, kind } = field;
  const text = typeof value === 'string' ? value : '';
  switch (kind) {
    case 'text':
      return <label className="field" htmlFor={id}><span>{label}</span><input id={id} className="input" value={text} maxLength={60} onChange={(event) => onChange(event.target.value)} /></label>;
    case 'lines':
      return <label className="field" htmlFor={id}><span>{label}</span><textarea id={id} className="input mono" rows={7} value={text} spellCheck={false} onChange={(event) => onChange(event.target.value)} /></label>;
    case 'number':
      return (
        <NumberInput
          label={label} unit={field.unit} minimum={field.minimum} maximum={field.maximum} mayBeEmpty={field.optional ?? false}
          value={typeof value === 'number' ? value : NaN} onChange={(to) => onChange(Number.isFinite(to) ? to : undefined)}
        />
      );
    case 'choice':
      return <Choice label={label} value={text} options={field.options ?? []} onChange={onChange} />;
    case 'axis':
      return <Choice label={label} value={text} options={[...(order.includes(text) ? [] : [[text, text === '' ? 'choose' : text] as const]), ...order.map((each) => [each, each] as const)]} onChange={onChange} />;
    case 'channel':
    case 'object':
      return <ChannelInput label={label} value={text} onlyWritable={kind === 'object'} onChange={onChange} />;
    case 'channels':
      return <ChannelsInput label={label} value={Array.isArray(value) ? (value as string[]) : []} most={field.maximum ?? 16} onChange={onChange} />;
  }
}
