"""Programs with threads and timeouts, unchanged, in the time of a line: `with servodrome.virtual_time(line):`.

    with servodrome.Line() as line, servodrome.virtual_time(line):
        network = canopen.Network()
        network.connect(interface="servodrome", channel="can0")
        drive = network.add_node(2, "generic402.eds")
        drive.sdo[0x6040].raw = 6
        time.sleep(10)                     # ten seconds of line time, some milliseconds of ours

The thread that enters the block, and each thread that a participant starts with `threading` meanwhile, is a *participant*. One participant
runs at a time, until it waits: in time.sleep, in a Condition (and so in Event, Semaphore, Barrier, Timer, queue.Queue and SimpleQueue), in
Thread.join, for a Lock or RLock, in a selector (asyncio), or for a port of the line (can.Bus, a serial port, EthercatPort). When all wait,
the line runs to the earliest timeout, or until a port has received something. So the same program does the same each time, to the last
bit; computing costs no line time.

The clock of participants: time.monotonic() and perf_counter() are line time; time.time(), time.localtime() and the like, datetime.now() and
date.today() are line time since the begin of 2026 (UTC). Other threads keep the real clock, and are not stopped.

Limits
- A loop that only reads the clock, or polls with a timeout of 0, gets one tick (62.5 us) for each hundred readings.
- A Lock, RLock or SimpleQueue that was made before the block is the one of C, which cannot be replaced: a participant that waits for such
  a lock waits for real, and for ever if another participant holds it over a wait. Make the objects of a program inside of the block.
  A Condition, Event, Semaphore or Queue may be older.
- Threads from before the block, of `_thread` or of C do not participate; a participant that waits for one of these in a Condition may get
  VirtualDeadlock. Sockets, files and subprocesses wait for real while the line stands still; real_time() does so for any code.
- Line.advance, run_until and run_ticks of a participant are waits like time.sleep.
- One block at a time in a process; a block for the same line inside of it, in a participant, changes nothing.

The end of the block waits for the participants that are not daemons, as the end of a program does. The others end there with a SystemExit
from their wait; after an exception all of them do.
"""

from __future__ import annotations

import _thread
from types import TracebackType
from typing import TYPE_CHECKING, Any, Callable, List, Optional, Type

from . import _patches
from ._backend import TICKS_PER_SECOND
from ._library import TICK_NS
from ._patches import RealTime
from ._scheduler import Scheduler, VirtualDeadlock, VirtualTimeEnded, running
from .errors import Refused

if TYPE_CHECKING:
    from .line import Line

__all__ = ["VirtualDeadlock", "VirtualTimeEnded", "active_line", "real_time", "virtual_time"]

_active: Optional[Scheduler] = None
_entry = _thread.allocate_lock()


def active_scheduler() -> Optional[Scheduler]:
    """The scheduler of the present block, in any thread."""
    return _active


def active_line() -> Optional["Line"]:
    """The line of the block in which the calling thread participates, or None."""
    me = running.get(_thread.get_ident())
    return None if me is None else me.scheduler.line


def real_time() -> RealTime:
    """A `with` block in which a participant has the real clock and waits for real; line time and the others stand still meanwhile."""
    return RealTime()


class virtual_time:  # noqa: N801
    """A `with` block in the time of a line; its value is the line. The module has the details.

    Raises Refused if a block is active already for another line, or in a thread that does not participate, and NotInRealTime for a line
    with clock="real". In the block: VirtualDeadlock, in the thread that entered it, if nothing can ever wake any participant.
    """

    def __init__(self, line: "Line") -> None:
        self._line = line

    def __enter__(self) -> "Line":
        global _active
        handle = self._line._handle
        with _entry:
            me = running.get(_thread.get_ident())
            if _active is not None and (me is None or me.scheduler.line is not self._line):
                where = f"virtual_time of {_active.line!r}"
                raise Refused("virtual time is active", where, "end that block first, or start this thread inside of it")
            if _active is not None:
                _active.depth += 1
                return self._line
            if not handle.is_open:
                raise handle.error()
            scheduler = Scheduler(self._line)
            _active = scheduler
        _redirect(self._line, scheduler)
        _patches.install()
        running[scheduler.owner.ident] = scheduler.owner
        return self._line

    def __exit__(
        self, kind: Optional[Type[BaseException]], error: Optional[BaseException], trace: Optional[TracebackType]
    ) -> None:
        global _active
        scheduler = _active
        assert scheduler is not None
        if scheduler.depth > 0:
            scheduler.depth -= 1
            return
        try:
            scheduler.end(kind is None)
        finally:
            running.pop(scheduler.owner.ident, None)
            _patches.remove()
            _restore(self._line)
            _active = None


_MEANS = ("run_until_ns", "advance_ns", "run_ticks", "pause")  # of Backend: what makes line time pass


def _redirect(line: "Line", scheduler: Scheduler) -> None:
    """Makes Line.advance and the like of a participant a wait."""
    backend: Any = line._backend

    def wait(name: str, until: Callable[[int], int]) -> Callable[..., None]:
        original = getattr(backend, name)

        def waits(*arguments: int) -> None:
            me = running.get(_thread.get_ident())
            end = until(*arguments) if me is not None else 0
            if me is None or end <= scheduler.now():
                original(*arguments)  # it has the errors
            else:
                scheduler.wait(me, end)

        return waits

    def after_ticks(ticks: int = TICKS_PER_SECOND // 1000) -> int:
        return (scheduler.now() // TICK_NS + ticks) * TICK_NS

    ends: List[Callable[..., int]] = [lambda end: end, lambda duration: scheduler.now() + duration, after_ticks, after_ticks]
    for name, until in zip(_MEANS, ends):
        setattr(backend, name, wait(name, until))


def _restore(line: "Line") -> None:
    for name in _MEANS:
        delattr(line._backend, name)
