"""The C library (src/capi/servodrome.h), loaded with ctypes.

How to call it from another module of this package:

    from ._library import Handle, call, library

    c = library()                                   # loads the library at the first call
    number = ctypes.c_uint64()
    call(c.servodrome_can_open, line._handle, b"can0", ctypes.byref(number))
    port = Handle(number.value, c.servodrome_port_close)
    frame = CanFrame(id=0x602, length=8, ...)
    call(c.servodrome_can_send, port, ctypes.byref(frame))
    if call(c.servodrome_can_receive, port, 0, ctypes.byref(frame)) == NOTHING: ...
    port.close()                                    # idempotent; also when the Handle is collected

- Pass a `Handle` where the C function takes a handle, as its first argument. Text is bytes (UTF-8).
- `call` returns OK or NOTHING, and raises the exception of errors.py for a negative result.
- Where 200 ns count, call the C function itself: `result = function(handle.value, ...)`, then `if result < 0: raise
  error_of(result, handle)`. `handle.value` is 0, which is never valid, once it is closed or the process was forked. After a
  fork do not call the library with it (_forks.register; `_in_process.py` does so).
- ctypes releases the GIL during a call. A call that advances the line by a long time must do so in pieces (at most some 50
  ms of the machine's time), because Python handles Ctrl-C only between two calls; `Line.run_until` does.
- In real time a line has no handle: `Line._handle` raises NotInRealTime.
"""

from __future__ import annotations

import _thread
import ctypes
import json
import os
import pathlib
import sys
import threading
from typing import Any, Callable, Dict, List, NamedTuple, Optional, Tuple, Type

from . import _forks
from .errors import (
    BadValue,
    Error,
    LibraryError,
    LineFileError,
    Refused,
    UnknownName,
    WrongType,
    closed,
    diagnostics_of,
)

OK = 0
NOTHING = 1
CLOSED = -1
BAD_ARGUMENT = -2
BAD_LINE = -3
UNKNOWN = -4
REFUSED = -5
FAILED = -6

TICK_NS = 62_500
"""A tick in nanoseconds: the step of drives and machines."""

LONGEST_NS = 3_600_000_000_000
"""The longest time by which one call may advance a line: an hour."""

INTERFACE = 1
"""The version of the header for which this module is written."""


class CanFrame(ctypes.Structure):
    """struct servodrome_can_frame"""

    time_ns: int
    id: int
    extended: int
    remote: int
    length: int
    lost: int
    data: Any

    _fields_ = [
        ("time_ns", ctypes.c_int64),
        ("id", ctypes.c_uint32),
        ("extended", ctypes.c_uint8),
        ("remote", ctypes.c_uint8),
        ("length", ctypes.c_uint8),
        ("lost", ctypes.c_uint8),
        ("data", ctypes.c_uint8 * 8),
    ]


class _Answer(ctypes.Structure):
    """struct servodrome_answer"""

    status: int
    content_type: Optional[bytes]
    body: Optional[int]
    size: int

    _fields_ = [
        ("status", ctypes.c_uint),
        ("content_type", ctypes.c_char_p),
        ("body", ctypes.c_void_p),
        ("size", ctypes.c_size_t),
    ]


_handle = ctypes.c_uint64
_time = ctypes.c_int64
_text = ctypes.c_char_p
_size = ctypes.c_size_t
_bytes = ctypes.c_char_p  # takes bytes without a copy, and a buffer by ctypes.cast or ctypes.c_char * n
_to = ctypes.POINTER

