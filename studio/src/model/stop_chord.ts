// Recognises Ctrl+Space, whichever of the two keys is pressed first. It stops once for each time that both are pressed.

export interface Key {
  type: string; // 'keydown' or 'keyup'
  code: string;
  key: string;
  ctrlKey: boolean;
}

export class StopChord {
  private space = false;
  private stopped = false;

  // `isTaken`: the focused control must not see this event.
  key({ type, code, key, ctrlKey }: Key): { stops: boolean; isTaken: boolean } {
    const isSpace = code === 'Space';
    const isDown = type === 'keydown';
    if (isSpace && !isDown) {
      // The control whose press the chord interrupts sees the release of its key.
      const isTaken = this.stopped && !this.space;
      this.reset();
      return { stops: false, isTaken };
    }
    const both = isDown && ((isSpace && ctrlKey) || (key === 'Control' && this.space));
    if (isSpace && isDown && !ctrlKey) this.space = true;
    const stops = both && !this.stopped;
    this.stopped ||= both;
    return { stops, isTaken: isSpace && ctrlKey && isDown };
  }

  reset() {
    this.space = this.stopped = false;
  }
}
