"""Objects that a child of `os.fork` must not use: their `after_fork` is called in the child."""

from __future__ import annotations

import os
import weakref
from typing import TYPE_CHECKING, Protocol

from .errors import Forked


class OfOneProcess(Protocol):
    """An object that belongs to the process that made it."""

    def after_fork(self) -> None:
        """Makes the object unusable. Takes no lock: another thread of the parent may have held it."""


if TYPE_CHECKING:
    _objects: "weakref.WeakSet[OfOneProcess]"
_objects = weakref.WeakSet()


def register(thing: OfOneProcess) -> None:
    """Registers an object until it is collected."""
    _objects.add(thing)


def _after_fork() -> None:
    for thing in list(_objects):
        thing.after_fork()


def forked() -> Forked:
    """The exception for the use of such an object in the child."""
    return Forked(
        "the line belongs to the parent process; this process was forked from it",
        f"process {os.getpid()}",
        "make a line in this process",
    )


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_after_fork)
