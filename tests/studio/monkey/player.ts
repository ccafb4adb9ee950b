import { axes, Line, lineFile } from '../line';
import type { Chromium, Tab } from './chromium';
import { Model, ticksPerMs, type Widgets } from './model';
import { logPage, type Note } from './page_log';
import { address, of, random, type Sequence, type Step } from './sequence';
import { TruthStream } from './stream';

// The monkey: a line of all products in virtual time, a browser, and actions that are drawn from a seed. Line time passes only
// between actions, after the page has sent all requests of the action.

// ---- The dashboard of the monkey ----

const board = {
  name: 'Monkey',
  widgets: [
    { kind: 'button', title: 'Enable reference', span: 1, axis: 'reference', do: 'enable' },
    { kind: 'button', title: 'Forward', span: 1, axis: 'reference', do: 'jog', velocity: 2 },
    { kind: 'button', title: 'Turn reference', span: 1, axis: 'reference', do: 'move', by: 1, velocity: 5, acceleration: 50 },
    { kind: 'button', title: 'Turn pronet', span: 1, axis: 'pronet', do: 'move', by: -1, velocity: 5, acceleration: 50 },
    { kind: 'button', title: 'Home ismc', span: 1, axis: 'ismc', do: 'home', method: 7 },
    { kind: 'button', title: 'Halt reference', span: 1, axis: 'reference', do: 'stop' },
    { kind: 'button', title: 'Disable pronet', span: 1, axis: 'pronet', do: 'disable' },
    { kind: 'script', title: 'To and fro', span: 2, lines: 'reference enable\nrepeat 3\n  reference move by 1 velocity 10 acceleration 100\n  wait 0.05\n  reference move by -1 velocity 10\nend' },
    { kind: 'script', title: 'Two axes', span: 2, lines: 'ismc enable\njmc enable\nismc move by 0.5 velocity 5 acceleration 50\njmc move by 0.5 velocity 3 acceleration 20\nismc move by -0.5 velocity 5' },
    { kind: 'slider', title: 'Acceleration', span: 1, object: 'reference/6083:00', minimum: 1000, maximum: 2000000, step: 1000 },
    { kind: 'value', title: 'Speed', span: 1, channel: 'reference/velocity_rpm', format: 'decimal' },
  ],
};
const widgets: Widgets = {
  'Enable reference': [{ axis: 'reference', wants: { enable: 1 } }],
  Forward: [{ axis: 'reference', wants: { stop: 1, jog: 1 } }],
  'Turn reference': [{ axis: 'reference', wants: { stop: 1, move: 1 } }],
  'Turn pronet': [{ axis: 'pronet', wants: { stop: 1, move: 1 } }],
  'Home ismc': [{ axis: 'ismc', wants: { stop: 1, home: 1 } }],
  'To and fro': [{ axis: 'reference', wants: { stop: 1, enable: 1, move: 6 } }],
  'Two axes': [{ axis: 'ismc', wants: { stop: 1, enable: 1, move: 2 } }, { axis: 'jmc', wants: { stop: 1, enable: 1, move: 1 } }],
};

// ---- What is on the page ----

const motions = '^(Move \\+|Move|− Back|There and back|Go to zero|Run|Apply|Home|Make the small move|Measure a step|Measure the loop and propose gains|Measure a move|Measure and propose|Tune|Let the drive tune itself|Move and record|Sweep and record|Step and record|Turn .*|Home .*|Write th.*)$';
const commands = '^(Enable.*|Disable.*|Halt.*|Clear fault|Power .*|Cancel|Abort|End|Stop the script|\\d+ .*→.*)$';
// Not for the monkey: files, the stores of the drives, which a power cycle does not empty, and the speed of the time.
const never = '^(CSV|MCAP|PNG|Parquet|Store.*|Save.*|Export.*|Import.*|Print.*|pcap.*|candump.*|text|.*as (a )?file.*|.*Speed of virtual time.*|\\+100 ms|Delete.*|Rename)$';

