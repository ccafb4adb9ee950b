import type { Geometry } from '../api/types';

// The scale of the drawing of an axis's travel: its range in counts, and the place of a position in it (0 .. 1).

export interface Scale {
  from: number;
  to: number;
  at(counts: number): number; // 0 .. 1, clipped to the drawing
}

export function travelScale(geometry: Geometry | undefined, position: number): Scale {
  const marks = marksOf(geometry);
  // An axis without limits is a rotary one. The drawing shows its present revolution, so the scale does not move with it.
  let from = Math.min(...marks);
  let to = Math.max(...marks);
  if (marks.length < 2 || !(to > from)) {
    const turn = geometry?.index_every ?? 131072;
    from = Math.floor(position / turn) * turn;
    to = from + turn;
  }
  const margin = (to - from) * 0.04; // the mark of an axis at an end is drawn as a whole
  from -= margin;
  to += margin;
  const at = (counts: number) => Math.max(0, Math.min(1, (counts - from) / (to - from)));
  return { from, to, at };
}

function marksOf(geometry: Geometry | undefined): number[] {
  if (!geometry) return [];
  const { negative_stop, positive_stop, negative_limit, positive_limit } = geometry;
  return [negative_stop, negative_limit, positive_limit, positive_stop].filter((mark): mark is number => mark !== null);
}

// The index pulses within the scale; none if there were more than `most`.
export function indexes(geometry: Geometry | undefined, scale: Scale, most = 64): number[] {
  const every = geometry?.index_every;
  if (!every || (scale.to - scale.from) / every > most) return [];
  const at = geometry.index_at ?? 0;
  const marks: number[] = [];
  for (let k = Math.ceil((scale.from - at) / every); at + k * every <= scale.to; ++k) marks.push(at + k * every);
  return marks;
}
