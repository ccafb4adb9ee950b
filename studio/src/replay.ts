import { useEffect, useRef, useState } from 'react';
import type { AxisView } from './api/types';

// Records the motion of an axis while `lasts` is true, and replays it.
interface Moment {
  at: number; // wall time in ms
  position: number; // counts
  velocity: number; // rpm
}

const most = 20_000;
const longest = 6000; // longest replay in ms; a longer motion is replayed faster

export function useReplay(axis: AxisView, lasts: boolean) {
  const trail = useRef<Moment[]>([]);
  const [shown, setShown] = useState<Moment | null>(null);
  const [playing, setPlaying] = useState(false);
  useEffect(() => {
    if (!lasts) return;
    trail.current = [];
    setPlaying(false);
    setShown(null);
  }, [lasts]);
  useEffect(() => {
    if (!lasts || trail.current.length >= most) return;
    trail.current.push({ at: performance.now(), position: axis.position_counts, velocity: axis.velocity_rpm ?? 0 });
  }, [lasts, axis.position_counts, axis.velocity_rpm]);
  useEffect(() => {
    const moments = trail.current;
    if (!playing || moments.length < 2) return;
    const first = moments[0].at;
    const took = moments[moments.length - 1].at - first;
    const faster = Math.max(1, took / longest);
    const began = performance.now();
    let frame = 0;
    let next = 0;
    const show = (now: number) => {
      const at = first + (now - began) * faster;
      while (next + 1 < moments.length && moments[next + 1].at <= at) next += 1;
      setShown(moments[next]);
      if (at - first < took) frame = requestAnimationFrame(show);
      else {
        setPlaying(false);
        setShown(null);
      }
    };
    frame = requestAnimationFrame(show);
    return () => cancelAnimationFrame(frame);
  }, [playing]);
  return {
    // The present axis, or during a replay the axis at the replayed moment.
    axis: shown ? { ...axis, position_counts: shown.position, velocity_rpm: shown.velocity, in_motion: true } : axis,
    playing,
    ready: !lasts && trail.current.length > 1,
    play: () => setPlaying(true),
    stop: () => {
      setPlaying(false);
      setShown(null);
    },
  };
}