interface Found {
  x: number;
  y: number;
  name: string;
}

// Scrolls one of the usable controls into view.
function find([kind, u, motionNames, commandNames, neverNames]: [string, number, string, string, string]): Found | null {
  const [motion, command, no] = [motionNames, commandNames, neverNames].map((text) => new RegExp(text));
  const nameOf = (element: Element) => (element.getAttribute('aria-label') ?? element.textContent ?? '').trim().replace(/\s+/g, ' ');
  const isUsable = (element: HTMLElement) => {
    if (element.matches(':disabled, [aria-disabled=true], [data-disabled], [download], [type=file]') || element.closest('[inert], [aria-hidden=true]')) return false;
    const box = element.getBoundingClientRect();
    return box.width > 0 && box.height > 0 && !no.test(nameOf(element));
  };
  const fits = (element: HTMLElement): boolean => {
    if (kind === 'motion') return element.matches('button') && !element.matches('.jog') && motion.test(nameOf(element));
    if (kind === 'command') return element.matches('button') && command.test(nameOf(element));
    if (kind === 'hold') return element.matches('.jog');
    if (kind === 'type') return element.matches('input:not([type=checkbox]):not([type=range]):not([type=file])');
    if (kind === 'go') return element.matches('nav a[href], .tabs a[href], [role=tab]');
    return !element.matches('.stop');
  };
  const all = [...document.querySelectorAll<HTMLElement>('button, a[href], input, select, textarea, [role=tab], [role=option], [role=menuitem], summary')];
  const usable = all.filter((element) => fits(element) && isUsable(element));
  if (usable.length === 0) return null;
  const chosen = usable[Math.min(usable.length - 1, Math.floor(u * usable.length))];
  chosen.scrollIntoView({ block: 'center', inline: 'nearest' });
  const box = chosen.getBoundingClientRect();
  return { x: box.x + box.width / 2, y: box.y + box.height / 2, name: nameOf(chosen).slice(0, 60) };
}

const keys = ['Tab', 'Shift+Tab', 'Enter', 'Space', 'Enter', 'Space', 'Escape', 'ArrowDown', 'ArrowUp', 'ArrowRight', 'ArrowLeft', 'Home', 'End', 'PageDown', '1', '-', 'a', 'Backspace', 'Delete'];
const numbers = ['1', '-1', '0.5', '2', '3', '0', '-0.25', '10', '60', '100', '300', '5', '1e9', '1,5', 'abc', ''];
const delays_ms = [5, 20, 60, 120, 250, 400];

// What the browser keeps at the beginning of a sequence.
const storage = { 'servodrome.tour': 'over', 'servodrome.boards': JSON.stringify([board]) };

function prepareStorage(kept: Record<string, string>) {
  if (!location.protocol.startsWith('http') || localStorage.getItem('servodrome.tour') !== null) return;
  for (const [key, value] of Object.entries(kept)) localStorage.setItem(key, value);
}

const longest_ms = 400; // between two looks of the page at the line

const later = (ms: number) => new Promise((resolve) => setTimeout(resolve, ms));

export class Player {
  model: Model;
  performed: string[] = []; // of this sequence, in words
  errors: string[] = []; // of the pages
  private stream!: TruthStream;
  private context = '';
  private pages: Tab[] = [];
  private present = 0; // index of the tab that is in front
  private held: 'pointer' | 'key' | null = null;
  private slow = { before_ms: 0, after_ms: 0 };

  private constructor(private readonly browser: Chromium, private readonly line: Line) {
    this.model = new Model(axes, widgets);
  }

