import { useSyncExternalStore } from 'react';

// The address is the page's state: what a reload, a bookmark or a colleague's click brings back.

const listeners = new Set<() => void>();
const tell = () => listeners.forEach((listener) => listener());

function listen(listener: () => void) {
  listeners.add(listener);
  addEventListener('popstate', listener);
  return () => {
    listeners.delete(listener);
    removeEventListener('popstate', listener);
  };
}

export function go(address: string) {
  history.pushState(null, '', address);
  tell();
  scrollTo(0, 0);
}

export interface Route {
  page: string; // first part of the path: '' is the line
  name: string; // second part
  query: URLSearchParams;
}

// An address that somebody has cut off in the middle of an escape is an address of nothing.
function plain(segment: string): string {
  try {
    return decodeURIComponent(segment);
  } catch {
    return segment;
  }
}

export function useRoute(): Route {
  const address = useSyncExternalStore(listen, () => location.pathname + location.search);
  const url = new URL(address, location.origin);
  const [page = '', name = ''] = url.pathname.split('/').filter(Boolean).map(plain);
  return { page, name, query: url.searchParams };
}

// Keeps `values` in the query without a step in the history; null takes a key away.
export function keep(values: Record<string, string | null>) {
  const url = new URL(location.href);
  for (const [key, value] of Object.entries(values)) {
    if (value === null || value === '') url.searchParams.delete(key);
    else url.searchParams.set(key, value);
  }
  history.replaceState(null, '', url);
  tell();
}
