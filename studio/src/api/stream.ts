import { decodeFrame, type Frame } from './frame';
import type { AxisView, Channel, ChannelRequest, Clock, Job, Problem } from './types';

// The WebSocket /api/v1/stream; the page has one. After a loss it reconnects by itself and renews all subscriptions.

export interface ServerEvent {
  kind: string;
  axis?: string;
  tick?: number;
  job?: Job; // in events of the kind "job"
  [key: string]: unknown;
}

export interface StreamListener {
  connected(hello: { version?: string; start: string; tick?: number }): void;
  lost(wasOpen: boolean): void; // the stream reconnects, unless rest() is called
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
const look_ms = 1000;
const silence_ms = 3000; // without a message; then the page sends a request as a keepalive
const break_ms = 5000; // without a message: the page slept, or the connection was interrupted
const patience_ms = 4000; // timeout of the keepalive's answer, and of opening a connection
// No subscription has this id. The server answers the request to end it and does nothing else: a keepalive.
const unused_id = 0;

export class Stream {
  private socket: WebSocket | null = null;
  private readonly subscriptions = new Map<number, Subscription>();
  private nextId = 1;
  private attempts = 0;
  private open = false;
  private heard = 0; // time of the last message, in ms
  private again: ReturnType<typeof setTimeout> | undefined;
  private heardAt = Date.now(); // of the last message; unlike performance.now(), this clock runs while the computer sleeps
  private breaks = 0;
  private asked: number | null = null; // time of the unanswered keepalive or connection attempt, in ms; null: none

  constructor(
    private readonly address: string,
    private readonly watch_hz: number,
    private readonly listener: StreamListener,
    private readonly subprotocols: () => string[] = () => [],
  ) {
    this.connect();
    setInterval(() => this.look(), look_ms);
  }

  // Returns the function that ends the subscription.
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
    const socket = new WebSocket(this.address, this.subprotocols());
    socket.binaryType = 'arraybuffer';
    this.socket = socket;
    this.asked = performance.now();
    socket.onopen = () => {
      this.open = true;
      this.attempts = 0;
      this.hear();
      this.send({ watch: { axes: this.watch_hz } });
      for (const [id, subscription] of this.subscriptions) this.request(id, subscription);
    };
    socket.onmessage = ({ data }: MessageEvent<string | ArrayBuffer>) => {
      this.hear();
      if (typeof data === 'string') this.text(JSON.parse(data) as Message);
      else {
        const frame = decodeFrame(data);
        this.subscriptions.get(frame.id)?.frame(frame);
      }
    };
    socket.onclose = () => this.lose();
  }

  private hear() {
    if (Date.now() - this.heardAt > break_ms) ++this.breaks;
    this.heardAt = Date.now();
    this.heard = performance.now();
    this.asked = null;
  }

  // Changes if the page has missed messages in the meantime: it slept, or lost its connection. A sequence of commands then ends.
  interruptions(): number {
    return this.breaks + (Date.now() - this.heardAt > break_ms ? 0.5 : 0);
  }

  // The browser reports no close when a cable is pulled or the server hangs. So after `silence_ms` without a message the
  // page sends a keepalive, and reconnects if no answer comes within `patience_ms`. Silence alone does not end the
  // connection: after the computer has slept, received messages may still wait to be read.
  private look() {
    const now = performance.now();
    if (this.asked === null) {
      if (this.open && now - this.heard >= silence_ms) {
        this.asked = now;
        this.send({ unsubscribe: { id: unused_id } });
      }
    } else if (now - this.asked >= patience_ms) {
      const socket = this.socket;
      this.lose();
      socket?.close();
    }
  }

  private lose() {
    const { socket, open } = this;
    if (!socket) return;
    socket.onopen = socket.onmessage = socket.onclose = null;
    this.socket = null;
    if (open) ++this.breaks;
    this.open = false;
    this.asked = null;
    this.again = setTimeout(() => this.connect(), retry_ms[Math.min(this.attempts++, retry_ms.length - 1)]);
    this.listener.lost(open);
  }

  // Stops reconnecting until retry() is called.
  rest() {
    clearTimeout(this.again);
  }

  retry() {
    clearTimeout(this.again);
    this.attempts = 0;
    if (!this.socket) this.connect();
  }

  private text(message: Message) {
    if (message.hello) this.listener.connected(message.hello);
    if (message.axes) this.listener.axes(message.axes, message.clock);
    if (message.event) this.listener.event(message.event);
    if (message.subscribed) this.subscriptions.get(message.subscribed.id)?.accepted?.(message.subscribed);
    if (message.error && message.id !== undefined) this.subscriptions.get(message.id)?.refused?.(message.error);
  }
}