# Functions that return a result, with the types of their arguments.
_SIGNATURES: Dict[str, List[Any]] = {
    "servodrome_line_open": [_text, _size, _text, _to(_handle)],
    "servodrome_line_close": [_handle],
    "servodrome_line_warnings": [_handle, _to(_text)],
    "servodrome_line_now": [_handle, _to(_time)],
    "servodrome_line_run_until": [_handle, _time],
    "servodrome_line_advance": [_handle, _time, _to(_time)],
    "servodrome_line_run_ticks": [_handle, _time],
    "servodrome_line_wait": [_handle, _time, _to(_handle), _size, _to(_size)],
    "servodrome_line_request": [_handle, _text, _text, _bytes, _size, _to(_Answer)],
    "servodrome_channel": [_handle, _text, _text, _to(ctypes.c_uint32)],
    "servodrome_read": [_handle, _to(ctypes.c_uint32), _size, _to(ctypes.c_double)],
    "servodrome_recorder_open": [_handle, _to(ctypes.c_uint32), _size, ctypes.c_int64, _to(_handle)],
    "servodrome_recorder_rows": [_handle, _to(ctypes.c_uint64), _to(ctypes.c_int64)],
    "servodrome_recorder_copy": [_handle, ctypes.c_uint64, ctypes.c_uint64, _to(ctypes.c_double)],
    "servodrome_recorder_close": [_handle],
    "servodrome_port_close": [_handle],
    "servodrome_can_open": [_handle, _text, _to(_handle)],
    "servodrome_can_send": [_handle, _to(CanFrame)],
    "servodrome_can_receive": [_handle, _time, _to(CanFrame)],
    "servodrome_can_state": [_handle, _to(ctypes.c_uint)],
    "servodrome_serial_open": [_handle, _text, _to(_handle)],
    "servodrome_serial_configure": [_handle, ctypes.c_uint32, ctypes.c_uint, ctypes.c_char, ctypes.c_uint],
    "servodrome_serial_send": [_handle, _bytes, _size],
    "servodrome_serial_receive": [_handle, _time, _bytes, _size, _to(_size)],
    "servodrome_ethercat_open": [_handle, _text, ctypes.c_int, _to(_handle)],
    "servodrome_ethercat_send": [_handle, _bytes, _size],
    "servodrome_ethercat_receive": [_handle, _time, _bytes, _size, _to(_size)],
}


def library_path() -> str:
    """The library's file: $SERVODROME_LIBRARY, or `_lib/libservodrome.so` (Windows: servodrome.dll) beside this module."""
    name = "servodrome.dll" if sys.platform == "win32" else "libservodrome.so"
    return os.environ.get("SERVODROME_LIBRARY") or str(pathlib.Path(__file__).parent / "_lib" / name)


def _load() -> ctypes.CDLL:
    path = library_path()
    try:
        loaded = ctypes.CDLL(path)
        version = loaded.servodrome_interface()
        functions = {name: getattr(loaded, name) for name in _SIGNATURES}
    except (OSError, AttributeError) as error:
        hint = "set SERVODROME_LIBRARY to the built libservodrome.so, or install the package's wheel"
        raise LibraryError(f"the C library cannot be loaded: {error}", path, hint) from error
    if version != INTERFACE:
        hint = "use the library of the same release as this package"
        raise LibraryError(f"the C library has interface {version}, this package needs {INTERFACE}", path, hint)
    loaded.servodrome_version.restype = ctypes.c_char_p
    loaded.servodrome_version.argtypes = []
    loaded.servodrome_last_error.restype = ctypes.c_char_p
    loaded.servodrome_last_error.argtypes = []
    for name, arguments in _SIGNATURES.items():
        functions[name].restype = ctypes.c_int
        functions[name].argtypes = arguments
    return loaded


_loaded: Optional[ctypes.CDLL] = None


def library() -> ctypes.CDLL:
    """The C library. Its functions are attributes with the names of the header. Raises LibraryError."""
    global _loaded
    if _loaded is None:
        _loaded = _load()
    return _loaded


class Handle:
    """A handle of the C library, until it is closed. Thread-safe without a lock: a second close is harmless in C."""

    __slots__ = ("__weakref__", "_as_parameter_", "_close", "_was_forked", "value")

    value: int

    def __init__(self, value: int, close: Callable[[int], int]) -> None:
        """`close` is the C function that closes it."""
        self.value = value
        self._as_parameter_ = value
        self._close = close
        self._was_forked = False
        _forks.register(self)

    def close(self) -> None:
        """Closes it; once more does nothing."""
        value, self.value = self.value, 0
        self._as_parameter_ = 0
        if value:
            self._close(value)

    @property
    def is_open(self) -> bool:
        """False after close() and after a fork. A handle of a line that was closed still counts as open."""
        return self.value != 0

    def after_fork(self) -> None:
        self._was_forked = self.value != 0
        self.value = 0
        self._as_parameter_ = 0

    def error(self) -> Error:
        """The exception for the use of this handle after its end."""
        if self._was_forked:
            return _forks.forked()
        return closed()

    def __del__(self) -> None:
        self.close()


_CLASSES: Dict[int, Type[Error]] = {BAD_ARGUMENT: BadValue, UNKNOWN: UnknownName, REFUSED: Refused, FAILED: Error}


