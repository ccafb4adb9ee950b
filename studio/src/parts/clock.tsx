import { post, put } from '../api/client';
import { duration, fixed } from '../model/units';
import { attempt } from '../notices';
import { useLine } from '../store';
import { Button, Choice } from './controls';

const speeds = [[0, 'stopped'], [0.1, '× 0.1'], [1, '× 1'], [2, '× 2'], [5, '× 5'], [10, '× 10'], [100, '× 100']] as const;

// The line's time. The user can start, stop, step and change the speed of virtual time. In real time it shows the lag.
export function ClockPanel() {
  const mode = useLine((line) => line.clock?.mode);
  if (!mode) return <div className="clock" />;
  return (
    <div className="clock" role="group" aria-label="Time of the line">
      <Time />
      {mode === 'real' ? <Lag /> : <Speed />}
    </div>
  );
}

const Time = () => <span className="time">{duration(useLine((line) => line.clock?.time_ns) ?? 0)}</span>;

function Lag() {
  const lag_ms = useLine((line) => line.clock?.lag_ms);
  const count = useLine((line) => line.clock?.lag_count) ?? 0;
  return (
    <span className="quiet lag" title={`skipped because the computer was too slow: ${fixed(lag_ms, 1)} ms, ${count} times`}>
      {count > 0 ? `real time, ${behind(lag_ms ?? 0)} behind` : 'real time'}
    </span>
  );
}

const behind = (lag_ms: number) => (lag_ms < 1000 ? `${fixed(lag_ms, 0)} ms` : `${fixed(lag_ms / 1000, 1)} s`);

// Not rendered when only the time has changed: a list of choices costs React a second commit.
function Speed() {
  const speed = useLine((line) => line.clock?.speed) ?? 0;
  const known = speeds.some(([value]) => value === speed);
  return (
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
  );
}
