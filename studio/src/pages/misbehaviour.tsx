import { useState } from 'react';
import { get, post, remove, segment } from '../api/client';
import type { ActionGroup, ActionNote, BusView, Catalogue, RulesView } from '../api/types';
import { freeName, isOfBus, messagesOf, problemOf, ruleText, type End, type Values } from '../model/misbehaviour';
import { attempt } from '../notices';
import { AxisTabs, usePageAxis } from '../parts/axis_tabs';
import { Button, Choice, Panel, Scroll, Trouble } from '../parts/controls';
import { KeyFields } from '../parts/key_fields';
import { fixed } from '../model/units';
import { useResource } from '../resource';
import { useRoute } from '../route';
import { useAxis, useMissing } from '../store';

// Rules by which drives and buses misbehave, fired by hand. The server gives the actions, their keys and their texts.

export function MisbehaviourPage() {
  const name = usePageAxis(useRoute().name);
  const axis = useAxis(name);
  const missing = useMissing('scenario');
  const { value: catalogue, problem } = useResource<Catalogue>(missing === undefined ? '/scenario/actions' : null);
  const bus = axis?.bus ?? axis?.serial?.bus ?? '';
  const { value: view } = useResource<BusView>(missing === undefined && bus !== '' ? `/buses/${segment(bus)}` : null);
  const [asked, setAsked] = useState(0);
  if (missing === null || !axis) return null;
  if (missing !== undefined) {
    return (
      <>
        <AxisTabs page="misbehaviour" name={name} />
        <Panel title="No simulated drive">
          <p className="note">Only simulated drives and their buses can misbehave on purpose: {missing}.</p>
        </Panel>
      </>
    );
  }
  const groups = catalogue?.groups.filter((group) => group.bus === '' || group.bus === view?.type) ?? [];
  return (
    <>
      <AxisTabs page="misbehaviour" name={name} />
      <Trouble problem={problem} />
      <div className="panels">
        {catalogue && view && <Library key={name} axis={name} bus={bus} groups={groups} catalogue={catalogue} onFired={() => setAsked((n) => n + 1)} />}
        <InForce asked={asked} />
      </div>
    </>
  );
}

function Library({ axis, bus, groups, catalogue, onFired }: { axis: string; bus: string; groups: ActionGroup[]; catalogue: Catalogue; onFired: () => void }) {
  const [chosen, setChosen] = useState({ group: groups[0].name, do: groups[0].actions[0].do });
  const group = groups.find(({ name }) => name === chosen.group) ?? groups[0];
  const action = group.actions.find((each) => each.do === chosen.do) ?? group.actions[0];
  return (
    <>
      <Panel title="Actions">
        {groups.map(({ name, title, actions }) => (
          <section key={name} className="actions" aria-label={title}>
            <h3>{title}</h3>
            <div className="buttons">
              {actions.map((each) => (
                <button
                  key={each.do}
                  type="button"
                  className="button"
                  title={each.text}
                  aria-pressed={each === action}
                  onClick={() => setChosen({ group: name, do: each.do })}
                >
                  {titleOf(each)}
                </button>
              ))}
            </div>
          </section>
        ))}
      </Panel>
      <ActionForm key={`${group.name} ${action.do}`} axis={axis} bus={bus} group={group} action={action} catalogue={catalogue} onFired={onFired} />
    </>
  );
}

const titleOf = (action: ActionNote) => action.do.replaceAll('_', ' ');

