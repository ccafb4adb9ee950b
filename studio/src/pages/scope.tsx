import { useEffect, useMemo, useRef, useState } from 'react';
import { getBytes, post, remove } from '../api/client';
import { decodeFrame } from '../api/frame';
import type { Limits, Recording, Units } from '../api/types';
import { axisPath, runJob } from '../commands';
import { Button, Choice, Panel, Toggle } from '../parts/controls';
import { NumberForm, NumberInput, NumbersButton } from '../parts/number_input';
import { BodePlot } from '../parts/bode';
import { Excite } from '../parts/excite';
import { Lanes, type Curve } from '../parts/lanes';
import { LiveLanes } from '../parts/live';
import { MeasureTable } from '../parts/measure_table';
import { savePicture } from '../parts/save';
import { ScopeSetup } from '../parts/scope_setup';
import { alongside, labelOf, ofAxis, queryOf, same, samplesOf, setupOf, zoomed, type Samples, type Setup } from '../model/scope';
import { fixed, greatestOf, isKnown, proposed, significant } from '../model/units';
import { attempt, complain } from '../notices';
import { useResource } from '../resource';
import { keep, useRoute } from '../route';
import { useLine, usePowered } from '../store';

export function ScopePage() {
  const { query } = useRoute();
  const order = useLine((line) => line.order);
  const second = useLine(({ line }) => line?.signals[1]);
  const setup = setupOf(query, order[0], second);
  const id = query.get('rec');
  const overlays = (query.get('with') ?? '').split(',').filter(Boolean);
  const { recordings, memory } = useRecordings();
  const shown = recordings.find((recording) => String(recording.id) === id);
  const samples = useSamples(shown);
  const others = useOverlays(recordings.filter((recording) => overlays.includes(String(recording.id)) && recording !== shown));

  return (
    <div className="scope-page">
      <div className="column">
        {shown ? (
          <RecordingPanel recording={shown} samples={samples} others={others} />
        ) : (
          <Panel title="Live" aside={<span className="quiet">last 10 s; record for the full sampling rate</span>}>
            <LiveLanes label="Live scope" channels={setup.channels} rate_hz={Math.min(setup.rate_hz, 500)} seconds={10} laneHeight={150} />
          </Panel>
        )}
      </div>
      <div className="column side">
        <NumberForm>
          <Record setup={setup} />
          <NumberForm><Excite first={setup.channels[0]?.axis} /></NumberForm>
          <ScopeSetup setup={setup} onChange={(to) => keep(queryOf(to))} />
        </NumberForm>
        <Recordings recordings={recordings} shown={shown} overlays={overlays} memory={memory} />
      </div>
    </div>
  );
}

function useRecordings() {
  const event = useLine((line) => (line.lastEvent?.kind === 'recording' ? line.lastEvent.serial : 0));
  const { value, again } = useResource<{ recordings: Recording[]; bytes?: number }>(`/recordings?seen=${event}`, 2000);
  const latest = useRef<Recording[]>([]);
  if (value) latest.current = value.recordings;
  return { recordings: latest.current, memory: value, again };
}

