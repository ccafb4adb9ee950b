import type { Job, Units } from '../api/types';
import { cancelJob } from '../commands';
import { shownOf } from '../model/problem';
import { fixed, fromDrivePosition } from '../model/units';
import { attempt } from '../notices';
import { useIsOutdated } from '../store';
import { HaltButton } from './controls';

// The state of a job and, when it is over, its outcome, until a later command of the axis.
export function JobLine({ job, units }: { job: Job | undefined; units?: Units | undefined }) {
  const isOutdated = useIsOutdated(job);
  if (!job || isOutdated) return <p className="job" role="status" />; // keeps the height, so that the buttons below keep their place
  const position = job.result?.position;
  const at = position === undefined ? null : job.units === 'revolutions' ? position : fromDrivePosition(units, position);
  return (
    <p className={`job ${job.state}`} role="status">
      {job.do.replaceAll('_', ' ')}: {job.state}
      {at !== null && ` at ${fixed(at, 4)} rev`}
      {job.result?.seconds !== undefined && ` after ${fixed(job.result.seconds, 2)} s`}
      {job.note && ` · ${job.note}`}
      {job.error && ` · ${shownOf(job.error).what}`}
      {job.state === 'running' && <HaltButton kind="bare" onHalt={() => attempt(() => cancelJob(job))}>Cancel</HaltButton>}
    </p>
  );
}
