// The token that the server requires from pages on another machine. The user types it or opens an address that contains
// it (http://HOST:8402/#token=TOKEN). Browsers do not send the part after '#' to the server, and the page removes it from
// the address at once.

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

// The token as WebSocket subprotocols, because a page cannot add header fields to a WebSocket's handshake. Names of
// subprotocols must not contain parentheses, so these are escaped.
export function subprotocols(): string[] {
  if (token() === '') return [];
  const escaped = encodeURIComponent(token()).replace(/[()]/g, (c) => `%${c.charCodeAt(0).toString(16)}`);
  return ['servodrome', `token.${escaped}`];
}
