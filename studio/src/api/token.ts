// The token that a server asks of pages from another machine: typed by a person, or behind the address
// (http://HOST:8402/#token=TOKEN), which servers are not told and which goes away at once.

const key = 'servodrome.token';
const mark = '#token=';

export function takeTokenFromAddress() {
  if (!location.hash.startsWith(mark)) return;
  setToken(decodeURIComponent(location.hash.slice(mark.length)));
  history.replaceState(null, '', location.pathname + location.search);
}

export const token = () => localStorage.getItem(key) ?? '';

export function setToken(to: string) {
  if (to === '') localStorage.removeItem(key);
  else localStorage.setItem(key, to);
}

export const fields = (): Record<string, string> => (token() === '' ? {} : { Authorization: `Bearer ${token()}` });

// What stands for the field in the handshake of a WebSocket, where a page can add none: subprotocols, whose names have
// no parentheses.
export function subprotocols(): string[] {
  if (token() === '') return [];
  const escaped = encodeURIComponent(token()).replace(/[()]/g, (c) => `%${c.charCodeAt(0).toString(16)}`);
  return ['servodrome', `token.${escaped}`];
}
