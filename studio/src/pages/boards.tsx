import { useRef, useState, type ChangeEvent } from 'react';
import { Editor } from '../boards/editor';
import { savedBoards, setBoard } from '../boards/saved_boards';
import { parts } from '../boards/widgets';
import { added, fileOf, kinds, mostBoards, mostPlots, mostWidgets, movedTo, nameProblem, newWidget, readFile, widgets, type Board, type Widget, type WidgetKind } from '../model/boards';
import type { Problem } from '../api/types';
import { Button, Choice, Link, Panel, Toggle, Trouble } from '../parts/controls';
import { Mishap } from '../parts/mishap';
import { saveText } from '../parts/save';
import { tell } from '../notices';
import { go, useRoute } from '../route';
import { useSaved } from '../saved';
import { placeOf, useProject } from '../storage';
import '../boards.css';

// The name is in the query, because the server does not serve the page for a path with escapes.
const addressOf = (name: string) => `/boards?name=${encodeURIComponent(name)}`;

export function BoardsPage() {
  const name = useRoute().query.get('name') ?? '';
  const boards = useSaved(savedBoards);
  const project = useProject();
  const board = boards.find((each) => each.name === name) ?? (name === '' ? boards[0] : undefined);
  return (
    <>
      {boards.length > 0 && (
        <nav className="tabs axes" aria-label="Dashboards">
          {boards.map((each) => <Link key={each.name} to={addressOf(each.name)} {...(each === board ? { 'aria-current': 'page' as const } : {})}>{each.name}</Link>)}
        </nav>
      )}
      {name !== '' && !board && <p className="empty" role="alert">There is no dashboard "{name}" in {placeOf(project)}. Import its file, or make a new one.</p>}
      {board && <BoardView key={board.name} board={board} />}
      <Manage boards={boards} board={board} />
    </>
  );
}

function BoardView({ board }: { board: Board }) {
  const [editing, setEditing] = useState(board.widgets.length === 0);
  const [open, setOpen] = useState<number | null>(null); // the widget whose settings are open
  const [draft, setDraft] = useState<Widget | null>(null); // a new one, not saved yet
  const setWidgets = (to: Widget[]) => setBoard(board.name, { ...board, widgets: to });
  const titles = titlesOf(board);
  const plots = board.widgets.filter(({ kind }) => kind === 'plot').length;
  const close = () => {
    setOpen(null);
    setDraft(null);
  };
  return (
    <>
      <div className="toolbar boardbar" role="group" aria-label={`Dashboard ${board.name}`}>
        <Toggle isSelected={editing} onChange={(on) => { setEditing(on); close(); }}>edit</Toggle>
        {editing && <AddWidget full={board.widgets.length >= mostWidgets} noPlot={plots >= mostPlots} onAdd={(kind) => { close(); setDraft(newWidget(kind)); }} />}
      </div>
      {board.widgets.length === 0 && !draft && <p className="empty">This dashboard is empty: add a widget.</p>}
      <div className="board">
        {board.widgets.map((widget, i) =>
          open === i ? (
            <div key={i} className="widget span-4">
              <Editor widget={widget} onCancel={close} onSave={(to) => { setWidgets(board.widgets.map((each, k) => (k === i ? to : each))); close(); }} />
            </div>
          ) : (
            <WidgetBox
              key={i} widget={widget} title={titles[i]} editing={editing} isFirst={i === 0} isLast={i === board.widgets.length - 1} onEdit={() => { close(); setOpen(i); }}
              onMove={(by) => { close(); setWidgets(movedTo(board.widgets, i, i + by)); }} onRemove={() => { close(); setWidgets(board.widgets.filter((_, k) => k !== i)); }}
            />
          ),
        )}
        {draft && (
          <div className="widget span-4">
            <Editor widget={draft} onCancel={close} onSave={(to) => { setWidgets([...board.widgets, to]); close(); }} />
          </div>
        )}
      </div>
    </>
  );
}

const titleOf = ({ title, kind }: Widget) => title || widgets[kind].title;

// The titles on the page: a title that several widgets have gets a number, so each name means one widget.
function titlesOf(board: Board): string[] {
  const seen = new Map<string, number>();
  return board.widgets.map((widget) => {
    const title = titleOf(widget);
    const count = (seen.get(title) ?? 0) + 1;
    seen.set(title, count);
    return count === 1 ? title : `${title} (${count})`;
  });
}

