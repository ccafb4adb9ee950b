import { post, put } from '../api/client';
import { duration, fixed } from '../model/units';
import { attempt } from '../notices';
import { useLine } from '../store';
import { Button, Choice } from './controls';

const speeds = [[0, 'stopped'], [0.1, '× 0.1'], [1, '× 1'], [2, '× 2'], [5, '× 5'], [10, '× 10'], [100, '× 100']] as const;

// The line's time. The user can start, stop, step and change the speed of virtual time. In real time it shows the lag.
export function ClockPanel() {
  const clock = useLine((line) => line.clock);
  if (!clock) return <div className="clock" />;
  const speed = clock.speed ?? 0;
  const known = speeds.some(([value]) => value === speed);
  return (
    <div className="clock" role="group" aria-label="Time of the line">
      <span className="time">{duration(clock.time_ns)}</span>
      {clock.mode === 'real' ? (
        <span className="quiet" title={`skipped because the computer was too slow: ${fixed(clock.lag_ms, 1)} ms, ${clock.lag_count ?? 0} times`}>
          {(clock.lag_count ?? 0) > 0 ? `real time, ${fixed(clock.lag_ms, 0)} ms behind` : 'real time'}
        </span>
      ) : (
        <>
          <Choice
            label="Speed of virtual time"
            hideLabel
            value={speed}
            options={known ? speeds : [...speeds, [speed, `× ${speed}`] as const]}
            onChange={(to) => attempt(() => put('/clock', { speed: to }))}
          />
          <Button kind="bare" onPress={() => attempt(() => post('/clock/advance', { ms: 100 }))}>+100 ms</Button>
        </>
      )}
    </div>
  );
}
