"""A line in this process, in virtual time."""

from __future__ import annotations

import ctypes
import json
import threading
import time
import weakref
from array import array
from typing import Any, Callable, Dict, List, Optional, Sequence, Tuple

from . import _forks, _library
from ._backend import Backend, Recorder, Samples
from ._library import BAD_ARGUMENT, CLOSED, TICK_NS, Answer, Handle, call, error_of, text_of
from ._numpy import numpy
from .errors import BadValue, Diagnostic, NotInVirtualTime, diagnostics_of

_LONGEST_SLICE_NS = 1_000_000_000  # of line time
_SHORTEST_SLICE_NS = 8 * TICK_NS
_FIRST_SLICE_NS = 80 * TICK_NS
_FAST_S = 0.012  # a slice that takes less of the machine's time is followed by a longer one
_SLOW_S = 0.025  # and one that takes more by a shorter one
_ONE: Any = ctypes.c_size_t(1)
_TURN_S = 0.0001  # long enough for a thread that waits for the line to wake up
_PAUSE_TICKS = 16  # a millisecond


def _is_closed(*arguments: Any) -> int:
    return CLOSED


class LibraryRecorder(Recorder):
    """A recorder of the C library. After close() it has the samples."""

    def __init__(self, line: Handle, channels: Sequence[int], stride: int) -> None:
        c = _library.library()
        count = len(channels)
        number = ctypes.c_uint64()
        call(c.servodrome_recorder_open, line, (ctypes.c_uint32 * count)(*channels), count, stride, ctypes.byref(number))
        self._handle = Handle(number.value, c.servodrome_recorder_close)
        self._columns = count
        self._stride = stride
        self._kept: Optional[Samples] = None
        self._values = array("d")

    def samples(self) -> Samples:
        if self._kept is not None:
            return self._kept
        c = _library.library()
        rows = ctypes.c_uint64()
        first_tick = ctypes.c_int64()
        call(c.servodrome_recorder_rows, self._handle, ctypes.byref(rows), ctypes.byref(first_tick))
        count = rows.value
        values = array("d", bytes(8 * count * self._columns))
        if count:
            place = (ctypes.c_double * len(values)).from_buffer(values)
            call(c.servodrome_recorder_copy, self._handle, 0, count, place)
        return Samples(first_tick.value, self._stride, count, self._columns, values, False)

    def close(self) -> None:
        if self._kept is None and self._handle.is_open:
            self._kept = self.samples()
            self._handle.close()


class _Buffer(threading.local):
    """The buffer of a thread for the values of all axes."""

    values: Any = None
    view: Any = None


