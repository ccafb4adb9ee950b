import { toneOf } from '../model/cia402';

export function StateChip({ state, powered }: { state: string | undefined; powered: boolean }) {
  const text = powered ? (state ?? 'no state') : 'no power';
  return <span className={`chip ${powered ? toneOf(state) : 'quiet'}`}>{text}</span>;
}