const isOver = (recording: Recording) => recording.state === 'done' || recording.state === 'stopped';

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
  const [axis, setAxis] = useState(setup.channels[0]?.axis ?? order[0]);
  const [turns, setTurns] = useState(1);
  const [typedRpm, setRpm] = useState<number | null>(null);
  const [typedAcceleration, setAcceleration] = useState<number | null>(null);
  const [withMove, setWithMove] = useState(true);
  const powered = usePowered(axis);
  const units = useResource<Units>(withMove && powered ? `${axisPath(axis)}/units` : null).value;
  const limits = useResource<Limits>(withMove && powered ? `${axisPath(axis)}/limits` : null, 3000).value;
  const known = isKnown(units);
  const greatest = greatestOf(units, limits);
  const rpm = typedRpm ?? proposed(600, greatest.velocity);
  const acceleration = typedAcceleration ?? proposed(200, greatest.acceleration);
  const { channels, rate_hz, duration_ms, pre_ms, trigger } = setup;

  const choose = (to: string) => {
    setAxis(to);
    keep(queryOf(ofAxis(setup, axis, to)));
  };
  const record = async () => {
    if (withMove && (await runJob(axis, { do: 'enable' }))?.state !== 'done') return;
    const { id } = await post<Recording>('/recordings', { channels, rate_hz, duration_ms, pre_ms, trigger });
    keep({ rec: String(id), ...queryOf(setup) });
    if (withMove) {
      await runJob(axis, { do: 'move', units: 'revolutions', by: turns, velocity: rpm / 60, acceleration, deceleration: acceleration });
    }
  };
  return (
    <Panel title="Record">
      <Toggle isSelected={withMove} onChange={setWithMove}>with a move</Toggle>
      {withMove && (
        <div className="form">
          <Choice label="Axis" value={axis} options={order.map((each) => [each, each] as const)} onChange={choose} />
          <NumberInput label="Distance" unit="rev" value={turns} onChange={setTurns} />
          <NumberInput label="Velocity" unit="rpm" value={rpm} onChange={setRpm} minimum={0} />
          <NumberInput label="Acceleration" unit="rev/s²" value={acceleration} onChange={setAcceleration} minimum={0} />
        </div>
      )}
      {withMove && units && !known && <p className="note">This drive does not report its units: move it on the Axis page.</p>}
      <div className="buttons">
        <NumbersButton kind="main" isDisabled={withMove && (!known || !(rpm > 0) || !(acceleration > 0))} onPress={() => attempt(record)}>{withMove ? 'Move and record' : 'Record'}</NumbersButton>
      </div>
    </Panel>
  );
}

function RecordingPanel({ recording, samples, others }: { recording: Recording; samples: Samples | null; others: Samples[] }) {
  const { query } = useRoute();
  const box = useRef<HTMLDivElement>(null);
  const parse = (key: string) => (query.get(key) === null ? null : Number(query.get(key)));
  const [a, b, from, to] = ['a', 'b', 'from', 'to'].map(parse);
  const range = useMemo<[number, number] | null>(() => (from !== null && to !== null ? [from, to] : null), [from, to]);
  const title = recording.name || (recording.fault ? `Fault of ${recording.fault.axis}` : `Recording ${recording.id}`);

  const curves = useMemo<Curve[]>(() => {
    if (!samples) return [];
    const own = recording.channels.map((channel, i) => ({ name: labelOf(channel), unit: channel.unit, tone: i, values: samples.values[i] }));
    const earlier = others.flatMap((other) =>
      other.recording.channels.flatMap((channel, i) => {
        const tone = recording.channels.findIndex((each) => same(each, channel));
        if (tone < 0 || other.values[i].length === 0) return [];
        return [{ name: `${labelOf(channel)}, recording ${other.recording.id}`, unit: recording.channels[tone].unit, tone, values: alongside(samples.x, other, other.values[i]), faint: true }];
      }),
    );
    return [...own, ...earlier];
  }, [samples, others, recording.channels]);

  const seconds = recording.samples / recording.rate_hz;
  const bode = query.get('plot') === 'bode';
  const show = (zoom: [number, number] | null) => keep({ from: zoom ? zoom[0].toFixed(4) : null, to: zoom ? zoom[1].toFixed(4) : null });
  const x = samples?.x ?? [];
  return (
    <Panel
      title={title}
      aside={
        <>
          <span className="quiet" role="status">
            {recording.state}
            {isOver(recording) && `, ${fixed(recording.samples, 0)} samples of ${recording.channels.length} channels, ${fixed(seconds * 1000, 0)} ms at ${fixed(recording.rate_hz, 0)} Hz`}
          </span>
          {!isOver(recording) && <Button onPress={() => attempt(() => post(`/recordings/${recording.id}/stop`))}>Stop</Button>}
          <div className="segments" role="group" aria-label="Plot">
            <button type="button" aria-pressed={!bode} onClick={() => keep({ plot: null })}>Time</button>
            <button type="button" aria-pressed={bode} onClick={() => keep({ plot: 'bode' })}>Bode</button>
          </div>
          <Button kind="bare" onPress={() => keep({ rec: null, plot: null, a: null, b: null, from: null, to: null, with: null })}>Live</Button>
        </>
      }
    >
      {!samples ? (
        <p className="empty">{isOver(recording) ? 'Loading.' : recording.state === 'armed' ? 'Armed: waiting for the trigger.' : 'Recording.'}</p>
      ) : bode ? (
        <BodePlot key={recording.id} recording={recording} earlier={others[0]?.recording} />
      ) : (
        <>
          <div ref={box}>
            <Lanes
              label={title}
              x={samples.x}
              curves={curves}
              range={range}
              onRange={show}
              cursors={[a, b]}
              onCursor={(which, at) => keep({ [which === 0 ? 'a' : 'b']: at.toFixed(4) })}
            />
          </div>
          <div className="toolbar">
            <NumberInput whenLeft mayBeEmpty label="Cursor A" unit="ms" value={a ?? NaN} onChange={(at) => keep({ a: Number.isFinite(at) ? String(at) : null })} />
            <NumberInput whenLeft mayBeEmpty label="Cursor B" unit="ms" value={b ?? NaN} onChange={(at) => keep({ b: Number.isFinite(at) ? String(at) : null })} />
            <span className="quiet">Δ {a !== null && b !== null ? `${significant(b - a)} ms, ${significant(1000 / Math.abs(b - a))} Hz` : '–'}</span>
            <span className="grow" />
            <div className="buttons" role="group" aria-label="Zoom">
              <Button aria-label="Earlier" isDisabled={!range} onPress={() => show(zoomed(x, range, 1, -0.5))}>◀</Button>
              <Button aria-label="Later" isDisabled={!range} onPress={() => show(zoomed(x, range, 1, 0.5))}>▶</Button>
              <Button aria-label="Zoom in" onPress={() => show(zoomed(x, range, 0.5))}>+</Button>
              <Button aria-label="Zoom out" isDisabled={!range} onPress={() => show(zoomed(x, range, 2))}>−</Button>
              <Button isDisabled={a === null || b === null || a === b} onPress={() => a !== null && b !== null && show([Math.min(a, b), Math.max(a, b)])}>A to B</Button>
              <Button isDisabled={!range} onPress={() => show(null)}>All</Button>
            </div>
            <a className="button" href={`/api/v1/recordings/${recording.id}/data.csv`} download={`recording-${recording.id}.csv`}>CSV</a>
            <a className="button" href={`/api/v1/recordings/${recording.id}/data.mcap`} download={`recording-${recording.id}.mcap`}>MCAP</a>
            <Button onPress={() => box.current && savePicture(box.current, `recording-${recording.id}.png`)}>PNG</Button>
          </div>
          <MeasureTable samples={samples} a={a} b={b} range={range} />
          <p className="quiet note">Click: cursor A; Shift and click: cursor B; drag, or Ctrl and wheel: zoom; double click: show all.</p>
        </>
      )}
    </Panel>
  );
}

