import { color } from '../theme';

// Saves texts and pictures that the page generates as files.

export const saveBytes = (bytes: ArrayBuffer, name: string) => saveBlob(new Blob([bytes]), name);

export function saveText(text: string, name: string) {
  saveBlob(new Blob([text], { type: 'text/plain' }), name);
}

// Saves the canvases in `box` as one picture, one below the other.
export function savePicture(box: HTMLElement, name: string) {
  const lanes = [...box.querySelectorAll('canvas')];
  const canvas = document.createElement('canvas');
  canvas.width = Math.max(...lanes.map(({ width }) => width));
  canvas.height = lanes.reduce((sum, { height }) => sum + height, 0);
  const context = canvas.getContext('2d')!;
  context.fillStyle = color('panel');
  context.fillRect(0, 0, canvas.width, canvas.height);
  let y = 0;
  for (const lane of lanes) {
    context.drawImage(lane, 0, y);
    y += lane.height;
  }
  canvas.toBlob((blob) => blob && saveBlob(blob, name));
}

function saveBlob(blob: Blob, name: string) {
  const link = document.createElement('a');
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}
