import { useCallback, useEffect, useId, useMemo, useRef, useState, type KeyboardEvent } from 'react';
import type { AxisView, ObjectEntry, ObjectValue } from '../api/types';
import { axisPath, readObject, writeObject } from '../commands';
import { AxisTabs, usePageAxis } from '../parts/axis_tabs';
import { Button, Choice, Panel, Search, Toggle, Trouble } from '../parts/controls';
import { addressOf, differs, groups, hasDefault, hexValue, inGroup, isReadable, isWritable, matches, namedOf, parseValue, rankOf, showValue, type Group } from '../model/objects';
import { objectTip } from '../model/meanings';
import { Views } from '../parts/views';
import { attempt, forgetRequests, tell } from '../notices';
import { useResource } from '../resource';
import { keep, useRoute } from '../route';
import { useLine, usePowered } from '../store';
import { ChangesView } from './changes';
import { ParametersView } from './parameters';
import { PdoView } from './pdos';

const views = [['', 'Dictionary'], ['parameters', 'Parameters'], ['pdos', 'Process data'], ['changes', 'Changes']] as const;

export function ObjectsPage() {
  const { name: asked, query } = useRoute();
  const name = usePageAxis(asked);
  const view = query.get('view');
  const powered = usePowered(name);
  useEffect(() => () => forgetRequests(`${axisPath(name)}/objects/`), [name, view]);
  return (
    <>
      <AxisTabs page="objects" name={name} />
      <Views label="Views of the objects" views={views} />
      {!powered && <p className="empty">The drive has no power or does not answer: its objects cannot be read.</p>}
      {view === 'parameters' ? (
        <ParametersView name={name} />
      ) : view === 'pdos' ? (
        <PdoView name={name} />
      ) : view === 'changes' ? (
        <ChangesView key={name} name={name} />
      ) : (
        <DictionaryView name={name} />
      )}
    </>
  );
}

function DictionaryView({ name }: { name: string }) {
  const { query } = useRoute();
  const powered = usePowered(name);
  const product = useLine((line) => (line.axes[name] as AxisView | undefined)?.product ?? '');
  const { value, problem } = useResource<{ objects: ObjectEntry[] }>(powered ? `${axisPath(name)}/objects` : null);
  const all = useMemo(() => (value?.objects ?? []).filter(({ index }) => Number(index) >= 0x1000), [value]);
  const search = query.get('q') ?? '';
  const group = (groups.find((each) => each === query.get('group')) ?? 'All');
  const values = useValues(name);
  const shown = useMemo(
    () =>
      all
        .filter((entry) => inGroup(entry, group, (each) => differs(each, values.of(each))) && matches(entry, search))
        .sort((a, b) => rankOf(a, search) - rankOf(b, search)),
    [all, group, search, values],
  );
  // The group "Changed" needs every value once. Reads that fail, for example while the drive starts, are repeated.
  const { readAll } = values;
  const unread = useRef<ObjectEntry[]>([]);
  unread.current = all.filter((entry) => hasDefault(entry) && values.of(entry) === undefined);
  useEffect(() => {
    if (group !== 'Changed') return;
    const read = () => void (unread.current.length > 0 && readAll(unread.current));
    read();
    const timer = setInterval(read, refresh_ms);
    return () => clearInterval(timer);
  }, [group, all, readAll]);
  const selected = shown.find((entry) => addressOf(entry) === query.get('object')) ?? shown[0];

  return (
    <>
      <Trouble problem={problem} />
      <div className="objects-page">
        <Panel
          title="Dictionary"
          aside={<span className="quiet" role="status">{shown.length} of {all.length}{values.reading ? ', reading' : ''}</span>}
        >
          <div className="toolbar">
            <Search label="Search by name, index or unit" value={search} onChange={(q) => keep({ q })} />
            <Choice<Group>
              label="Group"
              hideLabel
              value={group}
              options={groups.map((each) => [each, each] as const)}
              onChange={(to) => keep({ group: to === 'All' ? null : to })}
            />
          </div>
          {value && shown.length === 0 && <p className="empty">{nothing(group, search)}</p>}
          <ObjectList entries={shown} product={product} values={values} selected={selected} onSelect={(entry) => keep({ object: addressOf(entry) })} />
        </Panel>
        {selected && <Editor key={addressOf(selected)} axis={name} entry={selected} values={values} />}
      </div>
    </>
  );
}

function nothing(group: Group, search: string): string {
  const which = group === 'All' ? 'object' : group === 'Changed' ? 'changed object' : `object of the group "${group}"`;
  return search.trim() === '' ? `There is no ${which}.` : `No ${which} matches "${search.trim()}".`;
}

interface Values {
  of: (entry: ObjectEntry) => ObjectValue | undefined;
  note: (entry: ObjectEntry, value: ObjectValue) => void;
  want: (entries: ObjectEntry[]) => Promise<void>;
  readAll: (entries: ObjectEntry[]) => Promise<void>;
  reading: boolean;
}

const refresh_ms = 1000;
const atATime = 8;

