import { useEffect } from 'react';
import { Choice, Link } from './parts/controls';
import { ClockPanel } from './parts/clock';
import { Help } from './parts/help';
import { Mishap } from './parts/mishap';
import { Notices } from './parts/notices';
import { StopButton } from './parts/stop';
import { shownOf } from './model/problem';
import { AxisPage } from './pages/axis';
import { BoardsPage } from './pages/boards';
import { BusPage } from './pages/bus';
import { CommissionPage } from './pages/commission';
import { FaultsPage } from './pages/faults';
import { LinePage } from './pages/line';
import { MisbehaviourPage } from './pages/misbehaviour';
import { ObjectsPage } from './pages/objects';
import { PlantPage } from './pages/plant';
import { ScopePage } from './pages/scope';
import { TuningPage } from './pages/tuning';
import { TipLayer } from './parts/tips';
import { TokenForm } from './parts/token_form';
import { Tour } from './parts/tour';
import { useRoute } from './route';
import { useProject } from './storage';
import { update, useLine } from './store';
import { type Theme, useTheme } from './theme';

const pages = [
  ['', 'Line', LinePage],
  ['axis', 'Axis', AxisPage],
  ['commission', 'Commission', CommissionPage],
  ['scope', 'Scope', ScopePage],
  ['boards', 'Dashboards', BoardsPage],
  ['tuning', 'Tuning', TuningPage],
  ['faults', 'Faults', FaultsPage],
  ['misbehaviour', 'Misbehaviour', MisbehaviourPage],
  ['objects', 'Objects', ObjectsPage],
  ['plant', 'I/O and plant', PlantPage],
  ['bus', 'Bus', BusPage],
] as const;
const ofAxis = ['axis', 'commission', 'tuning', 'faults', 'misbehaviour', 'objects', 'plant'];

export function App() {
  const { page, name } = useRoute();
  const order = useLine((line) => line.order);
  const epoch = useLine((line) => line.epoch);
  const link = useLine((line) => line.link);
  const project = useProject();
  const [, title, Page] = pages.find(([path]) => path === page) ?? pages[0];
  const axis = ofAxis.includes(page) && order.includes(name) ? name : '';
  const known = pages.some(([path]) => path === page);
  const lacks = !known ? `page "${page}"` : ofAxis.includes(page) && name !== '' && axis === '' ? `axis "${name}"` : '';

  useEffect(() => {
    document.title = `${axis || title} · Servodrome`;
  }, [axis, title]);

  // A link between pages of an axis keeps the axis.
  const present = axis || order[0] || '';
  const addressOf = (path: string) => (ofAxis.includes(path) && present ? `/${path}/${encodeURIComponent(present)}` : `/${path}`);

  return (
    <>
      <a className="skip" href="#content">Skip to the content</a>
      <header className="top">
        <Link to="/" className="brand">
          <img src="/favicon.svg" alt="" width="22" height="22" />
          Servodrome
        </Link>
        <nav aria-label="Pages">
          {pages.map(([path, text]) => (
            <Link key={path} to={addressOf(path)} {...(path === page ? { 'aria-current': 'page' as const } : {})}>
              {text}
            </Link>
          ))}
        </nav>
        <ClockPanel />
        <ThemeChoice />
        <Help />
        <StopButton />
      </header>
      <Banner />
      <div className="page">
        <main id="content" tabIndex={-1}>
          <h1 className="unseen">{axis ? `${title}: ${axis}` : title}</h1>
          {link === 'locked' ? (
            <TokenForm />
          ) : order.length === 0 || project === undefined ? (
            <p className="empty">{link === 'up' && project !== undefined ? 'This line has no axes.' : 'Waiting for the server.'}</p>
          ) : lacks ? (
            <Lost what={lacks} page={known ? page : ''} order={order} />
          ) : (
            <Mishap key={`${epoch}/${page}/${axis}`}>
              <Page />
            </Mishap>
          )}
        </main>
      </div>
      <Notices />
      {link !== 'locked' && <Tour />}
      <TipLayer />
    </>
  );
}

// For an address that names a page or an axis that does not exist.
function Lost({ what, page, order }: { what: string; page: string; order: string[] }) {
  return (
    <p className="empty" role="alert">
      There is no {what}.{' '}
      {page === '' ? <Link to="/">To the line</Link> : order.map((each) => <Link key={each} className="button" to={`/${page}/${encodeURIComponent(each)}`}>{each}</Link>)}
    </p>
  );
}

function ThemeChoice() {
  const [theme, setTheme] = useTheme();
  const options = [['auto', 'Auto'], ['light', 'Light'], ['dark', 'Dark']] as const;
  return <Choice<Theme> label="Colours" hideLabel value={theme} options={options} onChange={setTheme} />;
}

function Banner() {
  const project = useProject();
  const link = useLine((line) => line.link);
  const restarted = useLine((line) => line.restarted);
  const silent = useLine((line) => line.order.filter((name) => line.axes[name].problem).join(', '));
  const problem = useLine((line) => line.axes[line.order.find((name) => line.axes[name].problem) ?? '']?.problem);
  if (link === 'lost') {
    return (
      <div className="banner bad" role="alert">
        Connection lost: values are the last received. The page reconnects automatically.
      </div>
    );
  }
  if (link === 'full') {
    return (
      <div className="banner bad" role="alert">
        The server has no free connection for live values: close other pages. Values are the last received.
      </div>
    );
  }
  if (project?.problem) {
    const { what, hint } = shownOf(project.problem); // its place is a file
    return (
      <div className="banner bad" role="alert">
        The project is not saved: {project.problem.where}: {what}{hint && `; ${hint}`}. The server tries again by itself, and the drives are not affected.
      </div>
    );
  }
  if (restarted) {
    return (
      <div className="banner" role="status">
        The server was restarted: {!project && 'recordings are lost, and '}simulated drives have lost the parameters that were not stored.
        <button type="button" onClick={() => update({ restarted: false })}>Understood</button>
      </div>
    );
  }
  if (problem) {
    const { what, where } = shownOf(problem);
    return (
      <div className="banner bad" role="alert">
        No answer from {silent}: {[what, where].filter(Boolean).join(' · ')}. The server retries automatically.
      </div>
    );
  }
  return null;
}
