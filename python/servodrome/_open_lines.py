"""The lines of this process in virtual time, so that a port can be opened by the name of its bus alone."""

from __future__ import annotations

import weakref
from typing import TYPE_CHECKING, List

if TYPE_CHECKING:
    from .line import Line

_lines: "weakref.WeakSet[Line]" = weakref.WeakSet()


def add(line: "Line") -> None:
    """Makes a new line known, until it is closed or collected."""
    _lines.add(line)


def open_lines() -> "List[Line]":
    """The lines that are open."""
    return [line for line in list(_lines) if not line.closed]
