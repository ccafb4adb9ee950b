import type { AxisView } from '../api/types';
import { toneOf } from '../model/cia402';
import { stateTip } from '../model/meanings';

export function StateChip({ axis: { state, powered, product, problem } }: { axis: Pick<AxisView, 'state' | 'powered' | 'product' | 'problem'> }) {
  const text = powered ? (state ?? 'no state') : problem ? 'no answer' : 'no power';
  const tip = powered && state ? stateTip(state, product) : problem ? 'The drive does not answer on its bus.' : 'Without power the drive answers nothing; what was not stored is lost.';
  // The chip gets the focus to be explained.
  // eslint-disable-next-line jsx-a11y/no-noninteractive-tabindex
  return <span className={`chip ${powered ? toneOf(state) : 'quiet'}`} tabIndex={0} data-tip={tip}>{text}</span>;
}
