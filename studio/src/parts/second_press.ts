// The button of a halt acts when it is pressed, so another button may have taken its place when the second press of a double click
// comes. That press then does nothing.

const double_click_ms = 500;
const near_px = 10;

interface Press {
  x: number;
  y: number;
  at: number; // ms
}

let last: Press | null = null; // the last press of the pointer
let halt: Press | null = null; // the last one on the button of a halt

if (typeof window !== 'undefined') {
  addEventListener('pointerdown', ({ clientX, clientY, timeStamp }) => {
    last = { x: clientX, y: clientY, at: timeStamp };
  }, true);
}

export function noteHalt() {
  halt = last;
}

export function isSecondPress(): boolean {
  if (!halt || !last || last === halt) return false;
  return last.at - halt.at < double_click_ms && Math.hypot(last.x - halt.x, last.y - halt.y) < near_px;
}
