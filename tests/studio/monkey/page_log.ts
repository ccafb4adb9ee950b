// Runs in the page before its own scripts. It notes in one order what a person does (trusted events) and which commands the
// page sends, and gives each note to the test by the binding `monkeyNote`. It can also make the network slow.

export interface Control {
  name: string;
  region: string; // of the panel or widget around it
  path: string; // of the page, with the query
  disabled: boolean;
  fields: Record<string, string>; // chosen values of the panel, by label
  isJog: boolean;
}

export type Note =
  | { kind: 'loaded' } // a new document: the scripts of the one before have ended
  | { kind: 'went'; path: string } // to another page, by the test and not by a control
  | { kind: 'press'; control: Control }
  | { kind: 'stop' } // Ctrl and space
  | { kind: 'release' } // of a pointer or a key, or the focus is lost
  | { kind: 'toggle'; name: string; on: boolean }
  | { kind: 'request'; n: number; method: string; path: string; body: string }
  | { kind: 'answer'; n: number; status: number; body: string };

export interface Slowness {
  before_ms: number; // from the page's call until the request is sent
  after_ms: number; // from the answer until the page gets it
}

declare global {
  interface Window {
    monkeyNote: (note: string) => void; // JSON of a Note
    monkeySlow?: Slowness;
    monkeyPending: number; // commands without their answer
    monkeyLeft?: boolean; // this document is being left
  }
}

export function logPage() {
  const note = (entry: Note) => window.monkeyNote(JSON.stringify(entry));
  note({ kind: 'loaded' });
  const controls = 'button, a[href], input, select, textarea, [role=tab], [role=option], [role=menuitem], summary';
  const nameOf = (element: Element) => (element.getAttribute('aria-label') ?? element.textContent ?? '').trim().replace(/\s+/g, ' ');
  const controlOf = (target: EventTarget | null): Element | null => (target instanceof Element ? target.closest(controls) : null);
  const describe = (element: Element): Control => {
    const box = element.closest('[role=group].guide-motion, section, article, header.top');
    const row = element.closest('.axis-row'); // of the compact line page
    const region = element.closest('section, article') ?? document.body;
    const fields: Record<string, string> = {};
    for (const field of region.querySelectorAll('.field')) {
      const label = field.querySelector('label, span')?.textContent?.trim() ?? '';
      const shown = field.querySelector('.select > span')?.textContent ?? field.querySelector('input')?.value ?? '';
      fields[label.replace(/\s+/g, ' ')] = shown.trim();
    }
    return {
      name: nameOf(element),
      region: row?.querySelector('[role=rowheader] a')?.textContent ?? box?.getAttribute('aria-label') ?? '',
      path: location.pathname + location.search,
      disabled: element.matches(':disabled, [aria-disabled=true], [data-disabled]'),
      fields,
      isJog: element.matches('.jog'),
    };
  };
  const pressedDown = '.jog, .stop'; // controls that act when they are pressed, the others when they are released
  let down: Element | null = null;
  let wasDisabled = false;
  const press = (element: Element | null) => element && note({ kind: 'press', control: describe(element) });
  const listen = <K extends keyof WindowEventMap>(kind: K, react: (event: WindowEventMap[K]) => void) =>
    addEventListener(kind, (event) => event.isTrusted && react(event), true);
  listen('pointerdown', (event) => {
    down = controlOf(event.target);
    wasDisabled = down !== null && describe(down).disabled;
    if (down?.matches(pressedDown)) press(down);
  });
  listen('pointerup', (event) => {
    const element = controlOf(event.target);
    // A press counts if the control was enabled when it began. Where it is disabled at the release, React Aria reports
    // the press 80 ms later, if it is enabled again by then.
    if (element && element === down && !element.matches(pressedDown)) note({ kind: 'press', control: { ...describe(element), disabled: wasDisabled } });
    down = null;
    note({ kind: 'release' });
  });
  listen('keydown', (event) => {
    if (event.ctrlKey && event.code === 'Space') {
      if (!event.repeat) note({ kind: 'stop' });
    } else if ((event.key === 'Enter' || event.key === ' ') && !event.repeat) press(controlOf(document.activeElement));
  });
  listen('keyup', () => note({ kind: 'release' }));
  for (const kind of ['blur', 'pagehide'] as const) addEventListener(kind, () => note({ kind: 'release' }), true);
  listen('change', (event) => {
    const { target } = event;
    if (target instanceof HTMLInputElement && target.type === 'checkbox') note({ kind: 'toggle', name: nameOf(target.closest('label') ?? target), on: target.checked });
  });

  const later = (ms: number) => new Promise((resolve) => setTimeout(resolve, ms));
  const send = window.fetch.bind(window);
  let last = 0;
  window.monkeyPending = 0;
  window.fetch = async (input, init) => {
    const method = init?.method ?? 'GET';
    const path = String(input).replace(/^.*\/api\/v1/, '');
    if (method === 'GET' || path.endsWith('/alive')) return send(input, init);
    // Only the test lets time pass. By the keyboard the monkey reaches the controls of the clock as well.
    if (path === '/clock') return send(input, { ...init, body: '{"speed": 0}' });
    if (path === '/clock/advance') return send(input, { ...init, body: '{"ms": 0}' });
    const n = ++last;
    const { before_ms, after_ms } = path === '/stop' ? { before_ms: 0, after_ms: 0 } : (window.monkeySlow ?? { before_ms: 0, after_ms: 0 });
    note({ kind: 'request', n, method, path, body: typeof init?.body === 'string' ? init.body.slice(0, 4000) : '' });
    ++window.monkeyPending;
    try {
      if (before_ms > 0) await later(before_ms);
      const answer = await send(input, init);
      const body = path.includes('/parameters') ? '' : (await answer.clone().text()).slice(0, 4000);
      note({ kind: 'answer', n, status: answer.status, body });
      if (after_ms > 0) await later(after_ms);
      return answer;
    } catch (error) {
      note({ kind: 'answer', n, status: 0, body: '' });
      throw error;
    } finally {
      --window.monkeyPending;
    }
  };
}
