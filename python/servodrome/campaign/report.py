"""The report of a campaign: pass rates, worst cases, and how figures depend on parameters."""

from __future__ import annotations

import math
from collections import Counter
from html import escape
from typing import Any, Dict, Iterable, List, Sequence, Tuple

from .store import Store

_WORST = 5
_WIDTH, _HEIGHT, _MARGIN = 360, 200, 44  # pixels


def rates(rows: Sequence[Dict[str, Any]], column: str) -> List[Tuple[Any, int, int]]:
    """For each value of a column, numbers first: the value, the runs that passed, all runs."""
    counts: Dict[Any, List[int]] = {}
    for row in rows:
        count = counts.setdefault(row[column], [0, 0])
        count[0] += row["outcome"] == "passed"
        count[1] += 1
    return [(value, *counts[value]) for value in _ordered(counts)]


def spread(rows: Sequence[Dict[str, Any]], parameter: str, figure: str) -> List[Tuple[Any, float, float, float]]:
    """For each value of a parameter, numbers first: the value, and least, mean and greatest of the figure."""
    groups: Dict[Any, List[float]] = {}
    for row in rows:
        value = row.get(figure)
        if value is not None and math.isfinite(value):
            groups.setdefault(row[parameter], []).append(value)
    return [(key, min(groups[key]), sum(groups[key]) / len(groups[key]), max(groups[key])) for key in _ordered(groups)]


def _ordered(values: Iterable[Any]) -> List[Any]:
    return sorted(values, key=lambda value: (0, value) if isinstance(value, (int, float)) else (1, str(value)))


def figures_of(rows: Sequence[Dict[str, Any]]) -> List[str]:
    """The names of the figures."""
    return sorted({name for row in rows for name in row if name.startswith("figure_")})


def varied(store: Store) -> List[str]:
    """The parameters with more than one value."""
    return [name for name, values in store.about["parameters"].items() if len(values) > 1]


def text_of(store: Store) -> str:
    """The report as text."""
    rows = store.table().to_pylist()
    lines = [f"{store.about['title']}: {len(rows)} of {store.about['runs']} runs", ""]
    for outcome, _, of in rates(rows, "outcome"):
        lines.append(f"  {outcome:<12} {of:>8}  {100 * of / len(rows):6.2f} %")
    for error, count in Counter(row["error"] for row in rows if row["error"]).most_common(_WORST):
        lines.append(f"  {count:>8} times: {error}")
    for column in ["scenario", *varied(store)]:
        table = rates(rows, column)
        if len(table) < 2:
            continue
        lines += ["", column]
        lines += [f"  {str(value):<40} {passed:>8} of {of:<8} {100 * passed / of:6.2f} %" for value, passed, of in table]
    for figure in figures_of(rows):
        known = [row for row in rows if row.get(figure) is not None and math.isfinite(row[figure])]
        worst = sorted(known, key=lambda row: -abs(row[figure]))[:_WORST]
        lines += ["", f"{figure[len('figure_') :]}, greatest amounts"]
        for row in worst:
            settings = ", ".join(f"{name} = {row[name]}" for name in varied(store))
            lines.append(f"  run {row['run']:<8} {row[figure]:<14.6g} {row['scenario']} seed {row['seed']} {settings}".rstrip())
    return "\n".join(lines) + "\n"


def plot(points: Sequence[Tuple[Any, float, float, float]], title: str, across: str) -> str:
    """An SVG: the mean as a line, least and greatest as a band, over a parameter."""
    low = min(point[1] for point in points)
    high = max(point[3] for point in points)
    height = (high - low) or 1.0
    step = (_WIDTH - 2 * _MARGIN) / max(len(points) - 1, 1)

    def place(index: int, value: float) -> str:
        return f"{_MARGIN + index * step:.1f},{_HEIGHT - _MARGIN - (value - low) / height * (_HEIGHT - 2 * _MARGIN):.1f}"

    band = [place(i, point[3]) for i, point in enumerate(points)]
    band += [place(i, point[1]) for i, point in reversed(list(enumerate(points)))]
    mean = [place(i, point[2]) for i, point in enumerate(points)]
    first, last = points[0][0], points[-1][0]
    return (
        f'<svg viewBox="0 0 {_WIDTH} {_HEIGHT}" width="{_WIDTH}" role="img"><title>{escape(title)}</title>'
        f'<polygon points="{" ".join(band)}" fill="#0b62a4" opacity=".2"/>'
        f'<polyline points="{" ".join(mean)}" fill="none" stroke="#0b62a4" stroke-width="1.5"/>'
        f'<text x="4" y="14">{escape(title)}</text><text x="4" y="{_HEIGHT - _MARGIN}">{low:.4g}</text>'
        f'<text x="4" y="{_MARGIN}">{high:.4g}</text>'
        f'<text x="{_MARGIN}" y="{_HEIGHT - 8}">{escape(across)}: {escape(_short(first))} .. {escape(_short(last))}</text></svg>'
    )


def _short(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def html_of(store: Store) -> str:
    """The report as a page: the text, and a plot of each figure over each parameter."""
    rows = store.table().to_pylist()
    plots = []
    for figure in figures_of(rows):
        for parameter in varied(store):
            points = spread(rows, parameter, figure)
            if len(points) > 1:
                plots.append(plot(points, figure[len("figure_") :], parameter))
    return (
        '<!doctype html>\n<html lang="en"><meta charset="utf-8"><meta name="viewport" content="width=device-width">'
        f"<title>{escape(store.about['title'])}</title><style>body{{font:15px/1.5 system-ui,sans-serif;max-width:76rem;"
        "margin:2rem auto;padding:0 1rem}pre{overflow:auto}svg{margin:.5rem;border:1px solid #ccc}text{font-size:11px}</style>"
        f"\n<h1>{escape(store.about['title'])}</h1>\n<pre>{escape(text_of(store))}</pre>\n{''.join(plots)}\n</html>\n"
    ).replace("{{", "{").replace("}}", "}")