  static async open(browser: Chromium): Promise<Player> {
    const player = new Player(browser, await new Line(lineFile('virtual')).start());
    const channels = axes.flatMap(({ name }) => ['velocity_rpm', 'state', 'position_counts'].map((signal) => ({ axis: name, signal })));
    player.stream = await TruthStream.open(player.line.address, channels, 1000, {
      job: (event) => player.model.job(event),
      samples: (samples) => player.model.take_samples(samples),
    });
    player.context = await browser.context();
    await player.newTab();
    await player.keepPlants();
    return player;
  }

  async end() {
    this.stream.close();
    await this.browser.endContext(this.context).catch(() => undefined); // the browser may have ended
    await this.line.end();
  }

  private get page() {
    return this.pages[this.present];
  }

  private async newTab() {
    const page = await this.browser.tab(this.context, 800, 600);
    const tab = this.pages.length;
    this.pages.push(page);
    this.present = tab;
    await page.bind('monkeyNote', (note) => this.model.note(tab, JSON.parse(note) as Note));
    await page.before(prepareStorage, storage);
    await page.before(logPage);
    page.onError = (text) => this.errors.push(`tab ${tab + 1}: ${text}`);
    await page.goto(this.line.address);
    await this.loaded();
  }

  // Until the new document shows its first panel.
  private async loaded() {
    const until = performance.now() + 30_000;
    const isThere = () => location.protocol.startsWith('http') && !window.monkeyLeft && document.querySelector('main > *') !== null;
    // The document may end while it is looked at.
    while (!(await this.page.evaluate(isThere).catch(() => false))) {
      if (performance.now() > until) throw new Error('the page does not load');
      await later(20);
    }
  }

  // ---- Time ----

  // Waits until the page has sent all requests of the last action and has their answers. The page sends its own requests in
  // tasks of 0 ms. Returns the page's address.
  private async settle(): Promise<string> {
    return this.page.evaluate(async (slow) => {
      window.monkeySlow = slow;
      const until = performance.now() + 3000;
      for (let quiet = 0; quiet < 3 && performance.now() < until; ) {
        await new Promise((resolve) => setTimeout(resolve, window.monkeyPending > 0 ? 4 : 0));
        quiet = window.monkeyPending > 0 ? 0 : quiet + 1;
      }
      return location.pathname + location.search;
    }, this.slow);
  }

  private async advance(ms: number) {
    // A busy machine may answer a request of the page only while the time passes: it counts as served at the end of that time.
    this.model.now += ms * ticksPerMs;
    const { ticks } = await this.line.call<{ ticks: number }>('POST', '/clock/advance', { ms });
    this.model.now = ticks;
    const until = performance.now() + 5000;
    // The last samples of the time come with the next: the server sends them every 10 ms.
    while (this.model.known < ticks - 11 * ticksPerMs) {
      if (performance.now() > until) throw new Error('the line sends no samples'); // nothing could be judged
      await later(1);
    }
  }

  private async pass(ms: number) {
    for (let left = ms; left > 0; left -= longest_ms) {
      await this.advance(Math.min(left, longest_ms));
      await this.settle();
    }
    const until = performance.now() + 3000;
    while (this.model.isAhead && performance.now() < until) await this.settle();
    this.model.judge();
  }

  // ---- A sequence ----

  // Every drive is switched off and on, so that it forgets what was written, and stands at zero.
  private async fresh({ start, isEnabled, before_ms, after_ms }: Sequence) {
    const { model, line } = this;
    model.isQuiet = true;
    this.slow = { before_ms: 0, after_ms: 0 };
    await this.release();
    while (this.pages.length > 1) await this.pages.pop()!.close();
    this.present = 0;
    await this.settle();
    await this.go('/nowhere'); // a page that does not exist: nothing runs there
    await this.settle();
    await line.call('POST', '/stop', {});
    await this.advance(20);
    await Promise.all(axes.map(async ({ name }) => {
      const path = `/axes/${name}`;
      if (model.disturbed(name)) await this.repair(path);
      await line.call('POST', `${path}/power`, { action: 'cycle' });
      // A number in a field is sent when the page is left, and its note can be lost then: so the plant is always restored.
      await line.call('PUT', `${path}/plant`, { ...this.plants[name], position_counts: 0 });
    }));
    await this.advance(700);
    if (isEnabled) {
      await Promise.all(axes.map(({ name }) => line.call('POST', `/axes/${name}/jobs`, { do: 'enable' })));
      await this.advance(300);
    }
    // The guide and the dashboards begin anew.
    await this.page.evaluate((kept) => {
      localStorage.clear();
      for (const [key, value] of Object.entries(kept)) localStorage.setItem(key, value);
    }, storage);
    this.slow = { before_ms, after_ms };
    await this.go(start);
    await this.pass(40);
    await this.readRamps();
    model.begin();
    model.isQuiet = false;
  }

