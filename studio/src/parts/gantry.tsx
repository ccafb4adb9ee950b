import { memo } from 'react';
import { isMirrored } from '../model/machine';
import { travelScale } from '../model/travel';
import { useAxis } from '../store';
import { Travel, useGeometry } from './travel';

const percent = (share: number) => `${(100 * share).toFixed(3)}%`;

// Two coupled linear axes, seen from above: the travels of both, and the beam across from carriage to carriage. The beam
// is inclined while the sides are not at the same place. Other coupled axes have no drawing of their own.
export const Gantry = memo(function Gantry({ first, second }: { first: string; second: string }) {
  const [one, other] = [useAxis(first), useAxis(second)];
  const [oneGeometry, otherGeometry] = [useGeometry(first), useGeometry(second)];
  if (!one || !other || oneGeometry?.mechanics?.kind !== 'linear' || otherGeometry?.mechanics?.kind !== 'linear') return null;
  const mirrored = isMirrored(oneGeometry.mechanics);
  const from = travelScale(oneGeometry, one.position_counts).at(one.position_counts);
  const at = travelScale(otherGeometry, other.position_counts).at(other.position_counts);
  const to = mirrored ? 1 - at : at;
  return (
    <section className="panel gantry" aria-label={`Gantry of ${first} and ${second}`}>
      <h2>Gantry: {first} and {second}</h2>
      <div className="sides">
        <Travel axis={one} geometry={oneGeometry} />
        <div className={mirrored ? 'mirrored' : undefined}><Travel axis={other} geometry={otherGeometry} /></div>
        <svg className="across" width="100%" height="100%" aria-hidden="true">
          <line className={one.powered || other.powered ? 'beam' : 'beam dead'} x1={percent(from)} x2={percent(to)} y1="11" y2="67" />
        </svg>
      </div>
    </section>
  );
});
