import { FieldError, Input, Label, TextField } from 'react-aria-components';
import type { KeyTypes } from '../api/types';
import { problemOf, typeOf, type Values } from '../model/misbehaviour';
import { Choice } from './controls';

// Fields for keys whose types the server gives: a list for words and switches, a text field for others. An empty field leaves the key out.

export function KeyFields({ types, values, onChange }: { types: KeyTypes; values: Values; onChange: (values: Values) => void }) {
  return Object.entries(types).map(([key, type]) => {
    const value = values[key] ?? '';
    const set = (to: string) => onChange({ ...values, [key]: to });
    const words = type.enum ?? (type.type === 'boolean' ? ['true', 'false'] : undefined);
    if (words) return <Choice key={key} label={labelOf(key)} value={value} options={['', ...words].map((word) => [word, word === '' ? '—' : word.replaceAll('_', ' ')] as const)} onChange={set} />;
    const problem = problemOf(type, value);
    return (
      <TextField key={key} className="field" value={value} onChange={set} isInvalid={problem !== undefined}>
        <Label>{labelOf(key)}</Label>
        <Input className="input" {...(typeOf(type).type === 'string' ? {} : { inputMode: 'decimal' })} />
        <FieldError className="refusal">{problem}</FieldError>
      </TextField>
    );
  });
}

const units: Record<string, string> = { ms: 'ms', us: 'µs', ns: 'ns', s: 's', rpm: 'rpm' };

// "late_us" is "late, µs": the unit of a key is its last part.
function labelOf(key: string): string {
  const parts = key.split('_');
  const unit = units[parts[parts.length - 1]];
  if (!unit) return parts.join(' ');
  return parts.length === 1 ? `time, ${unit}` : `${parts.slice(0, -1).join(' ')}, ${unit}`;
}
