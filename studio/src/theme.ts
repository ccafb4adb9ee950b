import { useState } from 'react';

// Light and dark as the system says, or as the reader has chosen here.
export type Theme = 'auto' | 'light' | 'dark';
const key = 'servodrome.theme';

export function applyTheme(theme: Theme = stored()) {
  if (theme === 'auto') document.documentElement.removeAttribute('data-theme');
  else document.documentElement.dataset.theme = theme;
  // Canvases do not follow style sheets.
  dispatchEvent(new Event('theme'));
}

function stored(): Theme {
  const value = localStorage.getItem(key);
  return value === 'light' || value === 'dark' ? value : 'auto';
}

export function useTheme(): [Theme, (theme: Theme) => void] {
  const [theme, set] = useState(stored);
  return [
    theme,
    (to) => {
      localStorage.setItem(key, to);
      set(to);
      applyTheme(to);
    },
  ];
}

// What a token of style.css is at the moment.
export function color(token: string): string {
  const probe = document.createElement('span');
  probe.style.color = `var(--${token})`;
  document.body.append(probe);
  const { color: value } = getComputedStyle(probe);
  probe.remove();
  return value;
}
