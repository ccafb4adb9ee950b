import type { Fault, FaultList, Recording } from '../api/types';
import { axisPath } from '../commands';
import { AxisTabs, usePageAxis } from '../parts/axis_tabs';
import { Link, Panel, Trouble } from '../parts/controls';
import { isFault } from '../model/cia402';
import { fixed } from '../model/units';
import { useResource } from '../resource';
import { useRoute } from '../route';
import { useAxis, useLine, useMissing } from '../store';
import { ClearFault } from './line';

export function FaultsPage() {
  const name = usePageAxis(useRoute().name);
  const axis = useAxis(name);
  const { value, problem } = useResource<FaultList>(axis?.problem ? null : `${axisPath(name)}/faults`, 1000);
  const moments = useMoments(name);
  const real = useMissing('fault_injection') ?? undefined; // for drives on a bus: why no fault can be injected
  if (!axis) return null;
  const active = value?.active ?? [];
  const hasFault = isFault(axis.state);
  return (
    <>
      <AxisTabs page="faults" name={name} />
      <Trouble problem={problem} />
      <Panel
        title="Active"
        aside={hasFault && <ClearFault name={name} />}
      >
        {!value ? (
          <p className="empty">Not read yet.</p>
        ) : active.length === 0 ? (
          <p className="empty">{hasFault ? 'The cause is gone: the fault can be cleared.' : 'No fault.'}</p>
        ) : (
          <ul className="faults">
            {active.map((fault) => (
              <li key={fault.code + fault.name}>
                <FaultText fault={fault} />
              </li>
            ))}
          </ul>
        )}
        {(value?.injected.length ?? 0) > 0 && (
          <p className="note">
            Injected, and held until it is removed: {value?.injected.map((fault) => fault.replaceAll('_', ' ')).join(', ')}. <Link to={`/plant/${encodeURIComponent(name)}`}>Remove the injected fault</Link> before clearing.
          </p>
        )}
      </Panel>
      <Panel title="Fault recordings">
        {real !== undefined ? (
          <p className="empty">Drives on a bus have no automatic fault recordings: record with a fault trigger on the Scope page.</p>
        ) : moments.length === 0 ? (
          <p className="empty">No fault recordings yet. The half second before each fault is recorded at 1 kHz.</p>
        ) : (
          <ul className="plain-list">
            {moments.map((recording) => (
              <li key={recording.id}>
                <Link to={`/scope?rec=${recording.id}`}>
                  {code(recording.fault?.code ?? '')} · recording {recording.id}
                </Link>
                <span className="quiet"> {fixed((recording.samples / recording.rate_hz) * 1000, 0)} ms, {recording.channels.length} channels</span>
              </li>
            ))}
          </ul>
        )}
      </Panel>
      <Panel title="History">
        {!value ? (
          <p className="empty">Not read yet.</p>
        ) : value.history.length === 0 ? (
          <p className="empty">The drive reports an empty fault history.</p>
        ) : (
          <ol className="faults">
            {value.history.map((fault, i) => (
              <li key={i}>
                <FaultText fault={fault} />
                <p className="quiet">{conditions(fault)}</p>
              </li>
            ))}
          </ol>
        )}
      </Panel>
    </>
  );
}

const code = (text: string) => (text.startsWith('0x') ? `${text.slice(2)}h` : text);

function FaultText({ fault }: { fault: Fault }) {
  return (
    <>
      <h3>
        <span className="mono">{code(fault.code)}</span> {fault.name}
      </h3>
      {fault.text && fault.text !== fault.name && <p>{fault.text}</p>}
      {(fault.cause ?? fault.remedy) && (
        <dl className="advice">
          {fault.cause && <><dt>cause</dt><dd>{fault.cause}</dd></>}
          {fault.remedy && <><dt>remedy</dt><dd>{fault.remedy}</dd></>}
        </dl>
      )}
    </>
  );
}

const measured: [string, string, number][] = [
  ['dc_link_v', 'V', 0], ['velocity_rpm', 'rpm', 0], ['current_a', 'A', 1], ['temperature_c', '°C', 0],
];

function conditions(fault: Record<string, unknown>): string {
  return measured
    .filter(([key]) => typeof fault[key] === 'number')
    .map(([key, unit, places]) => `${fixed(fault[key] as number, places)} ${unit}`)
    .join(', ');
}

function useMoments(axis: string): Recording[] {
  const event = useLine((line) => (line.lastEvent?.kind === 'recording' ? line.lastEvent.serial : 0));
  const { value } = useResource<{ recordings: Recording[] }>(`/recordings#${event}`);
  return (value?.recordings ?? []).filter(({ fault }) => fault?.axis === axis).reverse();
}
