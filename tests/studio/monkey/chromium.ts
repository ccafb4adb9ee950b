import { type ChildProcess, spawn } from 'node:child_process';
import { mkdtempSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import type { Readable, Writable } from 'node:stream';
import { browser } from '../browser';

// Chromium by its DevTools protocol over a pipe, with only what the monkey needs. Playwright would report each frame of each
// WebSocket to the test, and search all earlier steps at each step: measured, it and the main process of the browser take
// 0.5 s of processor time for a sequence instead of 0.2 s.

type Data = Record<string, unknown>;

interface Message {
  id?: number;
  result?: Data;
  error?: { message: string };
  method?: string;
  params?: Data;
  sessionId?: string;
}

const flags = [
  '--headless', '--remote-debugging-pipe', '--no-first-run', '--no-default-browser-check', '--disable-extensions', '--disable-component-update', '--disable-sync',
  '--disable-background-networking', '--disable-default-apps', '--disable-breakpad', '--disable-dev-shm-usage', '--hide-scrollbars', '--mute-audio', '--no-service-autorun',
  '--password-store=basic', '--use-mock-keychain', '--disable-prompt-on-repost', '--disable-ipc-flooding-protection',
  // A tab behind the other one runs as the one in front.
  '--disable-background-timer-throttling', '--disable-backgrounding-occluded-windows', '--disable-renderer-backgrounding',
  '--disable-features=Translate,MediaRouter,OptimizationHints,AcceptCHFrame,DestroyProfileOnBrowserClose',
];
const answer_ms = 60_000;

export class Chromium {
  private readonly folder = mkdtempSync(join(tmpdir(), 'monkey-'));
  private readonly process: ChildProcess;
  private readonly waiting = new Map<number, (message: Message) => void>();
  private readonly listeners = new Map<string, (method: string, params: Data) => void>(); // by session
  private rest = '';
  private last = 0;

  constructor() {
    const more = process.getuid?.() === 0 ? ['--no-sandbox'] : [];
    this.process = spawn(browser, [...flags, ...more, `--user-data-dir=${this.folder}`, 'about:blank'], {
      stdio: ['ignore', 'ignore', 'ignore', 'pipe', 'pipe'],
    });
    (this.process.stdio[4] as Readable).setEncoding('utf8').on('data', (data: string) => this.take(data));
    (this.process.stdio[3] as Writable).on('error', () => undefined); // the browser has ended
    this.process.on('exit', () => {
      for (const answer of this.waiting.values()) answer({ error: { message: 'Chromium has ended' } });
      this.waiting.clear();
    });
  }

  private get isOver() {
    return this.process.exitCode !== null || this.process.signalCode !== null;
  }

  async end() {
    if (!this.isOver) {
      const ended = new Promise((resolve) => this.process.once('exit', resolve));
      this.send('Browser.close').catch(() => undefined);
      await ended;
    }
    rmSync(this.folder, { recursive: true, force: true, maxRetries: 5 });
  }

  // Messages end with a zero.
  private take(data: string) {
    const parts = (this.rest + data).split('\0');
    this.rest = parts.pop()!;
    for (const part of parts) {
      const message = JSON.parse(part) as Message;
      if (message.id !== undefined) this.waiting.get(message.id)?.(message);
      else if (message.sessionId) this.listeners.get(message.sessionId)?.(message.method!, message.params ?? {});
    }
  }

  send<T = Data>(method: string, params: Data = {}, sessionId?: string): Promise<T> {
    const id = ++this.last;
    if (this.isOver) return Promise.reject(new Error(`${method}: Chromium has ended`));
    return new Promise((resolve, reject) => {
      const timer = setTimeout(() => this.waiting.get(id)?.({ error: { message: `no answer within ${answer_ms / 1000} s` } }), answer_ms);
      this.waiting.set(id, ({ result, error }) => {
        clearTimeout(timer);
        this.waiting.delete(id);
        if (error) reject(new Error(`${method}: ${error.message}`));
        else resolve(result as T);
      });
      (this.process.stdio[3] as Writable).write(`${JSON.stringify({ id, method, params, ...(sessionId ? { sessionId } : {}) })}\0`);
    });
  }

  // A profile of its own, with its own storage.
  async context(): Promise<string> {
    return (await this.send<{ browserContextId: string }>('Target.createBrowserContext')).browserContextId;
  }

  async endContext(browserContextId: string) {
    await this.send('Target.disposeBrowserContext', { browserContextId });
  }

  async tab(browserContextId: string, width: number, height: number): Promise<Tab> {
    const { targetId } = await this.send<{ targetId: string }>('Target.createTarget', { url: 'about:blank', browserContextId });
    const { sessionId } = await this.send<{ sessionId: string }>('Target.attachToTarget', { targetId, flatten: true });
    const tab = new Tab(this, targetId, sessionId);
    this.listeners.set(sessionId, (method, params) => tab.hear(method, params));
    await Promise.all([
      tab.send('Page.enable'),
      tab.send('Runtime.enable'),
      tab.send('Emulation.setFocusEmulationEnabled', { enabled: true }),
      tab.send('Emulation.setDeviceMetricsOverride', { width, height, deviceScaleFactor: 1, mobile: false }),
    ]);
    return tab;
  }
}

const [control, shift] = [2, 8];
const codes: Record<string, [string, number, string?]> = {
  Tab: ['Tab', 9], Enter: ['Enter', 13, '\r'], Space: ['Space', 32, ' '], Escape: ['Escape', 27], Backspace: ['Backspace', 8], Delete: ['Delete', 46], Home: ['Home', 36], End: ['End', 35],
  PageDown: ['PageDown', 34], ArrowDown: ['ArrowDown', 40], ArrowUp: ['ArrowUp', 38], ArrowRight: ['ArrowRight', 39], ArrowLeft: ['ArrowLeft', 37],
  '1': ['Digit1', 49, '1'], '-': ['Minus', 189, '-'], a: ['KeyA', 65, 'a'], Control: ['ControlLeft', 17], Shift: ['ShiftLeft', 16],
};

export class Tab {
  bindings: Record<string, (text: string) => void> = {};
  onError: (text: string) => void = () => undefined;
  private pointer = { x: 0, y: 0 };

  constructor(
    private readonly browser: Chromium,
    private readonly targetId: string,
    private readonly sessionId: string,
  ) {}

  send<T = Data>(method: string, params: Data = {}): Promise<T> {
    return this.browser.send<T>(method, params, this.sessionId);
  }

  hear(method: string, params: Data) {
    if (method === 'Runtime.bindingCalled') this.bindings[params.name as string]?.(params.payload as string);
    else if (method === 'Runtime.exceptionThrown') this.onError(textOf(params.exceptionDetails as Thrown));
    // A question of the page is answered by "Cancel"; whether it may be left, by "Leave".
    else if (method === 'Page.javascriptDialogOpening') this.send('Page.handleJavaScriptDialog', { accept: params.type === 'beforeunload' }).catch(() => undefined);
  }

  async bind(name: string, react: (text: string) => void) {
    this.bindings[name] = react;
    await this.send('Runtime.addBinding', { name });
  }

  // Before the scripts of each page.
  async before<A>(script: (given: A) => void, given?: A) {
    await this.send('Page.addScriptToEvaluateOnNewDocument', { source: `(${script})(${JSON.stringify(given)})` });
  }

  async evaluate<R, A = undefined>(script: (given: A) => R | Promise<R>, given?: A): Promise<R> {
    const answer = await this.send<{ result: { value: R }; exceptionDetails?: Thrown }>('Runtime.evaluate', {
      expression: `(${script})(${JSON.stringify(given)})`, awaitPromise: true, returnByValue: true,
    });
    if (answer.exceptionDetails) throw new Error(textOf(answer.exceptionDetails));
    return answer.result.value;
  }

  async goto(url: string) {
    await this.send('Page.navigate', { url });
  }

  // Nothing but the empty page of a new tab was there before.
  async isFirst(): Promise<boolean> {
    const { currentIndex, entries } = await this.send<{ currentIndex: number; entries: { url: string }[] }>('Page.getNavigationHistory');
    return currentIndex === 0 || entries[currentIndex - 1].url === 'about:blank';
  }

  async close() {
    await this.browser.send('Target.closeTarget', { targetId: this.targetId });
  }

  private mouse(type: string, x: number, y: number, buttons: number) {
    return this.send('Input.dispatchMouseEvent', { type, x, y, buttons, button: type === 'mouseMoved' ? 'none' : 'left', clickCount: type === 'mouseMoved' ? 0 : 1 });
  }

  // The events of one action are sent at once: Chromium handles them in this order.
  async press(x: number, y: number) {
    this.pointer = { x, y };
    await Promise.all([this.mouse('mouseMoved', x, y, 0), this.mouse('mousePressed', x, y, 1)]);
  }

  async letGo() {
    await this.mouse('mouseReleased', this.pointer.x, this.pointer.y, 0);
  }

  async click(x: number, y: number) {
    await Promise.all([this.press(x, y), this.letGo()]);
  }

  private key(type: 'down' | 'up', name: string, modifiers: number) {
    const [code, windowsVirtualKeyCode, text] = codes[name];
    const typed = type === 'down' && text !== undefined && (modifiers & control) === 0;
    const key = name === 'Space' ? ' ' : name;
    return this.send('Input.dispatchKeyEvent', { type: type === 'up' ? 'keyUp' : typed ? 'keyDown' : 'rawKeyDown', key, code, windowsVirtualKeyCode, modifiers, ...(typed ? { text } : {}) });
  }

  async keyDown(name: string) {
    await this.key('down', name, 0);
  }

  async keyUp(name: string) {
    await this.key('up', name, 0);
  }

  // "Control+a": the modifier goes down first, and up last.
  async keyPress(combination: string) {
    const [name, modifier] = combination.split('+').reverse();
    const mask = modifier === 'Control' ? control : modifier === 'Shift' ? shift : 0;
    await Promise.all([
      ...(modifier ? [this.key('down', modifier, mask)] : []), this.key('down', name, mask), this.key('up', name, mask), ...(modifier ? [this.key('up', modifier, 0)] : []),
    ]);
  }

  async insert(text: string) {
    await this.send('Input.insertText', { text });
  }
}

interface Thrown {
  text: string;
  exception?: { description?: string };
}

const textOf = ({ text, exception }: Thrown) => exception?.description ?? text;
