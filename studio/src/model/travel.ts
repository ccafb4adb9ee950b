import type { Geometry } from '../api/types';

// The drawing of an axis's travel: which counts it shows, and where a count lies on it (0 .. 1).

export interface Scale {
  from: number;
  to: number;
  at(counts: number): number; // 0 .. 1, clipped to the drawing
}

export function travelScale(geometry: Geometry | undefined, position: number): Scale {
  const marks = marksOf(geometry);
  // An axis without ends turns: the revolution around it is shown, so that the picture stands still while it turns.
  let from = Math.min(...marks);
  let to = Math.max(...marks);
  if (marks.length < 2 || !(to > from)) {
    const turn = geometry?.index_every ?? 131072;
    from = Math.floor(position / turn) * turn;
    to = from + turn;
  } else {
    const margin = (to - from) * 0.04;
    from -= margin;
    to += margin;
  }
  const at = (counts: number) => Math.max(0, Math.min(1, (counts - from) / (to - from)));
  return { from, to, at };
}

function marksOf(geometry: Geometry | undefined): number[] {
  if (!geometry) return [];
  const { negative_stop, positive_stop, negative_limit, positive_limit } = geometry;
  return [negative_stop, negative_limit, positive_limit, positive_stop].filter((mark): mark is number => mark !== null);
}

// The indexes that a drawing can show: all between `from` and `to`, or none where they would lie closer than `most` allows.
export function indexes(geometry: Geometry | undefined, scale: Scale, most = 64): number[] {
  const every = geometry?.index_every;
  if (!every || (scale.to - scale.from) / every > most) return [];
  const at = geometry.index_at ?? 0;
  const marks: number[] = [];
  for (let k = Math.ceil((scale.from - at) / every); at + k * every <= scale.to; ++k) marks.push(at + k * every);
  return marks;
}
