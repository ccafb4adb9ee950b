import { randomBytes } from 'node:crypto';
import { request } from 'node:http';
import type { Socket } from 'node:net';

// A client of the WebSocket /api/v1/stream (docs/bench-api.md) without a browser: Node.js 18 has no WebSocket.

export interface JobEvent {
  tick: number;
  axis: string;
  job: { id: number; do: string; state: string; ending?: boolean; error?: { what: string } };
}

export interface Samples {
  tick: number; // of the first sample
  stride: number; // ticks from sample to sample
  channels: Float64Array[];
}

export interface Listener {
  job(event: JobEvent): void;
  samples(samples: Samples): void;
}

interface Channel {
  axis: string;
  signal: string;
}

export class TruthStream {
  private rest = Buffer.alloc(0);
  private opcode = 0; // of the message that is being received
  private parts: Buffer[] = [];

  private constructor(
    private readonly socket: Socket,
    private readonly listener: Listener,
  ) {
    socket.on('data', (data) => this.take(data));
    socket.on('error', () => undefined); // the line has ended
  }

  static open(address: string, channels: Channel[], rate_hz: number, listener: Listener): Promise<TruthStream> {
    return new Promise((resolve, reject) => {
      const headers = { Connection: 'Upgrade', Upgrade: 'websocket', 'Sec-WebSocket-Version': '13', 'Sec-WebSocket-Key': randomBytes(16).toString('base64') };
      const asked = request(`${address}/api/v1/stream`, { headers });
      asked.on('upgrade', (_, socket, head) => {
        const made = new TruthStream(socket as Socket, listener);
        made.take(head);
        made.send(0x1, Buffer.from(JSON.stringify({ subscribe: { id: 1, channels, rate_hz } })));
        resolve(made);
      });
      asked.on('response', (answer) => reject(new Error(`the stream was refused: ${answer.statusCode}`)));
      asked.on('error', reject);
      asked.end();
    });
  }

  close() {
    this.socket.destroy();
  }

  // RFC 6455, 5.2. A client must mask; a mask of 0 changes nothing.
  private send(opcode: number, payload: Buffer) {
    const length = payload.length < 126 ? Buffer.from([0x80 | payload.length]) : Buffer.from([0x80 | 126, payload.length >> 8, payload.length & 0xff]);
    this.socket.write(Buffer.concat([Buffer.from([0x80 | opcode]), length, Buffer.alloc(4), payload]));
  }

  private take(data: Buffer) {
    this.rest = Buffer.concat([this.rest, data]);
    for (;;) {
      if (this.rest.length < 2) return;
      const short = this.rest[1] & 0x7f;
      const head = short === 127 ? 10 : short === 126 ? 4 : 2;
      if (this.rest.length < head) return;
      const length = short === 127 ? Number(this.rest.readBigUInt64BE(2)) : short === 126 ? this.rest.readUInt16BE(2) : short;
      if (this.rest.length < head + length) return;
      this.frame(this.rest[0], this.rest.subarray(head, head + length));
      this.rest = this.rest.subarray(head + length);
    }
  }

  // A long message comes in several frames; a ping may come between them.
  private frame(first: number, payload: Buffer) {
    const opcode = first & 0x0f;
    if (opcode === 0x9) return this.send(0xa, payload);
    if (opcode !== 0) this.opcode = opcode;
    this.parts.push(Buffer.from(payload));
    if ((first & 0x80) === 0) return;
    const whole = Buffer.concat(this.parts);
    this.parts = [];
    this.message(this.opcode, whole);
  }

  private message(opcode: number, payload: Buffer) {
    if (opcode === 0x2) this.listener.samples(decode(payload));
    if (opcode !== 0x1) return;
    const { event, error } = JSON.parse(payload.toString()) as { event?: { kind: string } & JobEvent; error?: { what: string } };
    if (error) throw new Error(`the stream was refused: ${error.what}`);
    if (event?.kind === 'job') this.listener.job(event);
  }
}

function decode(payload: Buffer): Samples {
  const [count, channels] = [payload.readUInt32LE(16), payload.readUInt32LE(20)];
  const value = (i: number) => payload.readDoubleLE(24 + 8 * i);
  return {
    stride: payload.readUInt32LE(4),
    tick: Number(payload.readBigUInt64LE(8)),
    channels: Array.from({ length: channels }, (_, channel) => Float64Array.from({ length: count }, (_, i) => value(channel * count + i))),
  };
}
