import { useEffect, useRef, useState } from 'react';
import { getBytes, post, segment } from '../api/client';
import { decodeFrame } from '../api/frame';
import type { Limits, Recording, Units } from '../api/types';
import { axisPath, following, runJob } from '../commands';
import { Button, Choice, Panel, Toggle, Trouble } from '../parts/controls';
import { NumberForm, NumberInput, NumbersButton } from '../parts/number_input';
import { Excite } from '../parts/excite';
import { Layouts } from '../parts/layouts';
import { LiveLanes } from '../parts/live';
import { Maths } from '../parts/maths';
import { RecordingPanel } from '../parts/recording_panel';
import { Recordings } from '../parts/recordings';
import { useHindrance } from '../parts/reach';
import { ScopeSetup } from '../parts/scope_setup';
import { axisOf, isOver, ofAxis, queryOf, samplesOf, setupOf, type Samples, type Setup } from '../model/scope';
import { greatestOf, holdsOf, isKnown, proposed } from '../model/units';
import { attempt, complain } from '../notices';
import { useResource } from '../resource';
import { keep, keepHere, useRoute } from '../route';
import { useIsBusy, useLine, useMotionHindrance, usePowered } from '../store';
import '../scope.css';

export function ScopePage() {
  const { query } = useRoute();
  const order = useLine((line) => line.order);
  const second = useLine(({ line }) => line?.signals[1]);
  const setup = setupOf(query, order[0], second);
  const id = query.get('rec');
  const overlays = (query.get('with') ?? '').split(',').filter(Boolean);
  const { recordings, memory, again } = useRecordings();
  const shown = recordings.find((recording) => String(recording.id) === id);
  const samples = useSamples(shown);
  // The list may not have a new recording yet: the server is asked.
  const missing = useResource<Recording>(memory && id && !shown ? `/recordings/${segment(id)}` : null).problem;
  const others = useOverlays(recordings.filter((recording) => overlays.includes(String(recording.id)) && recording !== shown));

  return (
    <div className="scope-page">
      <div className="column">
        {shown ? (
          <RecordingPanel recording={shown} samples={samples} others={others} />
        ) : missing ? (
          <Panel title={`Recording ${id}`} aside={<Button onPress={() => keep({ rec: null })}>Live</Button>}><Trouble problem={missing} /></Panel>
        ) : (
          <Panel title="Live" aside={<span className="quiet">last 10 s; record for the full sampling rate</span>}>
            <LiveLanes fill label="Live scope" channels={setup.channels} rate_hz={Math.min(setup.rate_hz, 500)} seconds={10} />
          </Panel>
        )}
      </div>
      <div className="column side">
        <NumberForm>
          <Record setup={setup} />
          <NumberForm><Excite first={axisOf(setup)} /></NumberForm>
          <ScopeSetup setup={setup} onChange={(to) => keep(queryOf(to))} />
        </NumberForm>
        <Recordings recordings={recordings} shown={shown} overlays={overlays} memory={memory} again={again} />
        <Maths channels={shown?.channels ?? setup.channels} />
        <Layouts />
      </div>
    </div>
  );
}

function useRecordings() {
  const event = useLine((line) => (line.lastEvent?.kind === 'recording' ? line.lastEvent.serial : 0));
  const { value, again } = useResource<{ recordings: Recording[]; bytes?: number }>(`/recordings#${event}`, 2000);
  const latest = useRef<Recording[]>([]);
  if (value) latest.current = value.recordings;
  return { recordings: latest.current, memory: value, again };
}

async function load(recording: Recording): Promise<Samples> {
  return samplesOf(recording, decodeFrame(await getBytes(`/recordings/${recording.id}/data`)));
}

function useSamples(recording: Recording | undefined): Samples | null {
  const [samples, setSamples] = useState<Samples | null>(null);
  const wanted = recording && isOver(recording) ? recording.id : null;
  const latest = useRef(recording);
  latest.current = recording;
  useEffect(() => {
    if (wanted === null || !latest.current) return;
    let over = false;
    load(latest.current).then((loaded) => {
      if (!over) setSamples(loaded);
    }, complain);
    return () => {
      over = true;
    };
  }, [wanted]);
  return samples && samples.recording.id === wanted ? samples : null;
}

