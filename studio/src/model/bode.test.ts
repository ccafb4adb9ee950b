import { describe, expect, it } from 'vitest';
import { at, channelsOf, coherentValues, firstPlot, gapNote, isCoherent, type BodePoint } from './bode';

const points: BodePoint[] = [
  { hz: 1, gain_db: 0, phase_deg: 0, coherence: 1 },
  { hz: 100, gain_db: -40, phase_deg: -180, coherence: 0.5 },
];

describe('a Bode plot', () => {
  it('shows what is coherent', () => {
    expect(points.map(isCoherent)).toEqual([true, false]);
    expect(isCoherent({ hz: 1, gain_db: 0, phase_deg: 0 })).toBe(true);
  });
  it('has a gap where noise dominates, and says so', () => {
    expect(coherentValues([...points, null], ({ gain_db }) => gain_db)).toEqual([0, NaN, NaN]);
    expect(coherentValues(points, ({ phase_deg }) => phase_deg)).toEqual([0, NaN]);
    expect(gapNote(points)).toContain('at least 0.7');
    expect(gapNote(points.slice(0, 1))).toBe('');
  });
  it('is read between its points over the logarithm of the frequency', () => {
    expect(at(points, 10)).toEqual({ hz: 10, gain_db: -20, phase_deg: -90, coherence: 0.75 });
    expect(at(points, 1)?.gain_db).toBe(0);
    expect(at(points, 100)?.phase_deg).toBe(-180);
  });
  it('says nothing outside of its points', () => {
    expect(at(points, 0.5)).toBeNull();
    expect(at(points, 200)).toBeNull();
    expect(at([], 10)).toBeNull();
  });
  it('records what the drive has', () => {
    const has = (object: string) => object !== '606B:00' && object !== '6078:00';
    const channels = channelsOf('x', 'velocity', has);
    expect(channels.map(({ object }) => object)).toEqual(['60FF:00', '606C:00', '6077:00']);
    expect(firstPlot(channels)).toEqual([0, 1]);
    expect(firstPlot([{ axis: 'x', signal: 'a' }])).toEqual([0, 0]);
  });
});
