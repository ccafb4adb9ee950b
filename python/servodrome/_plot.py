"""A picture (SVG) of the last second of an axis, without a plotting library."""

from __future__ import annotations

import math
from typing import List, Mapping, Sequence, Tuple
from xml.sax.saxutils import escape

from .states import PowerState

SIGNALS = ("position_counts", "velocity_rpm", "torque_nm", "state")
_CURVES = (
    ("position_counts", "position, counts", "#0b62a4"),
    ("velocity_rpm", "velocity, rpm", "#2a7d2e"),
    ("torque_nm", "torque, Nm", "#b0440c"),
)
_WIDTH, _LEFT, _RIGHT, _TOP, _CURVE, _GAP, _BAND = 720, 100, 20, 52, 110, 28, 22  # pixels
_STYLE = "text{font:12px sans-serif;fill:#222}.frame{fill:none;stroke:#bbb}.curve{fill:none;stroke-width:1.4}"


def svg_of(axis: str, columns: Mapping[str, Sequence[float]]) -> str:
    """The curves of an axis over time, and its states below. `columns` has "time_s" and SIGNALS, with at least one sample."""
    times = columns["time_s"]
    begin, end = times[0], times[-1]
    scale = (_WIDTH - _LEFT - _RIGHT) / (end - begin) if end > begin else 0.0
    across = [_LEFT + (time - begin) * scale for time in times]
    height = _TOP + len(_CURVES) * (_CURVE + _GAP) + _BAND + _GAP
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{_WIDTH}" height="{height}" viewBox="0 0 {_WIDTH} {height}">',
        f'<title>{escape(axis)}</title><style>{_STYLE}</style><rect width="{_WIDTH}" height="{height}" fill="white"/>',
        _text(_LEFT, 20, f"axis {axis}, line time {begin:.3f} s to {end:.3f} s"),
    ]
    top = _TOP
    for name, title, colour in _CURVES:
        parts += _curve(across, columns[name], top, title, colour)
        top += _CURVE + _GAP
    parts += _states(across, columns["state"], top)
    for place in range(5):
        at = _LEFT + (_WIDTH - _LEFT - _RIGHT) * place / 4
        anchor = "end" if place == 4 else "middle"
        parts.append(_text(at, height - 10, f"{begin + (end - begin) * place / 4:.3f} s", anchor))
    return "\n".join([*parts, "</svg>\n"])


def _text(x: float, y: float, text: str, anchor: str = "start") -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}">{escape(text)}</text>'


def _curve(across: Sequence[float], values: Sequence[float], top: int, title: str, colour: str) -> List[str]:
    known = [value for value in values if not math.isnan(value)]
    low, high = (min(known), max(known)) if known else (0.0, 0.0)
    span = high - low
    parts = [
        f'<rect class="frame" x="{_LEFT}" y="{top}" width="{_WIDTH - _LEFT - _RIGHT}" height="{_CURVE}"/>',
        _text(_LEFT, top - 5, title if known else f"{title}: no power"),
    ]
    if known:
        labels = [(high, top + 10), (low, top + _CURVE)] if span else [(low, top + _CURVE / 2 + 4)]
        parts += [_text(_LEFT - 6, y, f"{value:.0f}" if abs(value) >= 1e4 else f"{value:.4g}", "end") for value, y in labels]
    points: List[Tuple[float, float]] = []
    for index, value in enumerate([*values, math.nan]):
        if not math.isnan(value):
            y = top + _CURVE * ((high - value) / span if span else 0.5)
            points.append((across[index], y))
        elif points:
            path = " ".join(f"{x:.1f},{y:.1f}" for x, y in _bends(points))
            parts.append(f'<polyline class="curve" stroke="{colour}" points="{path}"/>')
            points = []
    return parts


def _bends(points: List[Tuple[float, float]]) -> List[Tuple[float, float]]:
    """The points without those in the middle of a horizontal line."""
    inner = [point for before, point, after in zip(points, points[1:], points[2:]) if not before[1] == point[1] == after[1]]
    return [points[0], *inner, points[-1]]


def _states(across: Sequence[float], values: Sequence[float], top: int) -> List[str]:
    """A band with a field for each state, from its first sample to that of the next state."""
    numbers = [-1 if math.isnan(value) else int(value) for value in values]
    parts = [_text(_LEFT - 6, top + 15, "state", "end")]
    begin = 0
    for index in range(1, len(numbers) + 1):
        if index < len(numbers) and numbers[index] == numbers[begin]:
            continue
        x, width = across[begin], across[min(index, len(numbers) - 1)] - across[begin]
        name = PowerState(numbers[begin]).text
        field = f'<rect class="frame" x="{x:.1f}" y="{top}" width="{width:.1f}" height="{_BAND}">'
        parts.append(f"{field}<title>{name}</title></rect>")
        if width > 7 * len(name):
            parts.append(_text(x + 4, top + 15, name))
        begin = index
    return parts
