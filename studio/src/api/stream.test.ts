import { afterEach, beforeEach, expect, test, vi } from 'vitest';
import { Stream, type StreamListener } from './stream';

// Replaces the browser's WebSocket; the test plays the server.
class FakeSocket {
  static all: FakeSocket[] = [];
  sent: Record<string, unknown>[] = [];
  binaryType = '';
  onopen?: () => void;
  onmessage?: (event: { data: unknown }) => void;
  onclose?: () => void;
  closed = false;
  constructor(readonly address: string) {
    FakeSocket.all.push(this);
  }
  send(text: string) {
    this.sent.push(JSON.parse(text) as Record<string, unknown>);
  }
  close() {
    this.closed = true;
  }
  say(message: unknown) {
    this.onmessage?.({ data: JSON.stringify(message) });
  }
}

const listener = () => ({ connected: vi.fn(), lost: vi.fn(), axes: vi.fn(), event: vi.fn() }) satisfies StreamListener;

beforeEach(() => {
  FakeSocket.all = [];
  vi.stubGlobal('WebSocket', FakeSocket);
  vi.useFakeTimers();
});
afterEach(() => {
  vi.useRealTimers();
  vi.unstubAllGlobals();
});

test('asks for the axes and tells what comes', () => {
  const heard = listener();
  new Stream('ws://here', 20, heard);
  const [socket] = FakeSocket.all;
  socket.onopen?.();
  expect(socket.sent).toEqual([{ watch: { axes: 20 } }]);
  socket.say({ hello: { start: 'a' } });
  socket.say({ axes: [{ name: 'x' }], clock: { ticks: 3 } });
  socket.say({ event: { kind: 'fault', axis: 'x' } });
  expect(heard.connected).toHaveBeenCalledWith({ start: 'a' });
  expect(heard.axes).toHaveBeenCalledWith([{ name: 'x' }], { ticks: 3 });
  expect(heard.event).toHaveBeenCalledWith({ kind: 'fault', axis: 'x' });
});

test('comes back after a loss, and subscribes again', () => {
  const heard = listener();
  const stream = new Stream('ws://here', 20, heard);
  FakeSocket.all[0].onopen?.();
  const accepted = vi.fn();
  const end = stream.subscribe({ channels: [{ axis: 'x', signal: 'torque_nm' }], rate_hz: 100, accepted, frame: vi.fn() });
  FakeSocket.all[0].onclose?.();
  expect(heard.lost).toHaveBeenCalledOnce();
  vi.advanceTimersByTime(250);
  FakeSocket.all[1].onopen?.();
  const subscribe = { subscribe: { id: 1, channels: [{ axis: 'x', signal: 'torque_nm' }], rate_hz: 100 } };
  expect(FakeSocket.all[1].sent).toEqual([{ watch: { axes: 20 } }, subscribe]);
  FakeSocket.all[1].say({ subscribed: { id: 1, rate_hz: 100, tick: 0, channels: [] } });
  expect(accepted).toHaveBeenCalledOnce();
  end();
  expect(FakeSocket.all[1].sent.at(-1)).toEqual({ unsubscribe: { id: 1 } });
});

test('a refused subscription is told to who asked', () => {
  const stream = new Stream('ws://here', 20, listener());
  FakeSocket.all[0].onopen?.();
  const refused = vi.fn();
  stream.subscribe({ channels: [], rate_hz: 1, refused, frame: vi.fn() });
  FakeSocket.all[0].say({ error: { what: 'no such axis' }, id: 1 });
  expect(refused).toHaveBeenCalledWith({ what: 'no such axis' });
});

test('a server that is silent is asked, and given up when it does not answer', () => {
  const heard = listener();
  new Stream('ws://here', 20, heard);
  const [socket] = FakeSocket.all;
  socket.onopen?.();
  for (let i = 0; i < 3; ++i) {
    vi.advanceTimersByTime(4000);
    expect(socket.sent.at(-1)).toEqual({ unsubscribe: { id: 0 } });
    socket.say({ unsubscribed: { id: 0 } });
  }
  expect(heard.lost).not.toHaveBeenCalled();
  vi.advanceTimersByTime(9000);
  expect(heard.lost).toHaveBeenCalledOnce();
  expect(socket.closed).toBe(true);
  vi.advanceTimersByTime(1000);
  expect(FakeSocket.all).toHaveLength(2);
});

test('one that sends is not asked', () => {
  const heard = listener();
  new Stream('ws://here', 20, heard);
  const [socket] = FakeSocket.all;
  socket.onopen?.();
  for (let i = 0; i < 20; ++i) {
    vi.advanceTimersByTime(1000);
    socket.say({ axes: [] });
  }
  expect(socket.sent).toHaveLength(1);
  expect(heard.lost).not.toHaveBeenCalled();
});

test('a connection that does not open is tried again', () => {
  const heard = listener();
  new Stream('ws://here', 20, heard);
  vi.advanceTimersByTime(6000);
  expect(heard.lost).toHaveBeenCalled();
  expect(FakeSocket.all.length).toBeGreaterThan(1);
});