function WidgetBox({ widget, title, editing, isFirst, isLast, onEdit, onMove, onRemove }: {
  widget: Widget;
  title: string;
  editing: boolean;
  isFirst: boolean;
  isLast: boolean;
  onEdit: () => void;
  onMove: (by: number) => void;
  onRemove: () => void;
}) {
  const Part = parts[widget.kind];
  return (
    <div className={`widget span-${widget.span}`}>
      <Panel
        title={title}
        aside={editing && (
          <div className="buttons" role="group" aria-label={`Edit ${title}`}>
            <Button kind="bare" aria-label={`Move ${title} back`} isDisabled={isFirst} onPress={() => onMove(-1)}>◀</Button>
            <Button kind="bare" aria-label={`Move ${title} on`} isDisabled={isLast} onPress={() => onMove(1)}>▶</Button>
            <Button kind="bare" aria-label={`Settings of ${title}`} onPress={onEdit}>settings</Button>
            <Button kind="bare" aria-label={`Remove ${title}`} onPress={onRemove}>×</Button>
          </div>
        )}
      >
        <Mishap key={JSON.stringify(widget)}><Part widget={widget} /></Mishap>
      </Panel>
    </div>
  );
}

function AddWidget({ full, noPlot, onAdd }: { full: boolean; noPlot: boolean; onAdd: (kind: WidgetKind) => void }) {
  const [kind, setKind] = useState<WidgetKind>('value');
  return (
    <>
      <Choice<WidgetKind>
        label="New widget" value={kind} onChange={setKind}
        options={kinds.map((each) => (each === 'plot' && noPlot ? [each, widgets[each].title, `at most ${mostPlots}`] as const : [each, `${widgets[each].title}: ${widgets[each].does}`] as const))}
      />
      <Button isDisabled={full || (kind === 'plot' && noPlot)} onPress={() => onAdd(kind)}>Add the widget</Button>
    </>
  );
}

// New, rename, delete, export and import.
function Manage({ boards, board }: { boards: Board[]; board: Board | undefined }) {
  const [name, setName] = useState('');
  const [problem, setProblem] = useState<Problem>();
  const [sure, setSure] = useState('');
  const project = useProject();
  const file = useRef<HTMLInputElement>(null);
  const wrong = name === '' ? undefined : nameProblem(name.trim(), boards.map((each) => each.name));
  const fits = name.trim() !== '' && !wrong;
  const make = () => {
    savedBoards.set([...boards, { name: name.trim(), widgets: [] }]);
    go(addressOf(name.trim()));
    setName('');
  };
  const rename = () => {
    if (!board) return;
    setBoard(board.name, { ...board, name: name.trim() });
    go(addressOf(name.trim()));
    setName('');
  };
  const remove = () => {
    if (!board) return;
    if (sure !== board.name) {
      setSure(board.name);
      return;
    }
    setBoard(board.name, null);
    setSure('');
    go('/boards');
  };
  const load = async (event: ChangeEvent<HTMLInputElement>) => {
    const chosen = event.target.files?.[0];
    if (!chosen) return;
    setProblem(undefined);
    try {
      const more = readFile(await chosen.text());
      if (boards.length + more.length > mostBoards) throw new Error(`more than ${mostBoards} dashboards: delete some first`);
      savedBoards.set(added(boards, more));
      tell(`${more.length} ${more.length === 1 ? 'dashboard' : 'dashboards'} imported from ${chosen.name}`);
    } catch (error) {
      setProblem({ what: error instanceof Error ? error.message : String(error), where: chosen.name, hint: 'nothing was imported' });
    }
    if (file.current) file.current.value = ''; // the same file can be chosen again
  };
  return (
    <Panel title={`Dashboards of ${placeOf(project)}`} className="manage">
      <form className="toolbar" onSubmit={(event) => { event.preventDefault(); if (fits && boards.length < mostBoards) make(); }}>
        <label className="field">
          <span>Name of a dashboard</span>
          <input className="input" value={name} maxLength={60} autoComplete="off" onChange={(event) => setName(event.target.value)} />
          {wrong && <span className="refusal" role="status">{wrong}</span>}
        </label>
        <Button type="submit" kind="main" isDisabled={!fits || boards.length >= mostBoards}>New</Button>
        {board && <Button isDisabled={!fits} onPress={rename}>Rename</Button>}
        {board && <Button onPress={remove} onBlur={() => setSure('')}>{sure === board.name ? `Really delete "${board.name}"` : 'Delete'}</Button>}
        <span className="grow" />
        <Button isDisabled={boards.length === 0} onPress={() => saveText(fileOf(boards), 'dashboards.json')}>Export all</Button>
        {board && <Button onPress={() => saveText(fileOf([board]), 'dashboard.json')}>Export this one</Button>}
        <label className="field file"><span>Import a file</span><input ref={file} className="input" type="file" accept=".json,application/json" onChange={(event) => void load(event)} /></label>
      </form>
      <Trouble problem={problem} />
      {boards.length === 0 && <p className="note">A dashboard shows values, plots, controls and scripts of your choice. It is kept in {placeOf(project)}; a file brings it to others.</p>}
    </Panel>
  );
}
