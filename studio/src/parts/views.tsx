import { Link } from './controls';
import { useRoute } from '../route';

// Links to the views of a page. `view` in the address selects one; without it the page shows the first.
export function Views({ views, label }: { views: readonly (readonly [string, string])[]; label: string }) {
  const { page, name, query } = useRoute();
  const present = query.get('view') ?? '';
  const to = (view: string) => `/${page}/${encodeURIComponent(name)}${view === '' ? '' : `?view=${view}`}`;
  return (
    <nav className="tabs views" aria-label={label}>
      {views.map(([view, text]) => (
        <Link key={view} to={to(view)} {...(view === present ? { 'aria-current': 'page' as const } : {})}>{text}</Link>
      ))}
    </nav>
  );
}
