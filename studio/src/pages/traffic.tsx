import { type KeyboardEvent, useEffect, useLayoutEffect, useRef, useState } from 'react';
import { get, problemOf, put, segment } from '../api/client';
import type { BusView, Problem } from '../api/types';
import { Button, Choice, Panel, Search, Toggle, Trouble } from '../parts/controls';
import { emptyTable, isGap, kindsOf, queryOf, secondsOf, type Shown, type Table, type TrafficAnswer, type TrafficFilter, withAnswer } from '../model/traffic';
import { fixed } from '../model/units';
import { keep, useRoute } from '../route';

const row_px = 24;
const rows_beyond = 8; // rows drawn above and below the visible part
const ask_every_ms = 250;
const most_per_answer = 500;

// The decoded frames of a bus, live.
export function Traffic({ bus }: { bus: BusView }) {
  const { query } = useRoute();
  const filter: TrafficFilter = {
    text: query.get('text') ?? '',
    kind: query.get('kind') ?? '',
    node: query.get('node') ?? '',
    errors: query.get('errors') === 'true',
  };
  const path = `/buses/${segment(bus.name)}/traffic`;
  const [paused, setPaused] = useState(false);
  const [follow, setFollow] = useState(true);
  const [chosen, setChosen] = useState<number | null>(null);
  const { table, answer, problem, clear } = useTraffic(path, filter, paused);
  const [refused, setRefused] = useState<Problem>();
  const selected = table.rows.find(({ key }) => key === chosen);

  const record = (on: boolean) => {
    put(path, { record: on }).then(() => setRefused(undefined), (error: unknown) => setRefused(problemOf(error)));
  };
  // Opening the page starts the recording.
  useEffect(() => {
    put(path, { record: true }).then(() => setRefused(undefined), (error: unknown) => setRefused(problemOf(error)));
  }, [path]);

  const capture = (format: string) => `/api/v1/buses/${segment(bus.name)}/capture?format=${format}`;
  const text_format = bus.type === 'can' ? 'candump' : bus.type === 'rs485' ? 'text' : null;
  const ending = bus.type === 'rs485' ? 'pcapng' : 'pcap';
  return (
    <>
      <div className="toolbar">
        <Search label="Filter by text" value={filter.text} onChange={(text) => keep({ text })} />
        <Choice
          label="Kind" value={filter.kind} onChange={(kind) => keep({ kind })}
          options={[['', 'all'], ...kindsOf[bus.type].map((kind) => [kind, kind] as const)]}
        />
        <label className="field narrow">
          <span>{bus.type === 'ethercat' ? 'Slave' : bus.type === 'can' ? 'Node' : 'Station'}</span>
          <input className="input" inputMode="numeric" value={filter.node} onChange={(event) => keep({ node: event.target.value.replace(/\D/g, '') })} />
        </label>
        <Toggle isSelected={filter.errors} onChange={(on) => keep({ errors: on ? 'true' : null })}>Errors only</Toggle>
      </div>
      <Trouble problem={refused ?? problem} />
      <Panel
        title="Traffic"
        className="traffic-panel"
        aside={
          <div className="toolbar">
            <Button kind={answer?.recording ? 'plain' : 'main'} onPress={() => record(!answer?.recording)}>
              {answer?.recording ? 'Stop recording' : 'Record'}
            </Button>
            <Button onPress={() => setPaused(!paused)} aria-pressed={paused}>{paused ? 'Resume' : 'Pause'}</Button>
            <Button onPress={clear}>Clear</Button>
            <Toggle isSelected={follow} onChange={setFollow}>Follow</Toggle>
            <a className="button" href={capture('pcap')} download={`${bus.name}.${ending}`}>Save {ending}</a>
            {text_format && <a className="button" href={capture(text_format)} download={`${bus.name}.log`}>Save {text_format}</a>}
          </div>
        }
      >
        <Rows table={table} chosen={chosen} onChoose={(key) => { setChosen(key); setFollow(false); }} follow={follow} onFollow={setFollow} />
        <p className="note" role="status">
          {answer ? `${fixed(answer.frames, 0)} frames recorded` : 'Nothing recorded yet'}
          {table.absent > 0 ? `, ${fixed(table.absent, 0)} rows skipped or lost` : ''}
          {paused ? ', display paused' : answer && !answer.recording ? ', recording is off' : ''}
        </p>
      </Panel>
      {selected && !isGap(selected) && (
        <Panel title={`Frame ${selected.number}`} aside={<Button kind="bare" onPress={() => setChosen(null)}>Close</Button>}>
          <dl className="frame">
            <dt>Time</dt><dd className="mono">{secondsOf(selected.time_ns)} s</dd>
            <dt>From</dt><dd>{selected.from}{selected.about && `, about ${selected.about}`}</dd>
            <dt>Kind</dt><dd>{selected.kind}</dd>
            <dt>Bytes</dt><dd className="mono">{selected.bytes}</dd>
            <dt>Meaning</dt><dd className={selected.error ? 'wrong' : ''}>{selected.text}</dd>
            {selected.values.map((value) => (
              <div key={value.object}><dt className="mono">{value.object}</dt><dd>{value.name}: {value.value}</dd></div>
            ))}
          </dl>
        </Panel>
      )}
    </>
  );
}

