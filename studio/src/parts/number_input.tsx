import { createContext, useCallback, useContext, useEffect, useId, useLayoutEffect, useMemo, useRef, useState, type ComponentProps, type KeyboardEvent, type ReactNode } from 'react';
import { FieldError, Group, Input, Label, Text, TextField } from 'react-aria-components';
import { onTakenBack } from '../commands';
import { readNumber, showNumber } from '../model/number';
import { Button } from './controls';

// Number fields and the buttons that use them. An invalid number is marked with the reason, and the buttons of its form are
// disabled until it is corrected.

type Wrong = 'missing' | 'refused'; // none was entered; the typed text is marked as wrong
interface Form {
  wrong: ReadonlyMap<string, Wrong>;
  note: (field: string, wrong: Wrong | undefined) => void;
}
const FormContext = createContext<Form>({ wrong: new Map(), note: () => undefined });

export function NumberForm({ children }: { children: ReactNode }) {
  const [wrong, setWrong] = useState<ReadonlyMap<string, Wrong>>(new Map());
  const note = useCallback(
    (field: string, to: Wrong | undefined) =>
      setWrong((before) => {
        if (before.get(field) === to) return before;
        const others = [...before].filter(([each]) => each !== field);
        return new Map(to ? [...others, [field, to]] : others);
      }),
    [],
  );
  const form = useMemo(() => ({ wrong, note }), [wrong, note]);
  return <FormContext.Provider value={form}>{children}</FormContext.Provider>;
}

// True if every number of the form is present and valid.
export const useNumbersAreRight = () => useContext(FormContext).wrong.size === 0;

// True if a field of the form has a text that is refused: then the last accepted number counts.
export const useNumberIsRefused = () => [...useContext(FormContext).wrong.values()].includes('refused');

// A button that uses the numbers of its form.
export function NumbersButton({ isDisabled = false, ...props }: ComponentProps<typeof Button>) {
  const isRight = useNumbersAreRight();
  return <Button {...props} isDisabled={isDisabled || !isRight} />;
}

// `value` NaN: no number yet. `onChange` gets valid numbers only: after each key, or with `whenLeft` when the field
// loses the focus or Enter is pressed. With `whenLeft` a halt or STOP drops the typed text, because its button acts at
// the press, before the field loses the focus. With `mayBeEmpty` an empty field is valid and gives NaN.
export function NumberInput({ label, unit, value, onChange, minimum, maximum, above, step = 1, hideLabel = false, isDisabled = false, whenLeft = false, mayBeEmpty = false, isHexadecimal = false, hint, check }: {
  label: string;
  unit?: string | undefined;
  value: number;
  onChange: (value: number) => void;
  minimum?: number | undefined;
  maximum?: number | undefined;
  above?: number | undefined;
  step?: number;
  hideLabel?: boolean;
  isDisabled?: boolean;
  whenLeft?: boolean;
  mayBeEmpty?: boolean;
  isHexadecimal?: boolean;
  hint?: string | undefined; // for example, why the field is disabled
  check?: ((value: number) => string) | undefined; // why a number within the limits is refused; empty: it is not
}) {
  const id = useId();
  const { note } = useContext(FormContext);
  const [typed, setTyped] = useState<string | null>(null); // the typed text, until the number is accepted or `value` changes; null: none
  const [told, setTold] = useState(value);
  const isDropped = useRef(false); // since the last key; the field may lose the focus before it is rendered again
  useEffect(() => {
    if (!whenLeft) return;
    return onTakenBack(() => {
      isDropped.current = true;
      setTyped(null);
    });
  }, [whenLeft]);
  const limits = { minimum, maximum, above };
  const read = (text: string) => {
    if (mayBeEmpty && text.trim() === '') return { value: NaN };
    const number = readNumber(text, limits, isHexadecimal);
    const refusal = 'value' in number ? (check?.(number.value) ?? '') : '';
    return refusal ? { problem: refusal } : number;
  };
  const isUnknown = Number.isNaN(value) && !mayBeEmpty; // for a moment: what is typed stays
  if (!isUnknown && !Object.is(told, value)) {
    // `value` has changed. If it is not the typed number, the change comes from outside and replaces the typed text.
    const now = typed === null ? null : read(typed);
    if (now && 'value' in now && !Object.is(now.value, value)) setTyped(null);
    setTold(value);
  }
  const text = typed ?? showNumber(value, isHexadecimal);
  const now = read(text);
  const problem = 'problem' in now ? now.problem : undefined;
  const isShown = problem !== undefined && !isDisabled && typed !== null;
  useLayoutEffect(() => {
    note(id, isShown ? 'refused' : problem !== undefined && !isDisabled ? 'missing' : undefined);
    return () => note(id, undefined);
  }, [note, id, problem, isShown, isDisabled]);

  const take = (to: string) => {
    const number = read(to);
    if ('value' in number && !Object.is(number.value, value)) onChange(number.value);
  };
  const type = (to: string) => {
    isDropped.current = false;
    setTyped(to);
    if (!whenLeft) take(to);
  };
  const leave = () => {
    if (typed === null || problem !== undefined || isDropped.current) return;
    if (whenLeft) take(typed);
    setTyped(null);
  };
  const onKey = (event: KeyboardEvent) => {
    if (event.key === 'Enter') leave();
    const direction = event.key === 'ArrowUp' ? 1 : event.key === 'ArrowDown' ? -1 : 0;
    if (direction === 0 || !('value' in now) || !Number.isFinite(now.value)) return;
    event.preventDefault();
    const next = readNumber(showNumber(now.value + direction * step, isHexadecimal), limits, isHexadecimal);
    if ('value' in next) type(showNumber(next.value, isHexadecimal));
  };
  return (
    <TextField className="field" value={text} onChange={type} isDisabled={isDisabled} isInvalid={isShown} {...(hideLabel ? { 'aria-label': label } : {})}>
      {!hideLabel && <Label>{label}</Label>}
      <Group className="number" isInvalid={isShown}>
        <Input className="input" inputMode="decimal" onBlur={leave} onKeyDown={onKey} />
        {unit && <span className="unit">{unit}</span>}
      </Group>
      {hint && <Text slot="description" className="quiet hint">{hint}</Text>}
      <FieldError className="refusal">{problem}</FieldError>
    </TextField>
  );
}
