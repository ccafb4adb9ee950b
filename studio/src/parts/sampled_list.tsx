import type { Recording } from '../api/types';
import { sampledText } from '../model/sampling';
import { labelOf } from '../model/scope';
import { swatchOf } from './lanes';

// How the channels of drives on buses were sampled; nothing for virtual drives.
export function SampledList({ recording }: { recording: Recording }) {
  const texts = recording.channels.map(sampledText);
  if (texts.every((text) => text === null)) return null;
  return (
    <ul className="channels" aria-label="How the channels were sampled">
      {recording.channels.map((channel, i) => texts[i] !== null && (
        <li key={labelOf(channel)}>
          <span className={swatchOf(i)} aria-hidden="true" />
          <span className="quiet">{labelOf(channel)}: {texts[i]}</span>
        </li>
      ))}
    </ul>
  );
}