function useTraffic(path: string, filter: TrafficFilter, paused: boolean) {
  const wanted = JSON.stringify({ path, ...filter });
  const [state, setState] = useState<{ wanted: string; table: Table; answer?: TrafficAnswer }>({ wanted, table: emptyTable() });
  const [problem, setProblem] = useState<Problem>();
  const latest = useRef(state);
  latest.current = state;

  useEffect(() => {
    if (paused) return;
    let over = false;
    let timer: ReturnType<typeof setTimeout>;
    const { path: of, ...by } = JSON.parse(wanted) as TrafficFilter & { path: string };
    const ask = () => {
      const before = latest.current.wanted === wanted ? latest.current.table : emptyTable();
      get<TrafficAnswer>(`${of}?${queryOf(by, before.next, most_per_answer)}`)
        .then(
          (answer) => {
            if (over) return;
            setProblem(undefined);
            // The table may have been cleared since the request.
            const present = latest.current.wanted === wanted ? latest.current.table : before;
            setState({ wanted, table: withAnswer(present, before.next === 0 ? { ...answer, left_out: 0 } : answer), answer });
          },
          (error: unknown) => {
            if (!over) setProblem(problemOf(error));
          },
        )
        .finally(() => {
          if (!over) timer = setTimeout(ask, document.hidden ? 4 * ask_every_ms : ask_every_ms);
        });
    };
    // Debounce: a filter changes with each letter that the user types.
    timer = setTimeout(ask, latest.current.wanted === wanted ? 0 : ask_every_ms);
    return () => {
      over = true;
      clearTimeout(timer);
    };
  }, [wanted, paused]);

  const table = state.wanted === wanted ? state.table : emptyTable();
  const clear = () => setState({ ...latest.current, table: { ...emptyTable(table.next, table.missed), keys: table.keys } });
  return { table, answer: state.answer, problem, clear };
}

// Draws only the visible rows, so that the time to draw does not depend on the number of rows.
function Rows({ table, chosen, onChoose, follow, onFollow }: {
  table: Table;
  chosen: number | null;
  onChoose: (key: number) => void;
  follow: boolean;
  onFollow: (on: boolean) => void;
}) {
  const box = useRef<HTMLDivElement>(null);
  const trimmed = useRef(table.trimmed);
  const [view, setView] = useState({ top: 0, height: 400 });
  const { rows } = table;

  useLayoutEffect(() => {
    const element = box.current;
    if (!element) return;
    if (follow) element.scrollTop = element.scrollHeight;
    // The visible rows keep their place when rows are removed at the top.
    else if (table.trimmed > trimmed.current) element.scrollTop -= (table.trimmed - trimmed.current) * row_px;
    trimmed.current = table.trimmed;
    setView({ top: element.scrollTop, height: element.clientHeight });
  }, [table, follow]);

  const onScroll = () => {
    const element = box.current;
    if (!element) return;
    setView({ top: element.scrollTop, height: element.clientHeight });
    const is_at_end = element.scrollHeight - element.scrollTop - element.clientHeight < 2 * row_px;
    if (follow && !is_at_end) onFollow(false);
  };

  const present = rows.findIndex(({ key }) => key === chosen);
  const onKeyDown = (event: KeyboardEvent) => {
    const page = Math.max(1, Math.floor(view.height / row_px) - 1);
    const steps: Record<string, number> = { ArrowDown: 1, ArrowUp: -1, PageDown: page, PageUp: -page, Home: -rows.length, End: rows.length };
    const step = steps[event.key];
    if (step === undefined || rows.length === 0) return;
    event.preventDefault();
    const from = present < 0 ? (step < 0 ? rows.length : Math.floor(view.top / row_px) - 1) : present;
    const next = Math.min(rows.length - 1, Math.max(0, from + step));
    const row = rows[next];
    const element = box.current;
    if (!row || !element) return;
    onChoose(row.key);
    if (next * row_px < element.scrollTop) element.scrollTop = next * row_px;
    if ((next + 1) * row_px > element.scrollTop + element.clientHeight) element.scrollTop = (next + 1) * row_px - element.clientHeight;
  };

  const first = Math.max(0, Math.floor(view.top / row_px) - rows_beyond);
  const last = Math.min(rows.length, Math.ceil((view.top + view.height) / row_px) + rows_beyond);
  const drawn = rows.slice(first, last);
  const active = drawn.some(({ key }) => key === chosen) ? { 'aria-activedescendant': `frame-${chosen}` } : {};
  return (
    <div className="traffic" ref={box} onScroll={onScroll} onKeyDown={onKeyDown} role="listbox" aria-label="Frames" tabIndex={0} {...active}>
      <div style={{ height: rows.length * row_px }} role="presentation">
        <div style={{ transform: `translateY(${first * row_px}px)` }} role="presentation">
          {drawn.map((row, i) => (
            <RowLine key={row.key} row={row} place={first + i + 1} total={rows.length} isChosen={row.key === chosen} onChoose={onChoose} />
          ))}
        </div>
      </div>
    </div>
  );
}

function RowLine({ row, place, total, isChosen, onChoose }: { row: Shown; place: number; total: number; isChosen: boolean; onChoose: (key: number) => void }) {
  const common = { id: `frame-${row.key}`, 'aria-posinset': place, 'aria-setsize': total } as const;
  if (isGap(row)) return <div role="option" aria-selected={isChosen} {...common} className="gap">{row.gap}</div>;
  return (
    // The list handles the keyboard (aria-activedescendant).
    // eslint-disable-next-line jsx-a11y/click-events-have-key-events, jsx-a11y/interactive-supports-focus
    <div role="option" aria-selected={isChosen} {...common} className={row.error ? 'wrong' : ''} onClick={() => onChoose(row.key)}>
      <span className="mono time-of">{secondsOf(row.time_ns)}</span>
      <span className="from">{row.from}</span>
      <span className="kind">{row.kind}</span>
      <span className="mono bytes">{row.bytes}</span>
      <span className="said">{row.about && <span className="quiet">{row.about} </span>}{row.text}</span>
    </div>
  );
}
