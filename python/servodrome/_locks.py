"""Locks and queues that participants of virtual_time() make: a participant that waits for one lets the others run.

They work for other threads as well, also after the end of virtual time, so an object that a participant made may be used anywhere.
"""

from __future__ import annotations

import _thread
import queue
import threading
from collections import deque
from typing import Any, Deque

from ._scheduler import Waiter, running

_real_lock: Any = _thread.allocate_lock
_real_rlock: Any = threading.RLock
_real_simple_queue: Any = queue.SimpleQueue
_get_ident = _thread.get_ident
_FOREIGN_S = 1.0  # a thread outside of virtual time holds a lock for a moment only


class VirtualLock:
    """In place of threading.Lock. It is fair: release() hands it to the participant that has waited longest."""

    __slots__ = ("__weakref__", "_holder", "_lock", "_waiters")

    _holder: int
    _lock: Any
    _waiters: Deque[Waiter]

    def __new__(cls) -> Any:
        if _get_ident() not in running:
            return _real_lock()
        self = object.__new__(cls)
        self._lock = _real_lock()
        self._holder = 0  # a thread
        self._waiters = deque()
        return self

    def acquire(self, blocking: bool = True, timeout: float = -1) -> bool:
        lock = self._lock
        if timeout != -1 and (timeout < 0 or not blocking):
            return bool(lock.acquire(blocking, timeout))  # it has the error
        ident = _get_ident()
        if lock.acquire(False):
            self._holder = ident
            return True
        if not blocking:
            return False
        me = running.get(ident)
        if me is None or self._holder not in running:
            if lock.acquire(True, timeout if me is None else _FOREIGN_S):
                self._holder = ident
                return True
            if me is None:
                return False
        scheduler = me.scheduler
        waiter = Waiter(me)
        self._waiters.append(waiter)
        try:
            scheduler.wait(me, None if timeout < 0 else scheduler.deadline(me, timeout))
        except BaseException:
            if waiter.is_notified:
                self.release()
            raise
        finally:
            if not waiter.is_notified:
                self._waiters.remove(waiter)
        return waiter.is_notified

    __enter__ = acquire

    def release(self) -> None:
        if self._waiters:
            waiter = self._waiters.popleft()
            self._holder = waiter.participant.ident
            waiter.release()
        else:
            self._holder = 0
            self._lock.release()

    def __exit__(self, *_: object) -> None:
        self.release()

    def locked(self) -> bool:
        return bool(self._lock.locked())

    def _at_fork_reinit(self) -> None:
        self._lock._at_fork_reinit()
        self._waiters.clear()

    def __repr__(self) -> str:
        return f"<{'locked' if self.locked() else 'unlocked'} VirtualLock at {id(self):#x}>"


class AllocatedLock(VirtualLock):
    """In place of _thread.allocate_lock, where that is not threading.Lock. Each replacement has one original."""

    __slots__ = ()


class VirtualRLock:
    """In place of threading.RLock. A participant's is that of the standard library in Python, which is made of a Lock."""

    def __new__(cls, *arguments: Any, **keywords: Any) -> Any:
        if _get_ident() in running:
            return threading._PyRLock(*arguments, **keywords)  # type: ignore[attr-defined]
        return _real_rlock(*arguments, **keywords)


class VirtualSimpleQueue:
    """In place of queue.SimpleQueue. A participant's is that of the standard library in Python, which is made of a Semaphore."""

    def __new__(cls) -> Any:
        if _get_ident() in running:
            return queue._PySimpleQueue()  # type: ignore[attr-defined]
        return _real_simple_queue()

    def __class_getitem__(cls, item: Any) -> Any:
        return _real_simple_queue[item]
