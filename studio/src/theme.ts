import { useState } from 'react';

// The light or dark theme: of the system (auto), or as chosen on this page.
export type Theme = 'auto' | 'light' | 'dark';
const key = 'servodrome.theme';

export function applyTheme(theme: Theme = stored()) {
  if (theme === 'auto') document.documentElement.removeAttribute('data-theme');
  else document.documentElement.dataset.theme = theme;
  // Style sheets do not change drawn canvases, so they must be drawn again.
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

// The present value of a colour of style.css.
export function color(token: string): string {
  const probe = document.createElement('span');
  probe.style.color = `var(--${token})`;
  document.body.append(probe);
  const { color: value } = getComputedStyle(probe);
  probe.remove();
  return value;
}