// Values are read lazily, `atATime` of them in one request, and polled while their row is visible.
function useValues(axis: string): Values {
  const [known, setKnown] = useState<ReadonlyMap<string, ObjectValue>>(new Map());
  const [reading, setReading] = useState(false);
  const queue = useRef(new Map<string, ObjectEntry>());
  const busy = useRef<Promise<void> | null>(null);

  const want = useCallback(
    (entries: ObjectEntry[]): Promise<void> => {
      for (const entry of entries) if (isReadable(entry)) queue.current.set(addressOf(entry), entry);
      const drain = async () => {
        while (queue.current.size > 0) {
          const some = [...queue.current].slice(0, atATime);
          some.forEach(([address]) => queue.current.delete(address));
          const answers = await Promise.all(some.map(([, entry]) => readObject(axis, Number(entry.index), entry.sub).catch(() => undefined)));
          setKnown((before) => {
            const fresh = some.map(([address], i) => [address, answers[i]] as const).filter(([address, answer]) => answer !== undefined && before.get(address) !== answer);
            return fresh.length === 0 ? before : new Map([...before, ...(fresh as [string, ObjectValue][])]);
          });
        }
      };
      // The reset is not at the end of drain(): if the queue is empty, drain() ends before `busy` is assigned.
      return (busy.current ??= drain().finally(() => {
        busy.current = null;
      }));
    },
    [axis],
  );
  const readAll = useCallback(
    async (entries: ObjectEntry[]) => {
      setReading(true);
      await want(entries);
      setReading(false);
    },
    [want],
  );
  const note = useCallback((entry: ObjectEntry, value: ObjectValue) => setKnown((before) => new Map(before).set(addressOf(entry), value)), []);
  return useMemo(
    () => ({ of: (entry) => known.get(addressOf(entry)), note, want, readAll, reading }),
    [known, note, want, readAll, reading],
  );
}

const rowHeight = 26;
const beyond = 8;

// The page contains only the rows in view, because a dictionary has more than a thousand.
function ObjectList({ entries, product, values, selected, onSelect }: {
  product: string;
  entries: ObjectEntry[];
  values: Values;
  selected: ObjectEntry | undefined;
  onSelect: (entry: ObjectEntry) => void;
}) {
  const box = useRef<HTMLDivElement>(null);
  const [top, setTop] = useState(0);
  const [height, setHeight] = useState(600);
  const first = Math.max(0, Math.floor(top / rowHeight) - beyond);
  const rows = entries.slice(first, Math.ceil((top + height) / rowHeight) + beyond);

  useEffect(() => {
    const observer = new ResizeObserver(([entry]) => setHeight(entry.contentRect.height));
    observer.observe(box.current!);
    return () => observer.disconnect();
  }, []);
  const wanted = rows.map(addressOf).join();
  const { want } = values;
  const inView = useRef(rows);
  inView.current = rows;
  useEffect(() => {
    const first = setTimeout(() => void want(inView.current), 80);
    const timer = setInterval(() => void (!document.hidden && want(inView.current)), refresh_ms);
    return () => {
      clearTimeout(first);
      clearInterval(timer);
    };
  }, [wanted, want]);

  const onKeyDown = (event: KeyboardEvent) => {
    const steps: Record<string, number> = { ArrowDown: 1, ArrowUp: -1, PageDown: 15, PageUp: -15, Home: -entries.length, End: entries.length };
    const step = steps[event.key];
    if (!step || entries.length === 0) return;
    event.preventDefault();
    const at = Math.max(0, Math.min(entries.length - 1, (selected ? entries.indexOf(selected) : -1) + step));
    onSelect(entries[at]);
    const place = at * rowHeight;
    const element = box.current!;
    if (place < element.scrollTop) element.scrollTop = place;
    else if (place + rowHeight > element.scrollTop + element.clientHeight) element.scrollTop = place + rowHeight - element.clientHeight;
  };

  return (
    <div
      className="object-list"
      ref={box}
      role="listbox"
      tabIndex={0}
      aria-label="Objects"
      aria-activedescendant={selected && rows.includes(selected) ? `object-${addressOf(selected)}` : undefined}
      onKeyDown={onKeyDown}
      onScroll={(event) => setTop(event.currentTarget.scrollTop)}
    >
      <div className="object-space" role="presentation" style={{ height: entries.length * rowHeight }}>
        {rows.map((entry, i) => {
          const value = values.of(entry);
          return (
            // The list box handles the keyboard for its options.
            // eslint-disable-next-line jsx-a11y/click-events-have-key-events
            <div
              key={addressOf(entry)}
              id={`object-${addressOf(entry)}`}
              role="option"
              tabIndex={-1}
              aria-selected={entry === selected}
              aria-setsize={entries.length}
              aria-posinset={first + i + 1}
              data-tip={objectTip(entry, product)}
              className={`object ${differs(entry, value) ? 'changed' : ''}`}
              style={{ transform: `translateY(${(first + i) * rowHeight}px)` }}
              onClick={() => onSelect(entry)}
            >
              <span className="mono">{addressOf(entry)}</span>
              <span className="name">{entry.name}</span>
              <span className="value">{showValue(value, entry)}</span>
              <span className="unit">{entry.unit}</span>
              <span className="access">{entry.access}</span>
            </div>
          );
        })}
      </div>
    </div>
  );
}

