import { type ChildProcess, spawn } from 'node:child_process';
import { createSocket } from 'node:dgram';
import { once } from 'node:events';
import { mkdtempSync, rmSync, writeFileSync } from 'node:fs';
import { type AddressInfo, connect, createServer, type Socket } from 'node:net';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { fileURLToPath } from 'node:url';

// The built program, on ports of its own, with the built page: a line of virtual drives, or the studio of drives on buses.

const root = fileURLToPath(new URL('../..', import.meta.url));
export const servodrome = process.env.SERVODROME ?? join(root, 'build/release/src/app/servodrome');
const page = process.env.SERVODROME_STUDIO ?? join(root, 'build/studio');

interface Axis {
  name: string;
  product: string;
  counts: number; // per revolution
  switches: boolean;
  home: string; // method, as the page's list begins
}

// One of each product, as in lines/default.toml.
export const axes: Axis[] = [
  { name: 'ismc', product: 'ismc', counts: 131072, switches: true, home: '7' },
  { name: 'reference', product: 'generic402', counts: 131072, switches: true, home: '7' },
  { name: 'pronet', product: 'pronet', counts: 131072, switches: true, home: '20' },
  { name: 'ismk', product: 'ismk', counts: 65536, switches: false, home: '33' },
  { name: 'jmc', product: 'jmc_ec', counts: 4000, switches: true, home: '7' },
];

export function lineFile(clock: 'real' | 'virtual' = 'real'): string {
  const bus = (name: string, type: string) => `[[bus]]\nname = "${name}"\ntype = "${type}"\n\n`;
  const travel = ({ counts, switches }: Axis) =>
    `  [axis.travel]\n  counts_per_unit = ${counts}\n  low_stop = -11\n  high_stop = 11\n` +
    (switches ? '  negative_limit = -10\n  positive_limit = 10\n  home = { from = -0.5, to = 0.5 }\n' : '');
  const axis = (each: Axis, i: number) =>
    `[[axis]]\nname = "${each.name}"\nproduct = "${each.product}"\n` +
    (each.product === 'jmc_ec' ? 'bus = "ecat"\n' : `bus = "can0"\nnode = ${i + 1}\n`) +
    `${travel(each)}\n`;
  return `clock = "${clock}"\n\n${bus('can0', 'can')}${bus('ecat', 'ethercat')}${axes.map(axis).join('')}`;
}

interface Ready {
  api: string;
  buses: { name: string; links: string[] }[];
}

// STUDIO_LATE_MS=400: what the page and the server send each other is late by up to 400 ms, in its order, as over a slow network or
// on a busy machine. A test that needs a fast machine then fails. Requests of the test itself are not late.
const late_ms = Number(process.env.STUDIO_LATE_MS ?? 0);

// Returns the port of a proxy in front of `port`.
async function slowNetwork(port: number): Promise<number> {
  const pass = (from: Socket, to: Socket) => {
    let before = Promise.resolve();
    let due = 0;
    const later = (act: () => void) => {
      const at = (due = Math.max(due, performance.now() + late_ms * Math.random()));
      before = before.then(() => new Promise((resolve) => setTimeout(() => resolve(act()), at - performance.now())));
    };
    from.on('data', (data) => later(() => to.destroyed || to.write(data)));
    from.on('close', () => later(() => to.destroy()));
    from.on('error', () => undefined); // "close" follows
  };
  const proxy = createServer((near) => {
    const far = connect(port, '127.0.0.1');
    pass(near, far);
    pass(far, near);
  });
  proxy.listen(0, '127.0.0.1').unref();
  await once(proxy, 'listening');
  return (proxy.address() as AddressInfo).port;
}

abstract class Program {
  private process: ChildProcess | null = null;
  private direct = ''; // http://127.0.0.1:PORT
  protected readonly folder = mkdtempSync(join(tmpdir(), 'studio-'));
  address = ''; // the same for the page: perhaps behind a slow network
  listens = '127.0.0.1';
  environment: Record<string, string> = {}; // more of it
  ready: Ready = { api: '', buses: [] };

  protected abstract words(): string[];

