"""Threads that run one at a time, in line time: the scheduler behind virtual_time.py.

A participant is a thread of the scheduler. Exactly one participant has the baton and runs; every other one waits in `Scheduler.wait`,
or is ready and waits for the baton. A participant gives the baton away only when it waits or ends. The choice of the next one depends on
nothing but the order of these calls and on the line, so that a program runs equally each time:

1. the participant that became ready first (it was notified, or it is new),
2. otherwise the line runs to the earliest deadline, or until a port has received something that a participant reads.

Each participant has a lock, its baton: it is locked while the participant waits, and released to let it run.
"""

from __future__ import annotations

import _thread
import ctypes
import heapq
import itertools
import sys
import threading
import time
from collections import deque
from types import FrameType
from typing import TYPE_CHECKING, Any, Callable, Deque, Dict, List, Optional, Tuple

from . import _forks
from ._library import NOTHING, TICK_NS, Handle, error_of, library
from .errors import Error

if TYPE_CHECKING:
    from .line import Line

_SLICE_NS = 250_000_000  # of line time: after each, Ctrl-C and other interrupts of the main thread are handled
_POLLS = 100  # readings of the clock, or waits of 0 s, in a row: then a tick passes, so that a loop that polls ends
_TURNS = 3  # of the others, at the end, before a participant gives up a lock that one of them holds
_REFUSALS = 1000  # waits that a thread tries after the end of virtual time, before it is left behind
_REAL_PAUSE_S = 0.001  # while only something outside of the line can go on: a file descriptor, another thread
_PAUSES = 1000  # for a lock that a thread outside may hold
_NEVER_NS = 2**63 - 1
_real_sleep = time.sleep  # this module is imported before anything is replaced
_real_start = threading.Thread.start
_real_join = threading.Thread.join


class VirtualDeadlock(Error):
    """All participants of virtual_time() wait, and nothing can ever wake one of them."""


class VirtualTimeEnded(SystemExit):
    """Ends a thread that still waits at the end of virtual_time(), silently."""


class Participant:
    """A thread in virtual time."""

    __slots__ = (
        "baton",
        "failure",
        "finished",
        "ident",
        "is_woken",
        "joiners",
        "polls",
        "refusals",
        "scheduler",
        "thread",
        "token",
    )

    def __init__(self, scheduler: "Scheduler", thread: threading.Thread) -> None:
        self.scheduler = scheduler
        self.thread = thread
        self.ident = 0
        self.baton = _thread.allocate_lock()
        self.baton.acquire()
        self.token = 0  # counts waits: a wake with an old token is void
        self.is_woken = False  # by a notification or a port, not by its deadline
        self.failure: Optional[BaseException] = None
        self.finished = False
        self.joiners: List[Waiter] = []
        self.polls = 0
        self.refusals = 0


running: Dict[int, Participant] = {}
"""The participants by the identifiers of their threads. A thread that is not here has the real clock."""


class Waiter:
    """A participant in a queue of waiting ones. Condition.notify() calls its `release`, as that of a waiting thread's lock."""

    __slots__ = ("is_notified", "participant", "token")

    def __init__(self, participant: Participant) -> None:
        self.participant = participant
        self.token = participant.token + 1  # that of the wait that follows
        self.is_notified = False

    def release(self) -> None:
        self.is_notified = True
        self.participant.scheduler.wake(self.participant, self.token)


