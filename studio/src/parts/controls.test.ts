import { createElement, type ReactElement } from 'react';
import { renderToStaticMarkup } from 'react-dom/server';
import { expect, it, vi } from 'vitest';
import { Button, HaltButton } from './controls';
import { NumberForm, NumbersButton } from './number_input';

it('a disabled button has the reason as its title', () => {
  const reason = 'The drive has a fault: clear it first.';
  for (const kind of [Button, NumbersButton]) {
    const html = renderToStaticMarkup(createElement(NumberForm, null, createElement(kind, { isDisabled: true, title: reason }, 'Move +')));
    expect(html).toMatch(/^<button [^>]*title="The drive has a fault: clear it first\."[^>]*>Move \+<\/button>$/);
    expect(html).toMatch(/ disabled=""/);
  }
});

it('a button without a title has no title', () => {
  for (const title of ['', undefined]) expect(renderToStaticMarkup(createElement(Button, { title }, 'Move +'))).not.toContain('title');
});

it('a button that brings axes to rest acts when it is pressed, and not again when it is released', () => {
  const halt = vi.fn();
  const { props } = HaltButton({ onHalt: halt, children: 'Halt all' }) as ReactElement<object>;
  expect(props).toMatchObject({ children: 'Halt all' });
  (props as { onPressStart: () => void }).onPressStart();
  expect(halt).toHaveBeenCalledOnce();
  expect(props).not.toHaveProperty('onPress');
  expect(props).not.toHaveProperty('onClick');
});
