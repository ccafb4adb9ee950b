// Jogs while a key or the pointer is pressed. A release takes the start back, and ends the jog if it has begun nevertheless.
// `alive` is the keepalive of the server's dead man's switch: without it the server halts the axis. It resolves to false if the
// server has ended the jog. The release does not wait for an `alive` that is on its way.

export interface JogDoes<Handle> {
  start(released: AbortSignal): Promise<Handle>;
  alive(handle: Handle): Promise<boolean>;
  stop(handle: Handle): Promise<unknown>;
  failed(error: unknown): void;
}

export const alive_ms = 200;

export class Jog<Handle> {
  private pressed: AbortController | null = null; // of the present press

  constructor(private readonly does: JogDoes<Handle>) {}

  press() {
    if (this.pressed) return;
    this.pressed = new AbortController();
    void this.drive(this.pressed);
  }

  release() {
    this.pressed?.abort();
    this.pressed = null;
  }

  private async drive(press: AbortController) {
    const { signal } = press;
    const end = () => {
      if (this.pressed === press) this.release();
    };
    let handle: Handle;
    try {
      handle = await this.does.start(signal);
    } catch (error) {
      if (!signal.aborted) this.does.failed(error);
      end();
      return;
    }
    let onItsWay = false; // at most one `alive` at a time
    let isOver = false;
    const alive = async () => {
      onItsWay = true;
      try {
        isOver = !(await this.does.alive(handle));
      } catch (error) {
        isOver = true;
        if (!signal.aborted) this.does.failed(error);
      }
      onItsWay = false;
    };
    for (let waited = 0; !signal.aborted && !isOver; waited += poll_ms) {
      if (waited >= alive_ms && !onItsWay) {
        waited = 0;
        void alive();
      }
      await new Promise((resolve) => setTimeout(resolve, poll_ms));
    }
    end();
    await this.does.stop(handle).catch(() => undefined); // the job may be over already
  }
}

const poll_ms = 20;