class Scheduler:
    """The participants of one line."""

    disturb: Optional[Callable[[], None]] = None
    """A hook for tests: each participant calls it when it gets the baton."""

    def __init__(self, line: "Line") -> None:
        self.line = line
        self.depth = 0  # of nested virtual_time()
        self.ended = False
        self.owner = Participant(self, threading.current_thread())
        self.owner.ident = _thread.get_ident()
        self.members: List[Participant] = [self.owner]
        self._handle: Handle = line._handle
        c = library()
        self._line_now = c.servodrome_line_now
        self._line_wait = c.servodrome_line_wait
        self._now = ctypes.c_int64()
        self._to_now = ctypes.byref(self._now)
        self._index = ctypes.c_size_t()
        self._to_index = ctypes.byref(self._index)
        self._ready: Deque[Tuple[Participant, int]] = deque()
        self._timed: List[Tuple[int, int, Participant, int]] = []  # a heap of deadlines; entries with old tokens are void
        self._order = itertools.count()
        self._readers: Dict[Participant, int] = {}  # the ports that participants read, in the order in which they began to wait
        self._checks: Dict[Participant, Callable[[], Any]] = {}
        self._outside = 0  # the number of checks of things outside
        self._ports: Tuple[int, ...] = ()
        self._port_array: Any = None
        self._urgent: Optional[Participant] = None
        self._limit_ns = _NEVER_NS
        self._at_limit: Callable[[], None] = lambda: None
        _forks.register(self)

    def after_fork(self) -> None:
        running.clear()

    # ---- Time ----

    def now(self) -> int:
        """Line time in nanoseconds. After the line was closed: the time of its end."""
        self._line_now(self._handle.value, self._to_now)
        return self._now.value

    def clock(self, me: Participant) -> int:
        """Line time for a participant. A loop that only reads the clock lets a tick pass now and then."""
        me.polls += 1
        if me.polls >= _POLLS and not self.ended:
            self.wait(me, self.now() + TICK_NS)
        return self.now()

    def deadline(self, me: Participant, seconds: Optional[float]) -> Optional[int]:
        """The line time of a timeout that begins now; None: without one. A timeout of more than 0 takes at least 1 ns."""
        if seconds is None:
            return None
        if seconds > 0:
            return self.now() + max(1, round(seconds * 1e9))
        polls = me.polls + 1
        return self.now() + (TICK_NS if polls % _POLLS == 0 else 0)

    def sleep(self, me: Participant, seconds: float) -> None:
        """Waits; 0: until the other ready participants had their turn."""
        polls = me.polls
        self.wait(me, self.deadline(me, seconds))
        me.polls = 0 if seconds > 0 else polls + 1

    def set_limit(self, seconds: float, act: Callable[[], None]) -> None:
        """Calls `act` when every participant waits for a time later than in `seconds`. `act` ends the process: it does not return.

        The participant that ran last calls it, so no other one runs meanwhile. With a limit there is no VirtualDeadlock.
        """
        self._limit_ns = self.now() + round(seconds * 1e9)
        self._at_limit = act

    # ---- Waiting ----

    def wait(
        self,
        me: Participant,
        until: Optional[int],
        port: int = 0,
        check: Optional[Callable[[], Any]] = None,
        is_outside: bool = False,
    ) -> bool:
        """Waits until line time `until`, or until woken: by `wake`, by something to read at `port`, or by a true `check()`.

        `until` None: without a deadline. `check` is called whenever every participant waits; with `is_outside` it becomes true by
        something outside of the line. Returns False at the deadline.
        """
        if self.ended:
            self._refuse(me)
        me.token += 1
        me.polls = 0
        me.is_woken = False
        if until is not None:
            heapq.heappush(self._timed, (until, next(self._order), me, me.token))
        if port:
            self._readers[me] = port
        if check is not None:
            self._checks[me] = check
            self._outside += is_outside
        try:
            following = self._choose()
            if following is not me:
                following.baton.release()
                self._await_baton(me)
        finally:
            me.token += 1
            if port:
                self._readers.pop(me, None)
            if check is not None:
                self._checks.pop(me, None)
                self._outside -= is_outside
        if self.disturb is not None:
            self.disturb()
        if me.failure is not None:
            failure, me.failure = me.failure, None
            raise failure
        if self.ended:
            raise VirtualTimeEnded
        return me.is_woken

    def wake(self, participant: Participant, token: int) -> None:
        """Makes a waiting participant ready. Any thread may call it."""
        self._ready.append((participant, token))

    def wake_readers(self, port: int) -> None:
        """Wakes the participants that read a port, which is closed."""
        for participant, its in list(self._readers.items()):
            if its == port:
                self.wake(participant, participant.token)

    def wait_for_lock(self, me: Participant, attempt: Callable[[], bool], probe: Callable[[], bool]) -> None:
        """Waits until `attempt()` has taken a lock. `probe()` says from any participant whether that is worth trying."""
        while not attempt():
            self.wait(me, None, check=probe)

    def restore_lock(self, me: Participant, attempt: Callable[[], bool], probe: Callable[[], bool]) -> None:
        """As wait_for_lock, for a lock that its `with` statement will release: also at the end, when its present holder ends."""
        try:
            self.wait_for_lock(me, attempt, probe)
        except VirtualTimeEnded:
            for _ in range(_TURNS):
                if attempt():
                    break
                self.owner.baton.release()
                me.baton.acquire()
            raise

    def _await_baton(self, me: Participant) -> None:
        try:
            me.baton.acquire()
        except BaseException:  # a signal handler has raised it in the main thread, which does not have the baton
            self._urgent = me
            me.baton.acquire()
            self._urgent = None
            raise

    def _choose(self) -> Participant:
        """The participant to run next; lets line time pass until there is one."""
        ready, timed = self._ready, self._timed
        pauses = 0
        while True:
            if self._urgent is not None:
                return self._urgent
            while ready:
                participant, token = ready.popleft()
                if participant.token == token and not participant.finished:
                    participant.is_woken = True
                    return participant
            for participant, check in list(self._checks.items()):
                if check():
                    participant.is_woken = True
                    return participant
            while timed and timed[0][2].token != timed[0][3]:
                heapq.heappop(timed)
            if not timed and not self._readers and self._limit_ns == _NEVER_NS:
                if not self._outside and (not self._checks or pauses == _PAUSES):
                    return self._fail(VirtualDeadlock(*self._report()))
                pauses += 1
                _real_sleep(_REAL_PAUSE_S)
                continue
            now = self.now()
            end = max(now, min(now + _SLICE_NS, self._limit_ns))
            is_deadline = bool(timed) and timed[0][0] <= end
            if is_deadline:
                end = timed[0][0]
            result = self._run_line(end)
            if result == 0:
                participant = list(self._readers)[self._index.value]
                participant.is_woken = True
                return participant
            if result != NOTHING:
                return self._fail(error_of(result, self._handle))
            self._now.value = end
            if is_deadline:
                return heapq.heappop(timed)[2]
            if end >= self._limit_ns:
                self._at_limit()

    def _run_line(self, end: int) -> int:
        ports = tuple(self._readers.values())
        if ports != self._ports:
            self._ports = ports
            self._port_array = (ctypes.c_uint64 * len(ports))(*ports)
        result: int = self._line_wait(self._handle.value, end, self._port_array, len(ports), self._to_index)
        return result

    def _fail(self, failure: BaseException) -> Participant:
        """Raises an exception in the thread of virtual_time()."""
        self.owner.failure = failure
        return self.owner

    # ---- Threads ----

    def start(self, me: Participant, thread: threading.Thread) -> None:
        """Thread.start(): the new thread is ready, and runs when the others wait."""
        child = Participant(self, thread)
        thread._servodrome = child  # type: ignore[attr-defined]
        run = thread.run
        # Its first steps, up to run(), need no baton: they touch only what threading locks itself.
        thread.run = lambda: self._run(child, run)  # type: ignore[method-assign]
        del running[me.ident]
        try:
            _real_start(thread)
        except BaseException:
            thread.run = run  # type: ignore[method-assign]
            raise
        finally:
            running[me.ident] = me
        self.members.append(child)
        self.wake(child, child.token)

    def _run(self, me: Participant, run: Callable[[], None]) -> None:
        me.baton.acquire()
        me.ident = _thread.get_ident()
        running[me.ident] = me
        me.token += 1
        me.thread.run = run  # type: ignore[method-assign]
        try:
            if not self.ended:
                run()
        except VirtualTimeEnded:
            pass
        except BaseException:
            me.thread._invoke_excepthook(me.thread)  # type: ignore[attr-defined]
        finally:
            del running[me.ident]
            me.finished = True
            if me in self.members:
                self.members.remove(me)
            for waiter in me.joiners:
                waiter.release()
            (self.owner if self.ended else self._choose()).baton.release()

    def join(self, me: Participant, thread: threading.Thread, timeout: Optional[float]) -> None:
        """Thread.join()"""
        its = self._participant_of(thread)
        if its is not None and its is not me and not its.finished:
            waiter = Waiter(me)
            its.joiners.append(waiter)
            self.wait(me, self.deadline(me, None if timeout is None else max(timeout, 0)))
            if not its.finished:
                its.joiners.remove(waiter)
                return
        _real_join(thread)  # at once, for a participant: its thread ends without the baton

    def _participant_of(self, thread: threading.Thread) -> Optional[Participant]:
        its: Optional[Participant] = getattr(thread, "_servodrome", None)
        return its if its is not None and its.scheduler is self else None

    def settle(self, thread: threading.Thread) -> None:
        """Waits for the real end of a thread whose participant has finished."""
        its = self._participant_of(thread)
        if its is not None and its.finished and thread is not threading.current_thread():
            _real_join(thread)

    # ---- The end ----

    def end(self, is_regular: bool) -> None:
        """Ends all participants but the owner, which calls it. A regular end waits for threads that are not daemons."""
        me = self.owner
        workers: Any = getattr(sys.modules.get("concurrent.futures.thread"), "_threads_queues", ())
        try:
            for its in list(self.members) if is_regular else []:
                if its is not me and not its.thread.daemon and its.thread not in workers:
                    self.join(me, its.thread, None)
        finally:
            self.ended = True
            self._end_others(me)

    def _end_others(self, me: Participant) -> None:
        left = [its for its in self.members if its is not me]
        try:
            while len(self.members) > 1:
                for its in self.members[1:]:
                    its.baton.release()
                    me.baton.acquire()
        except BaseException:  # Ctrl-C: a thread does not wait. The others end without their turn.
            for its in self.members[1:]:
                if its.baton.locked():
                    its.baton.release()
            raise
        for its in left:
            if its.finished:
                _real_join(its.thread)

    def _refuse(self, me: Participant) -> None:
        """A wait after the end of virtual time."""
        if me.finished or me is self.owner:
            return
        me.refusals += 1
        if me.refusals > _REFUSALS and me in self.members:  # it catches the exception, and waits again and again
            self.members.remove(me)
            self.owner.baton.release()
            me.baton.acquire()  # for ever
        raise VirtualTimeEnded

    # ---- Reports ----

    def _report(self) -> Tuple[str, str, str]:
        frames = sys._current_frames()
        lines = [f"{its.thread.name}: {_place(frames.get(its.ident))}" for its in self.members]
        what = "every thread waits, and nothing can wake one:\n  " + "\n  ".join(lines) + "\n"
        return what, "virtual_time", "give a wait a timeout, or start what ends it inside of virtual_time()"


_OWN = ("_scheduler.py", "_patches.py", "_locks.py", "_ports.py", "virtual_time.py", "threading.py", "queue.py")


def _place(frame: Optional[FrameType]) -> str:
    """What a thread waits for, and where: "get of queue.py, at main.py:12"."""
    waits_in = "not started"
    while frame is not None:
        file = frame.f_code.co_filename.replace("\\", "/").rpartition("/")[2]
        if file not in _OWN:
            return f"{waits_in}, at {file}:{frame.f_lineno} in {frame.f_code.co_name}"
        waits_in = getattr(frame.f_code, "co_qualname", frame.f_code.co_name).replace("_Clock", "time")
        frame = frame.f_back
    return waits_in
