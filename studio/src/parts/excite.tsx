import { useState } from 'react';
import { post } from '../api/client';
import type { ObjectEntry, Recording, Units } from '../api/types';
import { axisPath, following, runJob } from '../commands';
import { channelsOf, type Excited } from '../model/bode';
import { addressOf } from '../model/objects';
import type { Setup } from '../model/scope';
import { attempt } from '../notices';
import { useResource } from '../resource';
import { keepHere } from '../route';
import { useIsBusy, useLine, useMotionHindrance, usePowered } from '../store';
import { Choice, Panel, Trouble } from './controls';
import { NumberInput, NumbersButton } from './number_input';
import { useAxisChoice } from './scope_setup';

const kinds = [['sweep', 'Sweep'], ['step', 'Step']] as const;
const excited = [['velocity', 'velocity'], ['torque', 'torque'], ['position', 'position']] as const;
const unitsOf: Record<Excited, string> = { velocity: 'rpm', torque: '% of rated', position: 'rev' };
const usual: Record<Excited, number> = { velocity: 60, torque: 20, position: 0.01 };

// Excites an axis with a sweep or a step and records the response. A script does the same with two requests: the recording
// and the job.
export function Excite({ first }: { first: string }) {
  const order = useLine((line) => line.order);
  const [axis, setAxis] = useAxisChoice(first);
  const [kind, setKind] = useState<'sweep' | 'step'>('sweep');
  const [of, setOf] = useState<Excited>('velocity');
  const [amplitude, setAmplitude] = useState(usual.velocity);
  const [from_hz, setFrom] = useState(2);
  const [to_hz, setTo] = useState(200);
  const [seconds, setSeconds] = useState(4);
  const [step_ms, setStep] = useState(200);
  const [travel, setTravel] = useState(1);
  const [busy, setBusy] = useState(false);
  const powered = usePowered(axis);
  const hindrance = useMotionHindrance(axis);
  const isBusy = useIsBusy(axis);
  const { value: units, problem } = useResource<Units>(powered ? `${axisPath(axis)}/units` : null);
  const objects = useResource<{ objects: ObjectEntry[] }>(`${axisPath(axis)}/objects`).value?.objects;

  const run = async () => {
    if (!units || !objects) return;
    const keepRecording = keepHere();
    const enabled = await runJob(axis, { do: 'enable' });
    if (enabled?.state !== 'done') return;
    const channels = channelsOf(axis, of, (object) => objects.some((entry) => addressOf(entry) === object));
    const long_s = kind === 'sweep' ? seconds : (2 * step_ms) / 1000;
    const target: Record<Excited, number> = { velocity: ((units.velocity_per_rps ?? 1) * amplitude) / 60, torque: 10 * amplitude, position: (units.position_per_revolution ?? 1) * amplitude };
    const setup: Setup = {
      channels,
      rate_hz: 4000,
      duration_ms: Math.round(1000 * long_s) + 250,
      pre_ms: 50,
      // The start position is arbitrary, so no level can trigger: the recording begins at once.
      trigger: of === 'position' ? { kind: 'now' } : { kind: 'edge', channel: 0, level: Math.abs(target[of]) / 100, slope: 'rising' },
    };
    const recording = await post<Recording>('/recordings', { name: `${kind} of the ${of}, ${axis}`, channels, rate_hz: setup.rate_hz, duration_ms: setup.duration_ms, pre_ms: setup.trigger.kind === 'now' ? 0 : setup.pre_ms, trigger: setup.trigger });
    // The address keeps the page's own channels and trigger: the recording has its own.
    keepRecording({ rec: String(recording.id), a: null, b: null, from: null, to: null, plot: kind === 'sweep' ? 'bode' : null });
    await runJob(axis, {
      do: kind, ...following(enabled), of, units: 'revolutions', amplitude: of === 'velocity' ? amplitude / 60 : amplitude, travel,
      ...(kind === 'sweep' ? { from_hz, to_hz, seconds } : { seconds: step_ms / 1000 }),
    });
  };
  return (
    <Panel title="Sweep or step">
      <div className="form">
        <Choice label="Axis to excite" value={axis} options={order.map((each) => [each, each] as const)} onChange={setAxis} />
        <Choice label="Kind" value={kind} options={kinds} onChange={setKind} />
        <Choice label="Quantity" value={of} options={excited} onChange={(to) => { setOf(to); setAmplitude(usual[to]); }} />
        <NumberInput label="Amplitude" unit={unitsOf[of]} value={amplitude} onChange={setAmplitude} />
        {kind === 'sweep' ? (
          <>
            <NumberInput label="From" unit="Hz" value={from_hz} minimum={0.1} maximum={400} onChange={setFrom} />
            <NumberInput label="To" unit="Hz" value={to_hz} minimum={0.1} maximum={400} onChange={setTo} />
            <NumberInput label="Sweep duration" unit="s" value={seconds} minimum={0.1} maximum={30} onChange={setSeconds} />
          </>
        ) : (
          <NumberInput label="Step duration" unit="ms" value={step_ms} minimum={10} maximum={10000} onChange={setStep} />
        )}
        <NumberInput label="Maximum travel" unit="rev" value={travel} minimum={0} onChange={setTravel} />
      </div>
      <Trouble problem={problem} />
      <div className="buttons">
        <NumbersButton kind="main" title={hindrance} isDisabled={busy || isBusy || hindrance !== '' || !units || !objects} onPress={() => { setBusy(true); attempt(() => run().finally(() => setBusy(false))); }}>
          {kind === 'sweep' ? 'Sweep and record' : 'Step and record'}
        </NumbersButton>
      </div>
    </Panel>
  );
}
