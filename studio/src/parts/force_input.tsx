// What an input of a virtual drive sees: its wire, or a forced level.
export function ForceInput({ input, level, forced, onForce }: { input: string; level: boolean; forced: boolean; onForce: (input: string, level: boolean | null) => unknown }) {
  return (
    <div className="segments" role="group" aria-label={`Force ${input}`}>
      <button type="button" aria-pressed={!forced} onClick={() => void onForce(input, null)}>wire</button>
      <button type="button" aria-pressed={forced && !level} onClick={() => void onForce(input, false)}>0</button>
      <button type="button" aria-pressed={forced && level} onClick={() => void onForce(input, true)}>1</button>
    </div>
  );
}
