import { dismiss, useNotices } from '../notices';

export function Notices() {
  const notices = useNotices();
  return (
    <div className="notices" role="status" aria-live="polite">
      {notices.map(({ id, bad, what, where, hint }) => (
        <div key={id} className={bad ? 'notice bad' : 'notice'}>
          <p>
            <strong>{what}</strong>
            {where && <span className="quiet"> {where}</span>}
            {hint && <span className="hint">{hint}</span>}
          </p>
          <button type="button" aria-label="Dismiss" onClick={() => dismiss(id)}>×</button>
        </div>
      ))}
    </div>
  );
}
