import { useSyncExternalStore } from 'react';

// The address contains the state of the page, so a reload, a bookmark or a copied link restores it.

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
  document.querySelector('.page')?.scrollTo(0, 0);
}

export interface Route {
  page: string; // first part of the path; '': the page of the line
  name: string; // second part
  query: URLSearchParams;
}

// If a part of the path has an incomplete escape, for example in a truncated link, it is used without decoding.
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

// Sets `values` in the query without a new entry in the history. Null or an empty text removes a key.
export function keep(values: Record<string, string | null>) {
  const url = new URL(location.href);
  for (const [key, value] of Object.entries(values)) {
    if (value === null || value === '') url.searchParams.delete(key);
    else url.searchParams.set(key, value);
  }
  history.replaceState(null, '', url);
  tell();
}

// `keep` for a function that awaits something: it does nothing if another page is shown by then.
export function keepHere(): typeof keep {
  const { pathname } = location;
  return (values) => {
    if (location.pathname === pathname) keep(values);
  };
}
