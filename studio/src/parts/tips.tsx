import { useEffect, useLayoutEffect, useRef, useState, type KeyboardEvent } from 'react';
import './tips.css';

// Explanations of elements with `data-tip`: on hover, on keyboard focus and on touch. Escape hides them. The pointer may
// move onto the explanation, for example to select its text.

const show_ms = 350;
const hide_ms = 200;
const id = 'tip';

// The element with an explanation at `node`: itself, one around it, or the present option of a list box.
function tipped(node: EventTarget | null): Element | null {
  if (!(node instanceof Element)) return null;
  const active = node.getAttribute('aria-activedescendant');
  return (active === null ? null : document.getElementById(active)?.closest('[data-tip]')) ?? node.closest('[data-tip]');
}

export function TipLayer() {
  const [element, setElement] = useState<Element | null>(null);
  useEffect(() => {
    let timer: ReturnType<typeof setTimeout>;
    const to = (next: Element | null, wait_ms: number) => {
      clearTimeout(timer);
      timer = setTimeout(() => setElement(next), wait_ms);
    };
    const isLayer = (node: EventTarget | null) => node instanceof Element && node.closest(`#${id}`) !== null;
    const over = (event: PointerEvent) => {
      if (event.pointerType === 'touch') return;
      if (isLayer(event.target)) clearTimeout(timer);
      else to(event.target instanceof Element ? event.target.closest('[data-tip]') : null, event.target instanceof Element && event.target.closest('[data-tip]') ? show_ms : hide_ms);
    };
    const touch = (event: PointerEvent) => {
      if (event.pointerType === 'touch') to(isLayer(event.target) ? null : event.target instanceof Element ? event.target.closest('[data-tip]') : null, 0);
    };
    const focus = (event: FocusEvent) => {
      // A click sets the focus as well, but does not ask for an explanation.
      const next = tipped(event.target);
      if (event.target instanceof Element && event.target.matches(':focus-visible')) to(next, 0);
    };
    const key = (event: globalThis.KeyboardEvent) => {
      if (event.key === 'Escape') to(null, 0);
      else if (event.key.startsWith('Arrow') && document.activeElement?.hasAttribute('aria-activedescendant')) setTimeout(() => to(tipped(document.activeElement), 0), 60);
    };
    const away = () => to(null, 0);
    addEventListener('pointerover', over);
    addEventListener('pointerdown', touch);
    addEventListener('focusin', focus);
    addEventListener('focusout', away);
    addEventListener('keydown', key);
    addEventListener('popstate', away);
    return () => {
      clearTimeout(timer);
      removeEventListener('pointerover', over);
      removeEventListener('pointerdown', touch);
      removeEventListener('focusin', focus);
      removeEventListener('focusout', away);
      removeEventListener('keydown', key);
      removeEventListener('popstate', away);
    };
  }, []);
  return element ? <Tip key={element.getAttribute('data-tip')} element={element} /> : null;
}

const gap = 6;

function Tip({ element }: { element: Element }) {
  const box = useRef<HTMLDivElement>(null);
  const [place, setPlace] = useState<{ left: number; top: number } | null>(null);
  const [head = '', from] = (element.getAttribute('data-tip') ?? '').split('\n');
  useLayoutEffect(() => {
    element.setAttribute('aria-describedby', id);
    return () => element.removeAttribute('aria-describedby');
  }, [element]);
  useLayoutEffect(() => {
    if (!element.isConnected || !box.current) return;
    const around = element.getBoundingClientRect();
    const { width, height } = box.current.getBoundingClientRect();
    const below = around.bottom + gap + height <= innerHeight;
    setPlace({ left: Math.max(gap, Math.min(around.left, innerWidth - width - gap)), top: below ? around.bottom + gap : Math.max(gap, around.top - gap - height) });
  }, [element]);
  return (
    <div id={id} role="tooltip" className="tip" ref={box} style={place ?? { left: 0, top: 0, visibility: 'hidden' }}>
      <p>{head}</p>
      {from && <p className="quiet">{from}</p>}
    </div>
  );
}

// One tab stop for a list of explained items: the arrow keys go from one to the next.
export function useRoving(): { tabIndexOf: (i: number) => 0 | -1; onKeyDown: (event: KeyboardEvent<HTMLElement | SVGElement>) => void; onFocus: (i: number) => void } {
  const [at, setAt] = useState(0);
  return {
    tabIndexOf: (i) => (i === at ? 0 : -1),
    onFocus: setAt,
    onKeyDown: (event) => {
      const step = { ArrowDown: 1, ArrowRight: 1, ArrowUp: -1, ArrowLeft: -1 }[event.key];
      if (!step) return;
      const items = [...event.currentTarget.querySelectorAll<HTMLElement>('[data-tip]')];
      const next = items[items.indexOf(document.activeElement as HTMLElement) + step] as HTMLElement | undefined;
      event.preventDefault();
      next?.focus();
    },
  };
}
