"""Ports of a line's buses: waiting for what comes, in virtual_time() and outside of it."""

from __future__ import annotations

import _thread
import ctypes
from typing import TYPE_CHECKING, Any, Callable, Optional

from ._library import NOTHING, Handle, call, error_of, library
from ._open_lines import open_lines
from ._scheduler import running
from .errors import BadValue, Refused
from .virtual_time import active_line, active_scheduler

if TYPE_CHECKING:
    from .line import Line

_SLICE_NS = 250_000_000  # of line time, outside of virtual_time: Ctrl-C is handled between two calls
_get_ident = _thread.get_ident


def line_of(bus: str, kind: str) -> "Line":
    """The line of the present virtual_time(), or else the only open one that has a bus of this name and type."""
    line = active_line()
    if line is not None:
        return line
    found = [one for one in open_lines() if bus in one.buses and one.buses[bus].type == kind]
    if len(found) == 1:
        return found[0]
    what = "no open line has" if not found else f"{len(found)} open lines have"
    raise BadValue(f"{what} a bus {bus!r} of type {kind}", "port", "give line=...")


class Port:
    """An open port. `receive` gets the timeout of one call of the C library, and returns its result."""

    def __init__(self, line: "Line", open_function: str, *arguments: Any) -> None:
        c = library()
        number = ctypes.c_uint64()
        call(getattr(c, open_function), line._handle, *arguments, ctypes.byref(number))
        self.line = line
        self.handle = Handle(number.value, c.servodrome_port_close)
        self._is_cancelled = False

    def receive(self, attempt: Callable[[int, int], int], timeout: Optional[float]) -> bool:
        """Calls `attempt(handle, timeout_ns)` until something has come: True, or for at most `timeout` seconds of line time: False.

        In virtual_time() it waits as a participant; outside of it line time passes while it waits.
        """
        me = running.get(_get_ident())
        if me is not None:
            scheduler = me.scheduler
            if scheduler.line is not self.line:
                raise Refused("a port of another line", "virtual_time", "receive at ports of the line of virtual_time")
            if self._try(attempt, 0):
                return True
            if timeout is not None and timeout <= 0:
                scheduler.sleep(me, 0)
                return self._try(attempt, 0)
            until = scheduler.deadline(me, timeout)
            self._is_cancelled = False
            while True:
                is_woken = scheduler.wait(me, until, self.handle.value)
                if self._try(attempt, 0):
                    return True
                if not is_woken or self._is_cancelled:
                    return False
        other = active_scheduler()
        if other is not None and other.line is self.line:
            hint = "make it in the block: can.Bus, can.Notifier and the like start their threads when they are made"
            raise Refused("a thread that does not participate in virtual_time receives at a port of its line", "port", hint)
        left = None if timeout is None else max(0, round(timeout * 1e9))
        self._is_cancelled = False
        while left is None or left > _SLICE_NS:
            if self._try(attempt, _SLICE_NS):
                return True
            if self._is_cancelled:
                return False
            if left is not None:
                left -= _SLICE_NS
        return self._try(attempt, left)

    def cancel(self) -> None:
        """Ends a `receive` of another thread: it returns False."""
        self._is_cancelled = True
        scheduler = active_scheduler()
        if scheduler is not None:
            scheduler.wake_readers(self.handle.value)

    def _try(self, attempt: Callable[[int, int], int], timeout_ns: int) -> bool:
        result = attempt(self.handle.value, timeout_ns)
        if result == 0:
            return True
        if result == NOTHING:
            return False
        raise error_of(result, self.handle)

    def let_pass(self, seconds: float) -> None:
        """Lets line time pass: as a participant's wait in virtual_time, which Line.advance is as well."""
        self.line.advance(float(seconds))

    def close(self) -> None:
        """Closes it; once more does nothing. A participant that reads it gets Closed."""
        number = self.handle.value
        scheduler = active_scheduler()
        if number and scheduler is not None:
            scheduler.wake_readers(number)
        self.handle.close()