  // On the port it had before, if it ran before.
  async start(): Promise<this> {
    const port = this.direct === '' ? '0' : new URL(this.direct).port;
    const env = { ...process.env, ...this.environment };
    const child = spawn(servodrome, [...this.words(), '--api', `${this.listens}:${port}`, '--json'], { cwd: this.folder, env });
    this.process = child;
    let output = '';
    let errors = '';
    this.fate = () => (child.exitCode === null && child.signalCode === null ? 'it runs' : `it ended with ${child.exitCode ?? child.signalCode}: ${errors}`);
    child.stderr.on('data', (data: Buffer) => (errors += data.toString()));
    this.ready = await new Promise<Ready>((resolve, reject) => {
      child.stdout.on('data', (data: Buffer) => {
        output += data.toString();
        if (output.includes('\n')) resolve(JSON.parse(output.slice(0, output.indexOf('\n'))) as Ready);
      });
      child.on('error', reject);
      child.on('exit', (code) => reject(new Error(`servodrome ended with ${code}: ${errors}`)));
    });
    this.direct = this.ready.api.replace('/api/v1', '').replace('0.0.0.0', '127.0.0.1');
    if (this.address === '') this.address = late_ms > 0 ? `http://127.0.0.1:${await slowNetwork(Number(new URL(this.direct).port))}` : this.direct;
    return this;
  }

  private fate = () => 'it was never started';

  // It does nothing until it goes on, and closes nothing.
  hang() {
    this.process?.kill('SIGSTOP');
  }

  goOn() {
    this.process?.kill('SIGCONT');
  }

  async stop(): Promise<void> {
    const { process } = this;
    this.process = null;
    if (!process || process.exitCode !== null) return;
    const ended = new Promise((resolve) => process.once('exit', resolve));
    process.kill('SIGINT');
    await ended;
  }

  async end(): Promise<void> {
    await this.stop();
    rmSync(this.folder, { recursive: true, force: true });
  }

  async call<T>(method: string, path: string, body?: unknown): Promise<T> {
    const answer = await fetch(`${this.direct}/api/v1${path}`, { method, ...(body === undefined ? {} : { body: JSON.stringify(body) }) }).catch((error: Error) => {
      throw new Error(`${method} ${path}: ${String(error.cause ?? error)}; the server: ${this.fate()}`);
    });
    const text = await answer.text();
    if (!answer.ok) throw new Error(`${method} ${path}: ${answer.status} ${text}`);
    return (text === '' ? undefined : JSON.parse(text)) as T;
  }
}

export class Line extends Program {
  // `links`: "can0=socketcand:127.0.0.1:0/can0" and so on, for tests that reach its drives by a bus.
  constructor(text: string, private links: string[] = []) {
    super();
    writeFileSync(join(this.folder, 'line.toml'), text);
  }

  protected words(): string[] {
    return ['up', 'line.toml', '--studio', page, ...this.links.flatMap((link) => ['--bus', link])];
  }

  // From now on by the links that it has now, also when it is started again.
  async start(): Promise<this> {
    await super.start();
    if (this.links.length > 0) this.links = this.ready.buses.flatMap(({ name, links }) => links.map((link) => `${name}=${link}`));
    return this;
  }

  linkOf(bus: string): string {
    return this.ready.buses.find(({ name }) => name === bus)?.links[0] ?? '';
  }

  // Lets the drives of the EtherCAT bus wait two seconds instead of 100 ms for process data, until the line starts again: a
  // studio on a busy machine is slow, and not gone. Each master may write this watchdog (0420h); the studio keeps its value.
  async waitForSlowMaster(): Promise<this> {
    const [, host, port] = /^udp:(.*):(\d+)$/.exec(this.linkOf('ecat'))!;
    const frame = Buffer.alloc(16);
    frame.writeUInt16LE(0x100e, 0); // commands, 14 bytes
    frame.writeUInt8(8, 2); // BWR
    frame.writeUInt16LE(0x0420, 6);
    frame.writeUInt16LE(2, 8);
    frame.writeUInt16LE(20_000, 12); // in 100 us
    const socket = createSocket('udp4');
    const answered = once(socket, 'message') as Promise<[Buffer]>;
    socket.send(frame, Number(port), host);
    const [answer] = await answered;
    socket.close();
    if (answer.readUInt16LE(14) !== 1) throw new Error('no drive has taken over its watchdog');
    return this;
  }
}

export class Studio extends Program {
  constructor(private readonly buses: string[]) {
    super();
  }

  protected words(): string[] {
    return ['studio', '--page', page, '--timeout', '2', ...this.buses.flatMap((bus) => ['--bus', bus])];
  }
}

// `servodrome studio FOLDER`.
export class ProjectServer extends Program {
  constructor(private readonly of: string) {
    super();
  }

  protected words(): string[] {
    return ['studio', this.of, '--page', page];
  }
}
