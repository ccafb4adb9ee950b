// Jogs while a key or the pointer is pressed. After the release the jog always ends, even if the server answers its start
// later. `alive` is the keepalive of the server's dead man's switch: without it the server halts the axis. The release does not
// wait for an `alive` that is on its way.

export interface JogDoes<Handle> {
  start(): Promise<Handle>;
  alive(handle: Handle): Promise<unknown>;
  stop(handle: Handle): Promise<unknown>;
  failed(error: unknown): void;
}

export const alive_ms = 200;

export class Jog<Handle> {
  private pressed = false;
  private run = 0;

  constructor(private readonly does: JogDoes<Handle>) {}

  press() {
    if (this.pressed) return;
    this.pressed = true;
    void this.drive(++this.run);
  }

  release() {
    this.pressed = false;
  }

  private held(run: number) {
    return this.pressed && run === this.run;
  }

  private async drive(run: number) {
    let handle: Handle;
    try {
      handle = await this.does.start();
    } catch (error) {
      if (run === this.run) this.pressed = false;
      this.does.failed(error);
      return;
    }
    let onItsWay = false; // at most one `alive` at a time
    let lost: { error: unknown } | undefined;
    const alive = async () => {
      onItsWay = true;
      try {
        await this.does.alive(handle);
      } catch (error) {
        lost = { error };
      }
      onItsWay = false;
    };
    for (let waited = 0; this.held(run) && !lost; waited += poll_ms) {
      if (waited >= alive_ms && !onItsWay) {
        waited = 0;
        void alive();
      }
      await new Promise((resolve) => setTimeout(resolve, poll_ms));
    }
    if (lost) {
      if (run === this.run) this.pressed = false;
      this.does.failed(lost.error);
    }
    await this.does.stop(handle).catch(() => undefined); // the job may be over already
  }
}

const poll_ms = 20;
