"""What virtual_time() replaces while it is active: the clock, waiting, threads and locks of the standard library.

Every replacement looks whether the calling thread is a participant, and calls the original for another one. A module may have bound a
function by its own name (`from time import monotonic`), so the replacements go into all loaded modules, and out of them at the end.
"""

from __future__ import annotations

import _thread
import functools
import queue
import sched
import selectors
import subprocess
import sys
import threading
import time
from typing import Any, Callable, Dict, List, Tuple

from . import _scheduler
from ._datetime import replacements
from ._locks import AllocatedLock, VirtualLock, VirtualRLock, VirtualSimpleQueue
from ._scheduler import Participant, Waiter, running

EPOCH_NS = 1_767_225_600_000_000_000
"""time.time_ns() at line time 0: the begin of 2026, in UTC."""

_get_ident = _thread.get_ident
_real = {name: getattr(time, name) for name in dir(time)}
_real_wait = threading.Condition.wait
_real_enter = threading.Condition.__enter__
_real_is_alive = threading.Thread.is_alive
_C_LOCKS = (type(_thread.allocate_lock()), type(_thread.RLock()))
_C_LOCK_S = 0.001  # a thread outside of virtual time holds a lock for a shorter time


class _Clock:
    """The functions of the module time. Bound methods, because a function in a class would be bound again there."""

    def sleep(self, seconds: float) -> None:
        me = running.get(_get_ident())
        if me is None or seconds < 0 or seconds != seconds:  # the original has the errors
            _real["sleep"](seconds)
        else:
            me.scheduler.sleep(me, seconds)

    def time(self) -> float:
        me = running.get(_get_ident())
        return (me.scheduler.clock(me) + EPOCH_NS) / 1e9 if me is not None else _real["time"]()

    def time_ns(self) -> int:
        me = running.get(_get_ident())
        return me.scheduler.clock(me) + EPOCH_NS if me is not None else _real["time_ns"]()

    def monotonic(self) -> float:
        me = running.get(_get_ident())
        return me.scheduler.clock(me) / 1e9 if me is not None else _real["monotonic"]()

    def monotonic_ns(self) -> int:
        me = running.get(_get_ident())
        return me.scheduler.clock(me) if me is not None else _real["monotonic_ns"]()

    def perf_counter(self) -> float:
        me = running.get(_get_ident())
        return me.scheduler.clock(me) / 1e9 if me is not None else _real["perf_counter"]()

    def perf_counter_ns(self) -> int:
        me = running.get(_get_ident())
        return me.scheduler.clock(me) if me is not None else _real["perf_counter_ns"]()

    def localtime(self, seconds: Any = None) -> Any:
        return _real["localtime"](self.time() if seconds is None else seconds)

    def gmtime(self, seconds: Any = None) -> Any:
        return _real["gmtime"](self.time() if seconds is None else seconds)

    def ctime(self, seconds: Any = None) -> str:
        return _real["ctime"](self.time() if seconds is None else seconds)  # type: ignore[no-any-return]

    def strftime(self, form: str, moment: Any = None) -> str:
        return _real["strftime"](form, self.localtime() if moment is None else moment)  # type: ignore[no-any-return]


_clock = _Clock()
_CLOCK_NAMES = ["sleep", "time", "time_ns", "monotonic", "monotonic_ns", "perf_counter", "perf_counter_ns"]
_CLOCK_NAMES += ["localtime", "gmtime", "ctime", "strftime"]

# Objects that modules have by name, and what replaces them.
_OBJECTS: List[Tuple[Any, Any]] = [(_real[name], getattr(_clock, name)) for name in _CLOCK_NAMES]
_OBJECTS += replacements(_clock.time)
_OBJECTS += [
    (threading.Lock, VirtualLock),
    (threading.RLock, VirtualRLock),
    (queue.SimpleQueue, VirtualSimpleQueue),
]
if _thread.allocate_lock is not threading.Lock:  # from Python 3.13 on
    _OBJECTS.append((_thread.allocate_lock, AllocatedLock))
_REPLACEMENTS: Dict[int, Any] = {id(original): replacement for original, replacement in _OBJECTS}
_ORIGINALS: Dict[int, Any] = {id(replacement): original for original, replacement in _OBJECTS}
# The import system and the C modules themselves keep theirs; so do this package and pytest, which measure real time.
_KEPT = ("_thread", "_queue", "_frozen_importlib", "_frozen_importlib_external", "_pytest", __package__)


# ---- Conditions, and so queues, events, semaphores, barriers ----


def _is_free(lock: Any) -> bool:
    if not lock.acquire(False):
        return False
    lock.release()
    return True


