// Throttles the writes of a control that changes faster than a drive can be written: at most one at a time, at most
// `per_second` in a second. The last value always arrives, unless drop() removes it.

export interface PacedDoes {
  write(value: number): Promise<unknown>;
  failed(error: unknown, value: number): void;
  done?(value: number): void;
}

export class Paced {
  private waiting: number | null = null; // the value to write next
  private busy = false; // a write runs, or the pause after it
  private readonly pause_ms: number;

  constructor(
    per_second: number,
    private readonly does: PacedDoes,
  ) {
    this.pause_ms = 1000 / per_second;
  }

  push(value: number) {
    this.waiting = value;
    if (!this.busy) void this.drain();
  }

  // Drops the waiting value. A write in progress is not cancelled.
  drop() {
    this.waiting = null;
  }

  private async drain() {
    this.busy = true;
    while (this.waiting !== null) {
      const value = this.waiting;
      this.waiting = null;
      const pause = new Promise((resolve) => setTimeout(resolve, this.pause_ms));
      try {
        await this.does.write(value);
        this.does.done?.(value);
      } catch (error) {
        this.does.failed(error, value);
      }
      await pause;
    }
    this.busy = false;
  }
}