function ActionForm({ axis, bus, group, action, catalogue, onFired }: { axis: string; bus: string; group: ActionGroup; action: ActionNote; catalogue: Catalogue; onFired: () => void }) {
  const messages = messagesOf(action, group.messages);
  const [chosen, setChosen] = useState(messages[0]?.message ?? '');
  const [values, setValues] = useState<Values>(action.example);
  const [message_values, setMessageValues] = useState<Values>({});
  const [rule_values, setRuleValues] = useState<Values>({});
  const [when_values, setWhenValues] = useState<Values>({});
  const message = messages.find((each) => each.message === chosen) ?? null;
  const choice = { axis, bus, action, message, values, message_values, rule_values, when_values };
  const isWrong = [
    [action.keys, values] as const, [catalogue.message, message_values] as const, [catalogue.rule, rule_values] as const, [catalogue.when, when_values] as const,
  ].some(([types, typed]) => Object.entries(types).some(([key, type]) => problemOf(type, typed[key] ?? '') !== undefined));
  const begin = async (end: End) => {
    const { rules } = await get<RulesView>('/scenario/rules');
    const text = ruleText(freeName(titleOf(action), rules.map(({ name }) => name)), choice, end, catalogue);
    await post('/scenario/rules', { text });
    onFired();
  };
  const button = (end: End, text: string, kind: 'plain' | 'main') => (
    <Button kind={kind} isDisabled={isWrong} onPress={() => attempt(() => begin(end))}>{text}</Button>
  );
  const clause = action.clause !== '' ? action.clause : (message?.clause ?? '');
  return (
    <Panel title={`${group.title}: ${titleOf(action)}`} aside={<span className="quiet">{isOfBus(choice) ? bus : axis}</span>}>
      <p>{action.text}</p>
      <p className="quiet">Breaks: {clause}</p>
      <div className="form">
        {message && <Choice label="Message" value={chosen} options={messages.map((each) => [each.message, each.text] as const)} onChange={setChosen} />}
        <KeyFields types={action.keys} values={values} onChange={setValues} />
      </div>
      {message && (
        <details className="report">
          <summary>Only some of these messages</summary>
          <div className="form">
            <KeyFields types={catalogue.message} values={message_values} onChange={setMessageValues} />
            <KeyFields types={catalogue.rule} values={rule_values} onChange={setRuleValues} />
          </div>
        </details>
      )}
      <details className="report">
        <summary>Only when the axis is in a state, moves, or is at a place</summary>
        <div className="form">
          <KeyFields types={catalogue.when} values={when_values} onChange={setWhenValues} />
        </div>
      </details>
      <div className="buttons">
        {action.use === 'message' && button('act', 'Fire once', 'main')}
        {action.use === 'once' && button('removed', 'Fire', 'main')}
        {action.use === 'lasts' && button('second', 'Fire for 1 s', 'main')}
        {action.use !== 'once' && button('removed', 'Arm', 'plain')}
      </div>
      <p className="note">{action.use === 'once' ? 'The action has one effect, which removing does not take back.' : 'An armed rule acts until it is removed.'}</p>
    </Panel>
  );
}

function InForce({ asked }: { asked: number }) {
  const { value, problem, again } = useResource<RulesView>(`/scenario/rules#${asked}`, 500);
  const rules = value?.rules ?? [];
  return (
    <Panel
      title="Rules in force"
      aside={rules.length > 0 && <Button kind="bare" onPress={() => attempt(() => remove('/scenario').finally(again))}>Remove all</Button>}
    >
      <Trouble problem={problem} />
      {rules.length === 0 ? (
        <p className="empty">No rule: drives and buses behave.</p>
      ) : (
        <Scroll label="Rules in force">
          <table className="table">
            <thead>
              <tr>
                <th scope="col">rule</th><th scope="col" className="wide">of</th><th scope="col" className="wide">is</th><th scope="col">acts</th><th scope="col">first act, s</th><th scope="col"><span className="unseen">remove</span></th>
              </tr>
            </thead>
            <tbody>
              {rules.map((rule) => (
                <tr key={rule.name}>
                  <th scope="row">{rule.name}</th>
                  <td className="text">{rule.where}</td>
                  <td className="text">{rule.error !== '' ? <span className="bad">{rule.error}</span> : phases[rule.phase]}</td>
                  <td>{rule.acts}</td>
                  <td>{rule.first_act_s === null ? '—' : fixed(rule.first_act_s, 3)}</td>
                  <td><Button kind="bare" aria-label={`Remove ${rule.name}`} onPress={() => attempt(() => remove(`/scenario/rules/${segment(rule.name)}`).finally(again))}>Remove</Button></td>
                </tr>
              ))}
            </tbody>
          </table>
        </Scroll>
      )}
    </Panel>
  );
}

const phases = { waiting: 'armed', active: 'in force', over: 'over' };