class InProcess(Backend):
    """A line of the C library."""

    is_real = False

    def __init__(self, text: Optional[bytes], name: str) -> None:
        self.handle = _library.open_line(text, text_of(name, "name"))
        c = _library.library()
        self._run_until: Callable[..., int] = c.servodrome_line_run_until
        self._own_run_until: Callable[..., int] = self._run_until
        self._run_ticks: Callable[..., int] = c.servodrome_line_run_ticks
        self._advance: Callable[..., int] = c.servodrome_line_advance
        # c["..."] has no types of arguments, so their conversion, half of a call's time, is left out: all are objects of ctypes.
        self._now: Callable[..., int] = c["servodrome_line_now"]
        self._read: Callable[..., int] = c["servodrome_read"]
        self._number = ctypes.c_uint64(self.handle.value)  # once it is closed, the C library says so
        # Threads share this place: C writes it with the line's lock held, so a thread reads its own time or a later one.
        self._time = ctypes.c_int64()
        self._to_time = ctypes.byref(self._time)
        self._slice_ns = _FIRST_SLICE_NS
        self._channels: Dict[Tuple[str, str], int] = {}
        self._numbers: Dict[Tuple[str, str], Tuple[Any, ctypes.c_double, Any]] = {}
        self._lock = threading.Lock()
        self._recorders: "weakref.WeakSet[LibraryRecorder]" = weakref.WeakSet()
        self._all_positions: Any = None
        self._buffer = _Buffer()
        text_of_warnings = ctypes.c_char_p()
        call(c.servodrome_line_warnings, self.handle, ctypes.byref(text_of_warnings))
        self.warnings: List[Diagnostic] = diagnostics_of(json.loads(text_of_warnings.value or b"[]"))
        _forks.register(self)

    def after_fork(self) -> None:
        self._run_until = self._own_run_until = self._run_ticks = self._advance = self._now = self._read = _is_closed

    def request(self, method: str, target: str, body: bytes = b"") -> Answer:
        return _library.request(self.handle, text_of(method, "method"), text_of(target, "path"), body)

    # ---- Time ----

    def now_ns(self) -> int:
        result = self._now(self._number, self._to_time)
        if result:
            raise error_of(result, self.handle)
        return self._time.value

    def run_until_ns(self, end: int) -> None:
        now = self.now_ns()
        if end < now:
            raise BadValue(f"{end / 1e9:g} s is in the past", "time", f"it is {now / 1e9:g} s; give a time from now on")
        self._run(now, end)

    def advance_ns(self, duration: int) -> None:
        if self._run_until is not self._own_run_until:  # virtual_time.py has put its own in this place: a wait of a thread
            self.run_until_ns(self.now_ns() + duration)
            return
        while duration > self._slice_ns:
            length = self._slice_ns
            begin = time.perf_counter()
            self._advance_at_once(length)
            self._after_slice(length, time.perf_counter() - begin)
            duration -= length
        self._advance_at_once(duration)

    def _advance_at_once(self, duration: int) -> None:
        result = self._advance(self._number, duration, None)
        if result:
            raise error_of(result, self.handle)

    def _run(self, now: int, end: int) -> None:
        """In slices, because Python handles Ctrl-C between two calls."""
        while True:
            length = self._slice_ns
            is_whole = end - now > length
            to = now + length if is_whole else end
            begin = time.perf_counter() if is_whole else 0.0
            result = self._run_until(self._number, to)
            if result:
                error = error_of(result, self.handle)
                if result != BAD_ARGUMENT or self.now_ns() < to:  # otherwise another thread has run the line further
                    raise error
            if not is_whole:
                return
            self._after_slice(length, time.perf_counter() - begin)
            now = to

    def _after_slice(self, length: int, took_s: float) -> None:
        """Adapts the next slice to the machine, and lets other threads use the line: its lock in C is not fair."""
        if took_s < _FAST_S:
            self._slice_ns = min(2 * length, _LONGEST_SLICE_NS)
        elif took_s > _SLOW_S:
            self._slice_ns = max(length // 2, _SHORTEST_SLICE_NS)
        if threading.active_count() > 1:
            time.sleep(_TURN_S)

    def run_ticks(self, ticks: int) -> None:
        length = self._slice_ns // TICK_NS
        while ticks > length:
            begin = time.perf_counter()
            self._ticks(length)
            self._after_slice(length * TICK_NS, time.perf_counter() - begin)
            ticks -= length
            length = self._slice_ns // TICK_NS
        self._ticks(ticks)

    def _ticks(self, ticks: int) -> None:
        result = self._run_ticks(self._number, ticks)
        if result:
            raise error_of(result, self.handle)

    def pause(self) -> None:
        self._ticks(_PAUSE_TICKS)

    # ---- Values ----

    def channel(self, axis: str, value: str) -> int:
        known = self._channels.get((axis, value))
        if known is None:
            channel = ctypes.c_uint32()
            function = _library.library().servodrome_channel
            call(function, self.handle, text_of(axis, "axis"), text_of(value, "signal"), ctypes.byref(channel))
            known = self._channels[axis, value] = channel.value
        return known

    def read(self, channels: Sequence[int]) -> List[float]:
        count = len(channels)
        values = (ctypes.c_double * count)()
        result = self._read(self._number, (ctypes.c_uint32 * count)(*channels), ctypes.c_size_t(count), values)
        if result:
            raise error_of(result, self.handle)
        return list(values)

    def number(self, axis: str, signal: str) -> float:
        known = self._numbers.get((axis, signal))
        if known is None:
            channel, place = ctypes.c_uint32(self.channel(axis, signal)), ctypes.c_double()
            known = self._numbers[axis, signal] = ctypes.byref(channel), place, ctypes.byref(place)
        to_channel, value, to_value = known
        result = self._read(self._number, to_channel, _ONE, to_value)
        if result:
            raise error_of(result, self.handle)
        return value.value

    def positions(self) -> Any:
        if self._all_positions is None:
            names = [axis["name"] for axis in self.json("GET", "axes")["axes"]]
            numbers = [self.channel(name, "position_counts") for name in names]
            self._all_positions = (ctypes.c_uint32 * len(numbers))(*numbers)
        channels = self._all_positions
        buffer = self._buffer
        if buffer.values is None:
            buffer.values = (ctypes.c_double * len(channels))()
            buffer.view = numpy("positions()").frombuffer(buffer.values)
        result = self._read(self._number, channels, ctypes.c_size_t(len(channels)), buffer.values)
        if result:
            raise error_of(result, self.handle)
        return buffer.view.astype("int64")

    def recorder(self, channels: Sequence[int], stride: int) -> Recorder:
        recorder = LibraryRecorder(self.handle, channels, stride)
        with self._lock:
            self._recorders.add(recorder)
        return recorder

    # ---- The rest ----

    def links(self, bus: str) -> List[str]:
        raise NotInVirtualTime(
            "a line in this process has no links to other programs",
            bus,
            'start it with clock="real", or open a port in this process',
        )

    def close(self) -> None:
        if self.handle.is_open:
            with self._lock:
                recorders = list(self._recorders)
            for recorder in recorders:
                recorder.close()
        self.handle.close()

    @property
    def is_open(self) -> bool:
        return self.handle.is_open
