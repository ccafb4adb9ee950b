import { useState } from 'react';
import { unlock, useLine } from '../store';
import { Button, Panel } from './controls';

// From another machine, a page may command drives only with the server's token.
export function TokenForm() {
  const wrong = useLine((line) => line.wrongToken);
  const [typed, setTyped] = useState('');
  return (
    <Panel title="The server's token">
      <p className="note">
        This page is on another machine than its server, which takes commands from there only with its token: it printed one when it was started.
      </p>
      {wrong && <p className="trouble" role="alert">This is not, or no longer, the server&apos;s token.</p>}
      <form
        className="write token"
        onSubmit={(event) => {
          event.preventDefault();
          if (typed.trim() !== '') unlock(typed);
        }}
      >
        <label className="field">
          <span>Token</span>
          <input className="input mono" value={typed} onChange={(event) => setTyped(event.target.value)} autoComplete="off" autoCapitalize="off" spellCheck={false} />
        </label>
        <Button kind="main" type="submit" isDisabled={typed.trim() === ''}>Use it</Button>
      </form>
    </Panel>
  );
}