function useOverlays(recordings: Recording[]): Samples[] {
  const [samples, setSamples] = useState<Samples[]>([]);
  const wanted = recordings.filter(isOver);
  const ids = wanted.map(({ id }) => id).join();
  const latest = useRef(wanted);
  latest.current = wanted;
  useEffect(() => {
    let over = false;
    Promise.all(latest.current.map(load)).then((loaded) => {
      if (!over) setSamples(loaded);
    }, complain);
    return () => {
      over = true;
    };
  }, [ids]);
  return samples;
}

function Record({ setup }: { setup: Setup }) {
  const order = useLine((line) => line.order);
  const axis = axisOf(setup);
  const [turns, setTurns] = useState(1);
  const [typedRpm, setRpm] = useState<number | null>(null);
  const [typedAcceleration, setAcceleration] = useState<number | null>(null);
  const [withMove, setWithMove] = useState(true);
  const [name, setName] = useState('');
  const powered = usePowered(axis);
  const hindrance = useMotionHindrance(axis);
  const isBusy = useIsBusy(axis);
  const units = useResource<Units>(withMove && powered ? `${axisPath(axis)}/units` : null).value;
  const limits = useResource<Limits>(withMove && powered ? `${axisPath(axis)}/limits` : null, 3000).value;
  const known = isKnown(units);
  const greatest = greatestOf(units, limits);
  const holds = holdsOf(units);
  const rpm = typedRpm ?? proposed(600, greatest.velocity);
  const acceleration = typedAcceleration ?? proposed(200, greatest.acceleration);
  const { channels, rate_hz, duration_ms, pre_ms, trigger } = setup;
  const far = useHindrance(axis, withMove ? { by: turns } : null);

  const record = async () => {
    const keepRecording = keepHere();
    const enabled = withMove ? await runJob(axis, { do: 'enable' }) : null;
    if (withMove && enabled?.state !== 'done') return;
    const { id } = await post<Recording>('/recordings', { name: name.trim(), channels, rate_hz, duration_ms, pre_ms, trigger });
    keepRecording({ rec: String(id), ...queryOf(setup) });
    if (enabled) {
      await runJob(axis, { do: 'move', ...following(enabled), units: 'revolutions', by: turns, velocity: rpm / 60, acceleration, deceleration: acceleration });
    }
  };
  return (
    <Panel title="Record">
      <label className="field"><span>Name of the recording</span><input className="input" value={name} maxLength={100} onChange={(event) => setName(event.target.value)} autoComplete="off" /></label>
      <Toggle isSelected={withMove} onChange={setWithMove}>with a move</Toggle>
      {withMove && (
        <div className="form">
          <Choice label="Axis" value={axis} options={order.map((each) => [each, each] as const)} onChange={(to) => keep(queryOf(ofAxis(setup, to)))} />
          <NumberInput label="Distance" unit="rev" value={turns} onChange={setTurns} minimum={-holds.position} maximum={holds.position} />
          <NumberInput label="Velocity" unit="rpm" value={rpm} onChange={setRpm} above={0} maximum={holds.speed} />
          <NumberInput label="Acceleration" unit="rev/s²" value={acceleration} onChange={setAcceleration} above={0} maximum={holds.acceleration} />
        </div>
      )}
      {withMove && units && !known && <p className="note">This drive does not report its units: move it on the Axis page.</p>}
      <div className="buttons">
        <NumbersButton kind="main" title={withMove ? hindrance : ''} isDisabled={withMove && (hindrance !== '' || isBusy || !known || !(rpm > 0) || !(acceleration > 0) || far !== '')} onPress={() => attempt(record)}>{withMove ? 'Move and record' : 'Record'}</NumbersButton>
      </div>
      {far && <p className="trouble" role="alert">{far}</p>}
    </Panel>
  );
}