function Recordings({ recordings, shown, overlays, memory }: {
  recordings: Recording[];
  shown: Recording | undefined;
  overlays: string[];
  memory: { bytes?: number } | undefined;
}) {
  const lay = (id: string, on: boolean) => keep({ with: (on ? [...overlays, id] : overlays.filter((each) => each !== id)).join(',') });
  return (
    <Panel title="Recordings" aside={memory?.bytes !== undefined && <span className="quiet">{fixed(memory.bytes / 1048576, 1)} MiB</span>}>
      {recordings.length === 0 && <p className="empty">None yet.</p>}
      <ul className="recordings">
        {[...recordings].reverse().map((recording) => {
          const id = String(recording.id);
          return (
            <li key={id} className={recording === shown ? 'now' : ''}>
              <button type="button" className="name" aria-pressed={recording === shown} onClick={() => keep({ rec: id, a: null, b: null, from: null, to: null })}>
                {recording.id} · {recording.name || (recording.fault ? `fault ${recording.fault.code.slice(2)}h of ${recording.fault.axis}` : recording.channels.map(({ name }) => name).slice(0, 3).join(', '))}
              </button>
              {recording.state !== 'done' && <span className="chip plain">{recording.state}</span>}
              {shown && recording !== shown && isOver(recording) && (
                <label className="over"><input type="checkbox" checked={overlays.includes(id)} onChange={(event) => lay(id, event.target.checked)} /> overlay</label>
              )}
              <Button kind="bare" aria-label={`Delete recording ${id}`} onPress={() => attempt(() => remove(`/recordings/${id}`).then(() => { if (recording === shown) keep({ rec: null }); }))}>×</Button>
            </li>
          );
        })}
      </ul>
    </Panel>
  );
}

