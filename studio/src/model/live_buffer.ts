import { ticksPerSecond, type Frame } from '../api/frame';

// The last seconds of a subscription. Under backpressure the server doubles the stride of the frames, so each sample is
// stored with its tick. Ticks that go back mean that the server has restarted; then the older samples are discarded.
export class LiveBuffer {
  private ticks: Float64Array;
  private readonly values: Float64Array[];
  private begin = 0;
  private end = 0;

  constructor(
    channels: number,
    rate_hz: number,
    private readonly seconds: number,
  ) {
    const capacity = Math.ceil(2 * rate_hz * seconds) + 64;
    this.ticks = new Float64Array(capacity);
    this.values = Array.from({ length: channels }, () => new Float64Array(capacity));
  }

  append(frame: Frame) {
    const samples = frame.channels[0]?.length ?? 0;
    if (samples === 0) return;
    if (this.end > this.begin && frame.tick <= this.ticks[this.end - 1]) this.begin = this.end = 0;
    const fit = Math.min(samples, this.ticks.length);
    if (this.end + fit > this.ticks.length) this.compact(fit);
    for (let i = samples - fit; i < samples; ++i) {
      this.ticks[this.end] = frame.tick + i * frame.stride;
      this.values.forEach((values, channel) => (values[this.end] = frame.channels[channel]?.[i] ?? NaN));
      ++this.end;
    }
    const oldest = this.ticks[this.end - 1] - this.seconds * ticksPerSecond;
    while (this.ticks[this.begin] < oldest) ++this.begin;
  }

  private compact(room: number) {
    const keep = Math.min(this.end - this.begin, this.ticks.length - room);
    const from = this.end - keep;
    this.ticks.copyWithin(0, from, this.end);
    for (const values of this.values) values.copyWithin(0, from, this.end);
    this.begin = 0;
    this.end = keep;
  }

  // `x`: seconds relative to the newest sample, so at most 0.
  view(): { x: Float64Array; values: Float64Array[] } {
    const newest = this.end > 0 ? this.ticks[this.end - 1] : 0;
    const x = this.ticks.slice(this.begin, this.end).map((tick) => (tick - newest) / ticksPerSecond);
    return { x, values: this.values.map((values) => values.slice(this.begin, this.end)) };
  }
}
