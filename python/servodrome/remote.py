"""A line in real time: the program `servodrome up`, and its bench API over HTTP."""

from __future__ import annotations

import contextlib
import http.client
import os
import shutil
import struct
import tempfile
import threading
import time
import warnings
import weakref
from array import array
from typing import Any, Dict, List, Mapping, Optional, Sequence, Tuple, Union
from urllib.parse import urlsplit

from . import _forks
from ._backend import TICKS_PER_SECOND, Backend, Recorder, Samples, path, ticks_of
from ._in_process import InProcess
from ._library import Answer
from ._numpy import numpy
from .errors import BadValue, Diagnostic, Error, LineFileError, NotInRealTime, ProgramError, Refused, UnknownName, closed
from .program import Program, program_path

_TIMEOUT_S = 60.0  # for an answer
_IDLE_S = 30.0  # the server closes a connection after 60 s without a request
_POLL_S = 0.005
_MOST_VALUES = 1 << 20  # of a recording: half of what the program allows for one, so that there may be several
_MOST_CHANNELS = 16  # of a recording
_LONGEST_MS = 3_600_000
_HEAD = struct.Struct("<IIQII")  # of binary samples: docs/bench-api.md, "Stream"

_LINKS = {
    "can": lambda name, folder: [f"socketcand:127.0.0.1:0/{name}"],
    "ethercat": lambda name, folder: ["udp:127.0.0.1:0"],
    "rs485": lambda name, folder: [f"pty:{folder}/{name}", "tcp:127.0.0.1:0"],
}


class Http:
    """One connection with keep-alive. Thread-safe: a request waits for the previous one."""

    def __init__(self, url: str, token: str) -> None:
        self._host = urlsplit(url).netloc
        self._token = token
        self._lock = threading.Lock()
        self._connection: Optional[http.client.HTTPConnection] = None
        self._used = 0.0

    def request(self, method: str, target: str, body: bytes) -> Answer:
        """Raises OSError or HTTPException if there is no answer."""
        with self._lock:
            if self._connection is None or time.monotonic() - self._used > _IDLE_S:
                self._drop()
                self._connection = http.client.HTTPConnection(self._host, timeout=_TIMEOUT_S)
            try:
                headers = {"Authorization": f"Bearer {self._token}", "Content-Type": "application/json"}
                self._connection.request(method, target, body or None, headers)
                response = self._connection.getresponse()
                answer = Answer(response.status, response.headers.get("Content-Type", ""), response.read())
            except BaseException:  # also Ctrl-C: the rest of the answer must not become that of the next request
                self._drop()
                raise
            self._used = time.monotonic()
            return answer

    def _drop(self) -> None:
        if self._connection is not None:
            self._connection.close()
            self._connection = None

    def close(self) -> None:
        """Closes the connection."""
        with self._lock:
            self._drop()

    def forget(self) -> None:
        """In a forked child: closes the descriptor, without the lock."""
        self._drop()

    def __del__(self) -> None:
        self._drop()


