// Saved layouts of the scope: the settings in the address, without cursors and zoom, which belong to one recording.

export interface Layout {
  name: string;
  query: Record<string, string>;
}

export const layoutKeys = ['ch', 'rate', 'ms', 'pre', 'trigger', 'tch', 'level', 'slope', 'taxis', 'tstate', 'math', 'plot', 'px', 'py', 'win'] as const;

export function layoutOf(name: string, query: URLSearchParams): Layout {
  return { name, query: Object.fromEntries(layoutKeys.flatMap((key) => (query.get(key) ? [[key, query.get(key)!] as const] : []))) };
}

// The change of the address that applies a layout: removes the settings that the layout does not have.
export const appliedOf = ({ query }: Layout): Record<string, string | null> => Object.fromEntries(layoutKeys.map((key) => [key, query[key] ?? null]));

// Replaces the layout of the same name.
export const withLayout = (layouts: Layout[], layout: Layout) => [...layouts.filter(({ name }) => name !== layout.name), layout].sort((a, b) => a.name.localeCompare(b.name));

export function readLayouts(json: unknown): Layout[] {
  if (!Array.isArray(json)) throw new Error('not a list of layouts');
  return json.map((each: unknown, i) => {
    const { name, query } = (each ?? {}) as Partial<Layout>;
    if (typeof name !== 'string' || typeof query !== 'object' || query === null || !Object.values(query).every((value) => typeof value === 'string')) {
      throw new Error(`layout ${i + 1} has no name or no settings`);
    }
    return { name, query };
  });
}
