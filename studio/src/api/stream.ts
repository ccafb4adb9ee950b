import { decodeFrame, type Frame } from './frame';
import type { AxisView, Channel, ChannelRequest, Clock, Job, Problem } from './types';

// The WebSocket /api/v1/stream: one for the page. It comes back by itself, and then asks again for all it was asked for.

export interface ServerEvent {
  kind: string;
  axis?: string;
  tick?: number;
  job?: Job; // of "job"
  [key: string]: unknown;
}

export interface StreamListener {
  connected(hello: { version?: string; start: string; tick?: number }): void;
  lost(): void;
  axes(views: AxisView[], clock?: Clock): void;
  event(event: ServerEvent): void;
}

export interface Subscription {
  channels: ChannelRequest[];
  rate_hz: number;
  accepted?(answer: { rate_hz: number; tick: number; channels: Channel[] }): void;
  refused?(problem: Problem): void;
  frame(frame: Frame): void;
}

interface Message {
  hello?: { version?: string; start: string; tick?: number };
  axes?: AxisView[];
  clock?: Clock;
  event?: ServerEvent;
  subscribed?: { id: number; rate_hz: number; tick: number; channels: Channel[] };
  error?: Problem;
  id?: number;
}

const retry_ms = [250, 500, 1000, 2000];

export class Stream {
  private socket: WebSocket | null = null;
  private readonly subscriptions = new Map<number, Subscription>();
  private nextId = 1;
  private attempts = 0;
  private open = false;

  constructor(
    private readonly address: string,
    private readonly watch_hz: number,
    private readonly listener: StreamListener,
  ) {
    this.connect();
  }

  // Answers how to end it.
  subscribe(subscription: Subscription): () => void {
    const id = this.nextId++;
    this.subscriptions.set(id, subscription);
    this.request(id, subscription);
    return () => {
      this.subscriptions.delete(id);
      this.send({ unsubscribe: { id } });
    };
  }

  private request(id: number, { channels, rate_hz }: Subscription) {
    this.send({ subscribe: { id, channels, rate_hz } });
  }

  private send(message: unknown) {
    if (this.open) this.socket?.send(JSON.stringify(message));
  }

  private connect() {
    const socket = new WebSocket(this.address);
    socket.binaryType = 'arraybuffer';
    this.socket = socket;
    socket.onopen = () => {
      this.open = true;
      this.attempts = 0;
      this.send({ watch: { axes: this.watch_hz } });
      for (const [id, subscription] of this.subscriptions) this.request(id, subscription);
    };
    socket.onmessage = ({ data }: MessageEvent<string | ArrayBuffer>) => {
      if (typeof data === 'string') this.text(JSON.parse(data) as Message);
      else {
        const frame = decodeFrame(data);
        this.subscriptions.get(frame.id)?.frame(frame);
      }
    };
    socket.onclose = () => {
      this.open = false;
      this.listener.lost();
      setTimeout(() => this.connect(), retry_ms[Math.min(this.attempts++, retry_ms.length - 1)]);
    };
  }

  private text(message: Message) {
    if (message.hello) this.listener.connected(message.hello);
    if (message.axes) this.listener.axes(message.axes, message.clock);
    if (message.event) this.listener.event(message.event);
    if (message.subscribed) this.subscriptions.get(message.subscribed.id)?.accepted?.(message.subscribed);
    if (message.error && message.id !== undefined) this.subscriptions.get(message.id)?.refused?.(message.error);
  }
}
