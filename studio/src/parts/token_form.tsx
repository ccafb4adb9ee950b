import { useState } from 'react';
import { unlock, useLine } from '../store';
import { Button, Panel } from './controls';

// A page on another machine may command drives only with the server's token.
export function TokenForm() {
  const wrong = useLine((line) => line.wrongToken);
  const [typed, setTyped] = useState('');
  return (
    <Panel title="The server's token">
      <p className="note">
        This page runs on another computer than the server. From other computers the server accepts commands only with its token, which it
        printed when it was started.
      </p>
      {wrong && <p className="trouble" role="alert">Wrong token: this is not the token of the running server.</p>}
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
        <Button kind="main" type="submit" isDisabled={typed.trim() === ''}>Connect</Button>
      </form>
    </Panel>
  );
}
