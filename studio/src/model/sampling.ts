import type { BusView, Channel } from '../api/types';
import { rates } from './scope';

// The rates to choose from: those of a line, or up to the greatest one that the buses of these axes have.
export function ratesOf(axes: string[], buses: BusView[] | undefined): number[] {
  const most = Math.max(0, ...(buses ?? []).filter((bus) => axes.some((axis) => axis in bus.axes)).map(({ sampling_hz }) => Number(sampling_hz ?? 0)));
  return most > 0 ? [...rates.filter((rate) => rate < most), most] : rates;
}

// How a channel was sampled, in words; null for a virtual drive, of which each row is a sample.
export function sampledText({ sampled }: Channel): string | null {
  if (!sampled) return null;
  const hz = sampled.rate_hz ?? sampled.due_hz;
  const rate = hz === undefined ? '' : ` at ${Math.round(hz)} Hz`;
  const missed = sampled.missed ? `, ${sampled.missed} samples missed` : '';
  const limit = sampled.limit ? `. Not faster, because ${sampled.limit.what}: ${sampled.limit.hint}` : '';
  return `${sampled.by}${rate}${missed}${limit}`;
}