def wait(self: Any, timeout: Any = None) -> bool:
    """threading.Condition.wait"""
    me = running.get(_get_ident())
    if me is None:
        return _real_wait(self, timeout)
    if not self._is_owned():
        raise RuntimeError("cannot wait on un-acquired lock")
    scheduler, lock = me.scheduler, self._lock
    waiter = Waiter(me)
    self._waiters.append(waiter)
    saved = self._release_save()

    def attempt() -> bool:
        if not lock.acquire(False):
            return False
        for _ in range(saved[0] - 1 if isinstance(saved, tuple) else 0):
            lock.acquire()
        return True

    try:
        polls = me.polls
        scheduler.wait(me, scheduler.deadline(me, timeout))
        if timeout is not None and timeout <= 0:
            me.polls = polls + 1
    finally:
        if not waiter.is_notified:
            try:
                self._waiters.remove(waiter)
            except ValueError:
                pass  # a thread outside of virtual time notifies it in this moment
        if not attempt():
            scheduler.restore_lock(me, attempt, lambda: _is_free(lock))
    return waiter.is_notified


def enter(self: Any) -> Any:
    """threading.Condition.__enter__: its lock may be older than virtual time."""
    lock = self._lock
    if type(lock) in _C_LOCKS:
        me = running.get(_get_ident())
        if me is not None and not lock.acquire(False) and not lock.acquire(True, _C_LOCK_S):
            me.scheduler.wait_for_lock(me, lambda: lock.acquire(False), lambda: _is_free(lock))
        if me is not None:
            return True
    return _real_enter(self)


# ---- Threads ----


def start(self: threading.Thread) -> None:
    """threading.Thread.start"""
    me = running.get(_get_ident())
    if me is None:
        _scheduler._real_start(self)
    else:
        me.scheduler.start(me, self)


def join(self: threading.Thread, timeout: Any = None) -> None:
    """threading.Thread.join"""
    me = running.get(_get_ident())
    if me is None:
        _scheduler._real_join(self, timeout)
    else:
        me.scheduler.join(me, self, timeout)


def is_alive(self: threading.Thread) -> bool:
    """threading.Thread.is_alive"""
    me = running.get(_get_ident())
    if me is not None:
        me.scheduler.settle(self)
    return _real_is_alive(self)


# ---- Selectors, and so asyncio ----


def _select(original: Callable[..., Any]) -> Callable[..., Any]:
    def select(self: Any, timeout: Any = None) -> Any:
        me = running.get(_get_ident())
        if me is None:
            return original(self, timeout)
        events = original(self, 0)
        if events:
            return events
        scheduler = me.scheduler
        if timeout is not None and timeout <= 0:
            scheduler.sleep(me, 0)
        else:
            scheduler.wait(me, scheduler.deadline(me, timeout), check=lambda: original(self, 0), is_outside=True)
        return original(self, 0)

    return select


def _in_real_time(original: Callable[..., Any]) -> Callable[..., Any]:
    @functools.wraps(original)
    def outside(*arguments: Any, **keywords: Any) -> Any:
        with RealTime():
            return original(*arguments, **keywords)

    return outside


class RealTime:
    """The calling participant has the real clock, and keeps the baton while it waits."""

    def __enter__(self) -> None:
        self._me = running.pop(_get_ident(), None)

    def __exit__(self, *_: object) -> None:
        if self._me is not None:
            running[self._me.ident] = self._me


_METHODS: List[Tuple[Any, str, Any]] = [
    (threading.Condition, "wait", wait),
    (threading.Condition, "__enter__", enter),
    (threading.Thread, "start", start),
    (threading.Thread, "join", join),
    (threading.Thread, "is_alive", is_alive),
    (subprocess.Popen, "wait", _in_real_time(subprocess.Popen.wait)),
    (subprocess.Popen, "communicate", _in_real_time(subprocess.Popen.communicate)),
]
for _name in ("SelectSelector", "_PollLikeSelector", "EpollSelector", "DevpollSelector", "KqueueSelector"):
    _class = getattr(selectors, _name, None)
    if _class is not None and "select" in vars(_class):
        _METHODS.append((_class, "select", _select(_class.select)))


# ---- In and out ----

_saved: List[Tuple[Any, str, Any]] = []


def _sweep(table: Dict[int, Any]) -> None:
    """Replaces the objects of a table in the namespaces of all modules."""
    for name, module in list(sys.modules.items()):
        if name.partition(".")[0] in _KEPT:
            continue
        namespace = getattr(module, "__dict__", None)
        if type(namespace) is not dict:
            continue
        for key, value in list(namespace.items()):
            if id(value) in table:
                namespace[key] = table[id(value)]


def _defaults(table: Dict[int, Any]) -> None:
    """sched.scheduler has the clock as default arguments."""
    function = sched.scheduler.__init__
    function.__defaults__ = tuple(table.get(id(value), value) for value in function.__defaults__ or ())


def install() -> None:
    """Begins to replace."""
    for owner, name, replacement in _METHODS:
        _saved.append((owner, name, vars(owner)[name]))
        setattr(owner, name, replacement)
    _defaults(_REPLACEMENTS)
    _sweep(_REPLACEMENTS)


def remove() -> None:
    """Ends it: also in modules that were loaded meanwhile."""
    while _saved:
        owner, name, original = _saved.pop()
        setattr(owner, name, original)
    _defaults(_ORIGINALS)
    _sweep(_ORIGINALS)


def current() -> Any:
    """The calling thread as a participant, or None."""
    me: Any = running.get(_get_ident())
    return me


__all__ = ["EPOCH_NS", "Participant", "RealTime", "current", "install", "remove"]