class RemoteRecorder(Recorder):
    """A recording of the program."""

    def __init__(self, line: "Remote", channels: Sequence[int], stride: int) -> None:
        rate = TICKS_PER_SECOND / stride
        if TICKS_PER_SECOND % stride:
            raise BadValue(
                f"{rate:g} Hz in real time", "rate", "give a divider of 16000: 16000, 8000, 4000, 3200, 2000, 1000 ..."
            )
        self._line = line
        duration = min(_LONGEST_MS, _MOST_VALUES // len(channels) * 1000 // rate)
        self._id = line.start_recording(channels, rate, duration)
        self._kept: Optional[Samples] = None

    def samples(self) -> Samples:
        if self._kept is None:
            raise Refused(
                "the recording has not ended", "recording", "stop() it first; in real time its values are in the program"
            )
        return self._kept

    def close(self) -> None:
        if self._kept is None:
            self._wait_for_ticks(ticks_of(self._line.now_ns()))
            view = self._line.json("POST", path("recordings", self._id, "stop"))
            self._kept = self._line.take_recording(self._id, view["state"] == "done")
            if self._kept.full:
                text = f"the recording was full after {self._kept.rows} samples; choose a lower rate, or less time or signals"
                warnings.warn(text, RuntimeWarning, stacklevel=3)

    def _wait_for_ticks(self, tick: int) -> None:
        """Until the recording has the samples up to a tick: the program takes them each 10 ms."""
        while True:
            view = self._line.json("GET", path("recordings", self._id))
            if view["state"] == "done" or view["samples"] * view["stride"] + (view["first_tick"] or 0) > tick:
                return
            self._line.pause()


class Remote(Backend):
    """A line of the program."""

    is_real = True

    def __init__(
        self,
        text: Optional[bytes],
        name: str,
        file: Optional[str],
        program: "Union[str, os.PathLike[str], None]",
        links: Mapping[str, Union[str, Sequence[str]]],
    ) -> None:
        self._was_forked = False
        self._program: Optional[Program] = None
        executable = program_path(program)
        folder = tempfile.mkdtemp(prefix="servodrome-")
        written: Optional[str] = None
        try:
            self.warnings, buses = _parse(text, name, name if os.path.dirname(name) else os.path.join(folder, name))
            _check_links(links, [bus["name"] for bus in buses])
            if text is not None and file is None:
                file = written = _write(text, os.path.dirname(name) or folder)
            arguments = [] if file is None else [file]
            for bus in buses:
                wanted = links.get(bus["name"]) or _LINKS[bus["type"]](bus["name"], folder)
                for link in [wanted] if isinstance(wanted, str) else wanted:
                    arguments += ["--bus", f"{bus['name']}={link}"]
            self._program = Program(executable, arguments, folder)
        except BaseException:
            shutil.rmtree(folder, ignore_errors=True)
            raise
        finally:
            if written is not None:
                with contextlib.suppress(FileNotFoundError):
                    os.unlink(written)
        ready = self._program.ready
        self._http = Http(ready["api"], ready["token"])
        self._links: Dict[str, List[str]] = {bus["name"]: list(bus["links"]) for bus in ready["buses"]}
        self._channels: List[Dict[str, str]] = []
        self._channel_numbers: Dict[Tuple[str, str], int] = {}
        self._lock = threading.Lock()
        self._recorders: "weakref.WeakSet[RemoteRecorder]" = weakref.WeakSet()
        _forks.register(self)

    # ---- Requests ----

    def request(self, method: str, target: str, body: bytes = b"") -> Answer:
        program = self._running()
        try:
            return self._http.request(method, target, body)
        except (OSError, http.client.HTTPException) as error:
            self._running()
            time.sleep(_POLL_S)  # a program that has just ended closes its sockets first
            program.check()
            raise ProgramError(f"no answer: {error or type(error).__name__}", "bench API", "see the cause") from error

    def _running(self) -> Program:
        program = self._program
        if program is None:
            raise _forks.forked() if self._was_forked else closed()
        return program

    # ---- Time ----

    def now_ns(self) -> int:
        return int(self.json("GET", "clock")["time_ns"])

    def run_until_ns(self, end: int) -> None:
        now = self.now_ns()
        if end < now:
            raise BadValue(f"{end / 1e9:g} s is in the past", "time", f"it is {now / 1e9:g} s; give a time from now on")
        while now < end:
            time.sleep((end - now) / 1e9)
            now = self.now_ns()

    def advance_ns(self, duration: int) -> None:
        program = self._running()
        time.sleep(duration / 1e9)
        program.check()

    def run_ticks(self, ticks: int) -> None:
        raise NotInRealTime("ticks pass by themselves", "line", "use advance() or run_until()")

    def pause(self) -> None:
        time.sleep(_POLL_S)

    # ---- Values ----

    def channel(self, axis: str, value: str) -> int:
        known = self._channel_numbers.get((axis, value))
        if known is not None:
            return known
        one = {"axis": axis, "object" if ":" in value else "signal": value}
        try:  # the program checks the name
            recording = self.json("POST", "recordings", {"channels": [one], "duration_ms": 0})
        except (UnknownName, BadValue) as error:
            raise UnknownName(error.what, error.where, error.hint) from None
        self.json("DELETE", path("recordings", recording["id"]))
        with self._lock:
            number = len(self._channels)
            self._channels.append(one)
            self._channel_numbers[axis, value] = number
        return number

    def start_recording(self, channels: Sequence[int], rate: float, duration_ms: float) -> int:
        """Begins a recording of the program."""
        wanted = [self._channels[channel] for channel in channels]
        body = {"name": "python", "channels": wanted, "rate_hz": rate, "duration_ms": duration_ms}
        return int(self.json("POST", "recordings", body)["id"])

    def take_recording(self, number: int, full: bool) -> Samples:
        """The samples of a recording that has ended; the program deletes it."""
        data = self.content(path("recordings", number, "data"))
        self.json("DELETE", path("recordings", number))
        _, stride, first_tick, rows, columns = _HEAD.unpack_from(data)
        by_channel = array("d", data[_HEAD.size :])
        values = array("d", bytes(8 * rows * columns))
        for column in range(columns):
            values[column::columns] = by_channel[column * rows : (column + 1) * rows]
        return Samples(first_tick, stride, rows, columns, values, full)

    def read(self, channels: Sequence[int]) -> List[float]:
        """A recording of one sample: so every signal can be read, and all at one instant (of 16 signals)."""
        values: List[float] = []
        for at in range(0, len(channels), _MOST_CHANNELS):
            number = self.start_recording(channels[at : at + _MOST_CHANNELS], TICKS_PER_SECOND, 0)
            address = path("recordings", number)
            while self.json("GET", address)["state"] != "done":
                time.sleep(0.0005)
            values += self.take_recording(number, False).values
        return values

    def number(self, axis: str, signal: str) -> float:
        return float(self.json("GET", path("axes", axis))[signal])

    def positions(self) -> Any:
        counts = [axis["position_counts"] for axis in self.json("GET", "axes")["axes"]]
        return numpy("positions()").array(counts, dtype="int64")

    def recorder(self, channels: Sequence[int], stride: int) -> Recorder:
        recorder = RemoteRecorder(self, channels, stride)
        with self._lock:
            self._recorders.add(recorder)
        return recorder

    # ---- The rest ----

    def links(self, bus: str) -> List[str]:
        self._running()
        return list(self._links[bus])

    def close(self) -> None:
        program, http_connection = self._program, self._http
        if program is None:
            return
        with self._lock:
            recorders = list(self._recorders)
        for recorder in recorders:
            try:
                recorder.close()
            except Error:  # the program has ended
                break
        self._program = None
        program.end()
        http_connection.close()

    @property
    def is_open(self) -> bool:
        return self._program is not None

    def after_fork(self) -> None:
        program, self._program = self._program, None
        if program is None:
            return
        self._was_forked = True
        self._http.forget()
        program.forget()


def _parse(text: Optional[bytes], name: str, place: str) -> Tuple[List[Diagnostic], List[Dict[str, Any]]]:
    """The warnings and the buses of a line file at `place`. The parser of the C library has the places of its errors."""

    def named(diagnostics: Sequence[Diagnostic]) -> List[Diagnostic]:
        return [one._replace(file=name) if one.file == place else one for one in diagnostics]

    try:
        line = InProcess(text, place)
    except LineFileError as error:
        raise LineFileError(named(error.diagnostics)) from None
    try:
        buses: List[Dict[str, Any]] = line.json("GET", "buses")["buses"]
        return named(line.warnings), buses
    finally:
        line.close()


def _write(text: bytes, folder: str) -> str:
    """The text as a file in the folder at which relative paths in it start."""
    handle, file = tempfile.mkstemp(prefix=".line-", suffix=".toml", dir=folder)
    with os.fdopen(handle, "wb") as opened:
        opened.write(text)
    return file


def _check_links(links: Mapping[str, Union[str, Sequence[str]]], buses: Sequence[str]) -> None:
    for name in links:
        if name not in buses:
            raise UnknownName(f'there is no bus "{name}"', "links", f"the line has {', '.join(buses)}")
