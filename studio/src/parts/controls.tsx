import { type ComponentProps, type MouseEvent, type ReactNode, useLayoutEffect, useRef, useState } from 'react';
import {
  Button as AriaButton, Input, Label, ListBox, ListBoxItem, Popover, SearchField, Select as AriaSelect, SelectValue, type ButtonProps, type PressEvent,
} from 'react-aria-components';
import { shownOf } from '../model/problem';
import { go } from '../route';
import { isSecondPress, noteHalt } from './second_press';

// The controls of the page: the behaviour of react-aria with the style of the page.

// `title`: why the button is disabled, for example. AriaButton gives no title to its element.
export function Button({ kind = 'plain', title, onPress, ...props }: ButtonProps & { kind?: 'plain' | 'main' | 'bad' | 'bare'; title?: string | undefined }) {
  const act = onPress && ((event: PressEvent) => {
    if (event.pointerType === 'keyboard' || event.pointerType === 'virtual' || !isSecondPress()) onPress(event);
  });
  return <AriaButton {...props} {...(act ? { onPress: act } : {})} {...(title ? { render: (button: ComponentProps<'button'>) => <button {...button} title={title} /> } : {})} className={`button ${kind} ${typeof props.className === 'string' ? props.className : ''}`} />;
}

// A button that brings axes to rest. It acts when it is pressed, not when it is released: react-aria reports a press after
// the click, and some 80 ms later if the browser makes no click of it.
export function HaltButton({ onHalt, ...props }: Omit<ComponentProps<typeof Button>, 'onPress' | 'onPressStart'> & { onHalt: () => void }) {
  const halt = () => {
    noteHalt();
    onHalt();
  };
  return <Button {...props} onPressStart={halt} />;
}

// An open list keeps its options: options that arrive now would move the others away under the pointer.
export function Choice<T extends string | number>({ label, value, options, onChange, hideLabel = false, isDisabled = false, isLong = false }: {
  label: string;
  value: T;
  isLong?: boolean;
  options: readonly (readonly [T, string, string?])[]; // value, text, and if it cannot be chosen, why not
  onChange: (value: T) => void;
  hideLabel?: boolean;
  isDisabled?: boolean;
}) {
  const [isOpen, setIsOpen] = useState(false);
  const kept = useRef(options);
  if (!isOpen) kept.current = options;
  const shown = kept.current;
  return (
    <AriaSelect
      className="field"
      isDisabled={isDisabled}
      onOpenChange={setIsOpen}
      disabledKeys={shown.filter(([, , reason]) => reason).map(([option]) => String(option))}
      value={String(value)}
      onChange={(key) => {
        const chosen = options.find(([option]) => String(option) === String(key));
        if (chosen && !chosen[2]) onChange(chosen[0]);
      }}
      {...(hideLabel ? { 'aria-label': label } : {})}
    >
      {!hideLabel && <Label>{label}</Label>}
      <AriaButton className={isLong ? 'button select long' : 'button select'}>
        <SelectValue />
        <span aria-hidden="true">▾</span>
      </AriaButton>
      <Popover className="popover">
        <ListBox className="options">
          {shown.map(([option, text, reason]) => (
            <ListBoxItem key={String(option)} id={String(option)} textValue={text} className="option">
              {text}
              {reason && <span className="reason"> · {reason}</span>}
            </ListBoxItem>
          ))}
        </ListBox>
      </Popover>
    </AriaSelect>
  );
}

export function Search({ label, value, onChange }: { label: string; value: string; onChange: (value: string) => void }) {
  return (
    <SearchField className="field search" aria-label={label} value={value} onChange={onChange}>
      <Input className="input" placeholder={label} />
    </SearchField>
  );
}

export function Toggle({ children, isSelected, onChange, isDisabled = false }: {
  children: ReactNode;
  isSelected: boolean;
  onChange: (on: boolean) => void;
  isDisabled?: boolean;
}) {
  return (
    <label className="switch">
      <input type="checkbox" role="switch" checked={isSelected} disabled={isDisabled} onChange={(event) => onChange(event.target.checked)} />
      {children}
    </label>
  );
}

// A link to another part of the page that does not reload the page. With Ctrl, Shift or another mouse button the browser
// handles it as an ordinary link.
export function Link({ to, ...props }: { to: string } & ComponentProps<'a'>) {
  const follow = (event: MouseEvent) => {
    if (event.metaKey || event.ctrlKey || event.shiftKey || event.button !== 0) return;
    event.preventDefault();
    go(to);
  };
  // A row of links may be wider than the window: it scrolls to the link of the present page.
  const link = useRef<HTMLAnchorElement>(null);
  const current = props['aria-current'];
  useLayoutEffect(() => {
    if (!current) return;
    const scroll = () => {
      const row = link.current?.closest('nav, ol');
      if (!row || row.scrollWidth <= row.clientWidth) return;
      const [all, here] = [row.getBoundingClientRect(), link.current!.getBoundingClientRect()];
      row.scrollLeft += here.left + here.width / 2 - all.left - all.width / 2;
    };
    scroll();
    addEventListener('resize', scroll);
    return () => removeEventListener('resize', scroll);
  }, [current]);
  return (
    <a {...props} ref={link} href={to} onClick={follow}>
      {props.children}
    </a>
  );
}

export function Panel({ title, aside, children, className = '' }: { title: string; aside?: ReactNode; children: ReactNode; className?: string }) {
  return (
    <section className={`panel ${className}`} aria-label={title}>
      <header>
        <h2>{title}</h2>
        {aside}
      </header>
      {children}
    </section>
  );
}

export function Readout({ label, value, unit, title }: { label: string; value: ReactNode; unit?: string; title?: string }) {
  return (
    <div className="readout" title={title}>
      <dt>{label}</dt>
      <dd>
        {value}
        {unit && <span className="unit">{unit}</span>}
      </dd>
    </div>
  );
}

export function Trouble({ problem }: { problem: { what: string; where?: string; hint?: string } | undefined }) {
  if (!problem) return null;
  const { what, where, hint } = shownOf(problem);
  return (
    <p className="trouble" role="alert">
      <strong>{what}</strong>
      {where && <> · {where}</>}
      {hint && <span className="hint">{hint}</span>}
    </p>
  );
}

// A box for contents that may be wider than the page. The pointer or the arrow keys scroll it.
export function Scroll({ label, className = '', children }: { label: string; className?: string; children: ReactNode }) {
  return (
    // The box must be in the tab order, so that the keyboard can scroll it.
    // eslint-disable-next-line jsx-a11y/no-noninteractive-tabindex
    <div className={`scroll ${className}`} role="group" aria-label={label} tabIndex={0}>
      {children}
    </div>
  );
}