function Editor({ axis, entry, values }: { axis: string; entry: ObjectEntry; values: Values }) {
  const [typed, setTyped] = useState<string | null>(null);
  const [held, setHeld] = useState<string | null>(null); // the text at the focus: a new text would end the user's selection
  const value = values.of(entry);
  const index = Number(entry.index);
  const bits = namedOf(entry.bits);
  const enumeration = namedOf(entry.enumeration);
  const writable = isWritable(entry);

  // Polls the value of the selected object.
  const latest = useRef(values);
  latest.current = values;
  useEffect(() => {
    if (!isReadable(entry)) return;
    let over = false;
    let timer: ReturnType<typeof setTimeout>;
    const read = () =>
      readObject(axis, index, entry.sub).then((now) => {
        if (!over) latest.current.note(entry, now);
      }, () => undefined).finally(() => {
        if (!over) timer = setTimeout(() => void read(), 500);
      });
    void read();
    return () => {
      over = true;
      clearTimeout(timer);
    };
  }, [axis, entry, index]);

  const write = (to: ObjectValue) =>
    attempt(async () => {
      await writeObject(axis, index, entry.sub, to);
      setTyped(null);
      setHeld((before) => (before === null ? null : showValue(to, entry)));
      if (isReadable(entry)) values.note(entry, await readObject(axis, index, entry.sub));
      tell(`${addressOf(entry)} written`);
    });
  const parsed = typed === null ? undefined : parseValue(entry, typed);
  const problem = parsed && 'problem' in parsed ? parsed.problem : undefined;
  const problemId = useId();

  return (
    <Panel title={entry.name} className="editor" aside={<span className="mono quiet">{addressOf(entry)}</span>}>
      {entry.text && <p className="note">{entry.text}</p>}
      <dl className="facts">
        <dt>value</dt>
        <dd className={differs(entry, value) ? 'changed' : ''}>{showValue(value, entry)} {entry.unit} <span className="quiet mono">{hexValue(entry, value)}</span></dd>
        {entry.default !== undefined && <><dt>default</dt><dd>{showValue(entry.default, entry)}</dd></>}
        {(entry.minimum ?? entry.maximum) !== undefined && <><dt>range</dt><dd>{entry.minimum ?? '–'} … {entry.maximum ?? '–'}</dd></>}
        <dt>type</dt>
        <dd>{entry.type}, {entry.access}{entry.pdo && entry.pdo !== 'none' ? `, PDO ${entry.pdo}` : ''}{entry.saved ? ', can be stored' : ''}</dd>
      </dl>
      {writable && (
        <form
          className="write"
          onSubmit={(event) => {
            event.preventDefault();
            if (parsed && 'value' in parsed) write(parsed.value);
          }}
        >
          <label className="field">
            <span>New value</span>
            <input
              className="input"
              value={typed ?? held ?? showValue(value, entry)}
              onFocus={() => setHeld(showValue(value, entry))}
              onBlur={() => setHeld(null)}
              onChange={(event) => setTyped(event.target.value)}
              aria-invalid={problem !== undefined}
              {...(problem ? { 'aria-describedby': problemId } : {})}
              spellCheck={false}
              autoComplete="off"
            />
          </label>
          <Button kind="main" type="submit" isDisabled={!parsed || problem !== undefined}>Write</Button>
          {hasDefault(entry) && differs(entry, value) && <Button onPress={() => write(entry.default!)}>Default</Button>}
        </form>
      )}
      {problem && <p className="refusal" id={problemId} role="status">{problem}</p>}
      {enumeration.length > 0 && typeof value === 'number' && (
        <Choice
          label="Meaning"
          value={value}
          isDisabled={!writable}
          options={[...enumeration.map(({ value: number, name }) => [number, `${number}: ${name}`] as const), ...(enumeration.some((each) => each.value === value) ? [] : [[value, `${value}`] as const])]}
          onChange={write}
        />
      )}
      {bits.length > 0 && typeof value === 'number' && (
        <ul className="bit-list">
          {bits.map(({ value: bit, name }) => (
            <li key={bit}>
              <span className="number">{bit}</span>
              <Toggle isDisabled={!writable} isSelected={Math.floor(value / 2 ** bit) % 2 === 1} onChange={(on) => write(value + (on ? 1 : -1) * 2 ** bit)}>{name}</Toggle>
            </li>
          ))}
        </ul>
      )}
      {index === 0x1010 && writable && <Button onPress={() => write(0x65766173)}>Store (writes "save")</Button>}
      {index === 0x1011 && writable && <Button onPress={() => write(0x64616f6c)}>Restore defaults (writes "load")</Button>}
    </Panel>
  );
}