  private async repair(path: string) {
    const { line } = this;
    await line.call('DELETE', `${path}/faults`);
    const { inputs } = await line.call<{ inputs: Record<string, unknown> }>('GET', `${path}/inputs`);
    await line.call('PUT', `${path}/inputs`, Object.fromEntries(Object.keys(inputs).map((input) => [input, null])));
  }

  private plants: Record<string, Record<string, unknown>> = {};

  private async keepPlants() {
    for (const { name } of axes) {
      const { locked_rotor, load_torque_nm, load_inertia_kgm2, friction_nm, supply_v, ambient_c } = await this.line.call<Record<string, unknown>>('GET', `/axes/${name}/plant`);
      this.plants[name] = { locked_rotor, load_torque_nm, load_inertia_kgm2, friction_nm, supply_v, ambient_c };
    }
  }

  // The slope of the quick stop, 6085h.
  private async readRamps() {
    await Promise.all(axes.map(async ({ name }) => {
      const path = `/axes/${name}`;
      const { values } = await this.line.call<{ values: Record<string, unknown> }>('GET', `${path}/values?objects=6085:00`).catch(() => ({ values: {} as Record<string, unknown> }));
      const { acceleration_per_rps2: scale } = await this.line.call<{ acceleration_per_rps2: number | null }>('GET', `${path}/units`).catch(() => ({ acceleration_per_rps2: null }));
      const slope = Number(values['6085:00']);
      this.model.setRamp(name, slope > 0 && scale ? (60 * slope) / scale : Infinity);
    }));
  }

  async play(sequence: Sequence, length = sequence.steps.length): Promise<string[]> {
    this.performed = [];
    this.errors = [];
    await this.fresh(sequence);
    for (const step of sequence.steps.slice(0, length)) {
      const said = await this.act(step);
      this.model.count(`action: ${step.kind}`);
      this.performed.push(`${step.kind}: ${said}`);
      await this.settle();
      await this.pass(delays_ms[of(step.u[2], delays_ms.length)]);
      if (this.model.violations.length > 0 || this.errors.length > 0) break;
    }
    if (this.model.violations.length + this.errors.length === 0) {
      await this.release();
      await this.settle();
      await this.pass(300);
    }
    const found = [...this.model.violations, ...this.errors];
    return found.length > 0 ? [...found, ...(await this.lastChanges())] : found;
  }

  // Lists the last jobs and the last writes to the drives with their authors. They explain most findings.
  private async lastChanges(): Promise<string[]> {
    const { jobs } = await this.line.call<{ jobs: { id: number; axis: string; do: string; state: string; began_tick: number; note?: string }[] }>('GET', '/jobs');
    const told = jobs.slice(-12).map(({ id, axis, do: what, state, began_tick, note }) => `  ${(began_tick / ticksPerMs).toFixed(3)} ms ${axis} job ${id} ${what}: ${state} ${note ?? ''}`);
    interface Change { axis: string; object: string; name: string; before: unknown; after: unknown; who: string; time_ns: number }
    const { changes } = await this.line.call<{ changes: Change[] }>('GET', '/changes?limit=40&newest=true');
    return told.concat(changes.map(({ axis, object, before, after, who, time_ns }) => `  ${(time_ns / 1e6).toFixed(3)} ms ${axis} ${object}: ${String(before)} -> ${String(after)} by ${who}`));
  }

