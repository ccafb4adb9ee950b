// How often the page shows new values. A user who prefers reduced motion gets calmer values and plots; the browser also
// needs less processor time for them.
const isCalm = 'matchMedia' in globalThis && matchMedia('(prefers-reduced-motion: reduce)').matches; // Node.js has no matchMedia

export const watch_hz = isCalm ? 5 : 20; // states of the axes
export const redraw_ms = isCalm ? 250 : 33; // between two drawings of a live plot