def error_of(result: int, handle: Optional[Handle] = None) -> Error:
    """The exception for a negative result of the latest call in this thread; `handle` was its first argument."""
    if result == CLOSED and handle is not None:
        return handle.error()
    reason: Dict[str, Any] = json.loads(library().servodrome_last_error() or b"{}")
    if result == BAD_LINE and reason.get("diagnostics"):
        return LineFileError(diagnostics_of(reason["diagnostics"]))
    what = reason.get("what") or f"the C library fails with {result}"
    return _CLASSES.get(result, Error)(what, reason.get("where", ""), reason.get("hint", ""))


def call(function: Callable[..., int], *arguments: Any) -> int:
    """Calls a function of the library that returns a result: OK or NOTHING. Raises the exception for a negative one."""
    first = arguments[0] if arguments else None
    handle = first if isinstance(first, Handle) else None
    if handle is not None and not handle.is_open:
        raise handle.error()  # not by the library: after a fork its locks are those of the parent's threads
    result = function(*arguments)
    if result < 0:
        raise error_of(result, handle)
    return result


def version() -> str:
    """The version of the C library, such as "0.1.0"."""
    text: bytes = library().servodrome_version()
    return text.decode()


def file_bytes(text: str) -> bytes:
    """A line file's text as it is in a file. A character that UTF-8 does not have becomes bytes that the parser refuses, with
    their place."""
    try:
        return text.encode("utf-8", "surrogateescape")
    except UnicodeEncodeError:
        return text.encode("utf-8", "surrogatepass")


def text_of(value: Any, name: str) -> bytes:
    """A text for the C library: UTF-8 without a zero. Raises WrongType, BadValue; `name` says which text it is."""
    if not isinstance(value, str):
        raise WrongType(f"{name} is of type {type(value).__name__}", name, "give a text")
    try:
        encoded = value.encode("utf-8", "surrogateescape")  # bytes of file names that are no UTF-8 stay what they are
    except UnicodeEncodeError:
        raise BadValue(f"{name} has a character that is no text: {value!r}", name, "give a text of Unicode characters") from None
    if b"\0" in encoded:
        raise BadValue(f"{name} has a zero character: {value!r}", name, "give a text without it")
    return encoded


def open_line(text: Optional[bytes], name: bytes) -> Handle:
    """A line from the text of a line file; None: the built-in line. Raises LineFileError."""
    c = library()
    number = ctypes.c_uint64()
    call(c.servodrome_line_open, text, 0 if text is None else len(text), None if text is None else name, ctypes.byref(number))
    return Handle(number.value, c.servodrome_line_close)


class Answer(NamedTuple):
    """An answer of the bench API."""

    status: int
    content_type: str
    body: bytes


class _Busy(threading.local):
    is_requesting = False


_busy = _Busy()


def _request(handle: Handle, method: bytes, target: bytes, body: bytes) -> Answer:
    answer = _Answer()
    call(library().servodrome_line_request, handle, method, target, body, len(body), ctypes.byref(answer))
    text = ctypes.string_at(answer.body, answer.size) if answer.body and answer.size else b""
    return Answer(answer.status, (answer.content_type or b"").decode(), text)


def request(handle: Handle, method: bytes, target: bytes, body: bytes = b"") -> Answer:
    """A request of the bench API, `target` is the path with its query.

    The answer in C is valid until the next request of this thread. A signal handler, or a finalizer of the garbage
    collector, may make a request before the answer has been copied, so such a request gets a thread of its own.
    """
    if _busy.is_requesting:
        return _in_thread(lambda: _request(handle, method, target, body))
    try:
        _busy.is_requesting = True
        return _request(handle, method, target, body)
    finally:
        _busy.is_requesting = False


def _in_thread(act: Callable[[], Answer]) -> Answer:
    """Without the class threading.Thread: a signal handler must not wait for its locks."""
    results: List[Tuple[Optional[Answer], Optional[BaseException]]] = []
    running = _thread.allocate_lock()
    running.acquire()

    def run() -> None:
        try:
            results.append((act(), None))
        except BaseException as error:
            results.append((None, error))
        finally:
            running.release()

    _thread.start_new_thread(run, ())
    running.acquire()
    answer, error = results[0]
    if answer is None:
        raise error if error is not None else RuntimeError("no answer")
    return answer