  private async go(path: string) {
    await this.page.evaluate((to) => {
      history.pushState(null, '', to);
      dispatchEvent(new PopStateEvent('popstate'));
      window.monkeyNote(JSON.stringify({ kind: 'went', path: to })); // what the page sends until here it may send
    }, path);
  }

  private async here(): Promise<string> {
    const path = await this.settle();
    this.model.leave(this.present, path);
    return path;
  }

  // Where the controls are that this page does not have.
  private async elsewhere(kind: string, u: number): Promise<string> {
    const { name } = axes[of(u, axes.length)];
    const path = kind === 'hold' ? (u * 7 % 1 < 0.3 ? '/boards' : `/axis/${name}?do=jog`) : address(random(Math.floor(u * 2 ** 32)));
    await this.go(path);
    await this.settle();
    return `to ${path}`;
  }

  private async click(kind: string, u: number): Promise<string | null> {
    const found = await this.page.evaluate(find, [kind, u, motions, commands, never] as [string, number, string, string, string]);
    if (!found) return null;
    await this.page.click(found.x, found.y);
    return `"${found.name}"`;
  }

  // A jog has ended when it was let go: by the page, or by the server, which misses its sign of life for 500 ms.
  private async release() {
    const was = this.held;
    this.held = null;
    if (was === 'pointer') await this.page.letGo();
    if (was === 'key') await this.page.keyUp('Space');
    if (was) await this.noJog();
  }

  private async noJog() {
    const began = performance.now();
    for (let looks = 0; ; ++looks) {
      await this.settle();
      const { jobs } = await this.line.call<{ jobs: { id: number; axis: string; do: string; state: string; ending?: boolean; began_tick: number }[] }>('GET', '/jobs');
      const left = jobs.filter((job) => job.do === 'jog' && job.state === 'running' && !job.ending);
      if (left.length === 0) return;
      const waited_ms = performance.now() - began;
      // At each look the page has run its timers, of which that of a jog has 20 ms, so a slow machine is no finding.
      if (looks === 250) {
        const page = await this.page.evaluate(() => {
          const { activeElement } = document;
          const jogs = [...document.querySelectorAll('.jog')].map((each) => (each.matches(':disabled') ? 'disabled' : 'enabled'));
          return `focus: ${activeElement?.className || activeElement?.tagName} (${document.hasFocus()}); jog buttons: ${jogs.join(', ')}; requests on their way: ${window.monkeyPending}`;
        });
        this.model.violations.push(`${left[0].axis}: the jog ${left[0].id} goes on ${Math.round(waited_ms)} ms after it was let go; ${page}`);
        return;
      }
      // The server looks at the signs of life, in wall time, when time passes. It then halts the axis, and the job does not say so.
      this.model.now = (await this.line.call<{ ticks: number }>('POST', '/clock/advance', { ms: waited_ms < 1000 ? 1 : 10 })).ticks;
      await later(20);
    }
  }

  // A jog that is held goes on as long as its button has the focus. Enter and the space bar end it when they come up.
  private async mayGoOn(key: string) {
    if (!this.held) return;
    const isEnd = ['Enter', 'Space'].includes(key);
    if (isEnd || !(await this.page.evaluate(() => document.activeElement?.matches('.jog') ?? false))) await this.noJog();
  }

  private async act({ kind, u }: Step): Promise<string> {
    const { page } = this;
    // A pointer that holds a button can do nothing else. Keys can be pressed meanwhile.
    if (this.held === 'pointer' && ['motion', 'command', 'any', 'hold', 'stop', 'go', 'type'].includes(kind)) await this.release();
    if (this.held === 'key' && ['hold', 'key', 'type', 'focus'].includes(kind)) await this.release();
    switch (kind) {
      case 'motion': case 'command': case 'any': case 'go': {
        const before = await this.settle();
        const said = (await this.click(kind, u[0])) ?? `${await this.elsewhere(kind, u[1])}, ${(await this.click(kind, u[0])) ?? 'nothing'}`;
        const after = await this.settle();
        if (after !== before) this.model.leave(this.present, after);
        await this.mayGoOn(''); // unless the click took the focus
        return said;
      }
      case 'hold': {
        const look = () => page.evaluate(find, [kind, u[0], motions, commands, never] as [string, number, string, string, string]);
        let found = await look();
        if (!found) {
          await this.elsewhere(kind, u[1]);
          found = await look();
        }
        if (!found) return 'nothing there';
        if (u[1] < 0.6) {
          await page.press(found.x, found.y);
          this.held = 'pointer';
        } else {
          await page.evaluate(([x, y]) => document.elementFromPoint(x, y)?.closest('button')?.focus(), [found.x, found.y]);
          await page.keyDown('Space');
          this.held = 'key';
        }
        return `"${found.name}" with the ${this.held}`;
      }
      case 'release': {
        const was = this.held;
        await this.release();
        return was ?? 'nothing held';
      }
      case 'stop': {
        const [x, y] = await page.evaluate(() => {
          const box = document.querySelector('button.stop')!.getBoundingClientRect();
          return [box.x + box.width / 2, box.y + box.height / 2];
        });
        await page.click(x, y);
        return 'by the button';
      }
      case 'stop key':
        await page.keyPress('Control+Space');
        return 'Ctrl+Space';
      case 'back':
        if (this.held) await this.release();
        if (!(await page.isFirst())) await page.evaluate(() => history.back());
        await later(20);
        return this.here();
      case 'type': {
        const found = await page.evaluate(find, [kind, u[0], motions, commands, never] as [string, number, string, string, string]);
        if (!found) return 'nothing there';
        await page.click(found.x, found.y);
        await page.keyPress('Control+a');
        const text = numbers[of(u[1], numbers.length)];
        if (text === '') await page.keyPress('Delete');
        else await page.insert(text);
        if (this.held) await this.noJog();
        return `"${text}"`;
      }
      case 'key': {
        const key = keys[of(u[1], keys.length)];
        const times = key.includes('Tab') ? 1 + of(u[0], 6) : 1;
        for (let i = 0; i < times; ++i) await page.keyPress(key);
        await this.here();
        await this.mayGoOn(key);
        return `${key} × ${times}`;
      }
      case 'focus':
        await page.evaluate((at) => {
          const all = [...document.querySelectorAll<HTMLElement>('button:not(:disabled), a[href], input:not(:disabled), [tabindex="0"]')];
          all[Math.min(all.length - 1, Math.floor(at * all.length))]?.focus();
        }, u[0]);
        await this.mayGoOn('');
        return 'elsewhere';
      case 'wait':
        await this.pass(u[0] > 0.9 ? 8000 : 300 + Math.round(900 * u[0]));
        return 'longer';
      case 'blur':
        await page.evaluate(() => void dispatchEvent(new Event('blur')));
        if (this.held) await this.noJog();
        return 'the window loses the focus';
      case 'reload':
        await page.evaluate(() => void (window.monkeyLeft = true));
        await page.send('Page.reload');
        await this.loaded();
        if (this.held) await this.noJog();
        return this.settle();
      case 'tab':
        if (this.held) await this.release();
        if (this.pages.length < 2) await this.newTab();
        else this.present = 1 - this.present;
        if (u[0] < 0.3) await this.page.send('Page.bringToFront');
        await this.go(address(random(Math.floor(u[1] * 2 ** 32))));
        return `tab ${this.present + 1}, ${await this.settle()}`;
    }
    return '';
  }
}
