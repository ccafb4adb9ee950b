"""A line of axes and buses, with its time."""

from __future__ import annotations

import os
from types import TracebackType
from typing import TYPE_CHECKING, Any, Callable, Dict, Iterator, List, Mapping, Optional, Sequence, Type, TypeVar, Union

from . import _open_lines
from ._backend import LONGEST_S, NS_PER_SECOND, Backend, nanoseconds, stride_of, ticks_of, whole
from ._backend import seconds as checked_seconds
from ._in_process import InProcess
from ._library import Handle, file_bytes
from .axis import LiveAxis
from .bus import LiveBus
from .errors import BadValue, Diagnostic, LineFileError, NotInRealTime, UnknownName, WrongType
from .recording import Path, Recording
from .scenario import Scenario
from .signals import Signal
from .tables import Axis, Bus, line_text

if TYPE_CHECKING:
    from .ethercat import EthercatPort
    from .virtual_time import virtual_time
    import numpy as np
    from numpy.typing import NDArray

T = TypeVar("T")
Item = TypeVar("Item")
Links = Mapping[str, Union[str, Sequence[str]]]

_LONGEST_TICKS = 2**46  # some 139 years


class _Named(Mapping[str, Item]):
    """The axes or buses of a line by their names, in the order of the line file."""

    def __init__(self, what: str, items: Dict[str, Item]) -> None:
        self._what = what
        self._items = items

    def __getitem__(self, name: str) -> Item:
        try:
            return self._items[name]
        except (KeyError, TypeError):
            names = ", ".join(self._items)
            raise UnknownName(f"there is no {self._what} {name!r}", "line", f"the line has {names}") from None

    def __iter__(self) -> Iterator[str]:
        return iter(self._items)

    def __len__(self) -> int:
        return len(self._items)

    def __repr__(self) -> str:
        return repr(list(self._items))


class Line:
    """A running line: `Line()` is the built-in line of five drives, `Line(axes=[Axis("x", "jmc_ec")])` one without a file.

    `clock="virtual"`: the line is in this process, and its time passes only in calls that say so, as fast as the processor
    allows; equal calls give equal results to the last bit. `clock="real"`: the program `servodrome up` runs it as a child
    process on free ports; `bus.link` is what masters connect to. `program` is that program (default: $SERVODROME, the one
    of the package, or the one in PATH), and `links` replaces the links of buses: {"can0": "socketcan:vcan0"}.

    A line is usable from several threads. It ends at close(), at the end of its `with` block, or when it is collected; a
    child of `os.fork` cannot use it (Forked). Times are seconds of line time, 0 at its start; a tick is 62.5 us.

    Raises LineFileError with all errors of the description, LibraryError, ProgramError.
    """

    axes: Mapping[str, LiveAxis]
    buses: Mapping[str, LiveBus]

    def __init__(
        self,
        axes: Optional[Sequence[Axis]] = None,
        buses: Sequence[Bus] = (),
        *,
        clock: str = "virtual",
        program: Optional[Path] = None,
        links: Optional[Links] = None,
    ) -> None:
        _check_clock(clock)
        if axes is None and buses:
            raise WrongType("buses without axes", "Line", "give axes=[servodrome.Axis(...)] as well")
        text = None if axes is None else file_bytes(line_text(axes, buses))
        name = "line.toml" if text is not None else "default.toml"
        self._begin(text, name, None, clock, program, links)

    @classmethod
    def from_file(
        cls, path: Path, *, clock: str = "virtual", program: Optional[Path] = None, links: Optional[Links] = None
    ) -> "Line":
        """A line from a line file (docs/line-file.md). Its own `clock` and links are not used."""
        _check_clock(clock)
        name = os.fsdecode(path)
        try:
            with open(name, "rb") as file:
                text = file.read()
        except OSError as error:
            reason = f"cannot be read: {error.strerror}"
            raise LineFileError([Diagnostic(name, 0, 0, reason, "give the name of a line file")]) from error
        line = cls.__new__(cls)
        line._begin(text, name, name, clock, program, links)
        return line

    @classmethod
    def from_text(
        cls,
        text: str,
        *,
        name: str = "line.toml",
        clock: str = "virtual",
        program: Optional[Path] = None,
        links: Optional[Links] = None,
    ) -> "Line":
        """A line from the text of a line file.

        `name` is its file in messages, and relative paths in the text start at the folder of `name`.
        """
        _check_clock(clock)
        if not isinstance(text, str):
            raise WrongType(f"text is of type {type(text).__name__}", "from_text", "give the text of a line file")
        line = cls.__new__(cls)
        line._begin(file_bytes(text), name, None, clock, program, links)
        return line

    def virtual_time(self) -> "virtual_time":
        """`with line.virtual_time():` this thread and those that it starts wait in line time (see `virtual_time`)."""
        from .virtual_time import virtual_time

        return virtual_time(self)

    def ethercat(self, bus: str = "ecat", second: bool = False) -> "EthercatPort":
        """A master's port of an EtherCAT segment; `second`: the one at the end of a ring."""
        from .ethercat import EthercatPort

        return EthercatPort(self, bus, second)

    def _begin(
        self,
        text: Optional[bytes],
        name: str,
        file: Optional[str],
        clock: str,
        program: Optional[Path],
        links: Optional[Links],
    ) -> None:
        """`file`: the file that has the text."""
        if clock == "real":
            from .remote import Remote

            self._backend: Backend = Remote(text, name, file, program, links or {})
        else:
            if program is not None or links:
                raise WrongType('program and links are for clock="real"', "Line", "leave them out in virtual time")
            self._backend = InProcess(text, name)
        backend = self._backend
        axes = {view["name"]: LiveAxis(backend, view) for view in backend.json("GET", "axes")["axes"]}
        buses = {view["name"]: LiveBus(backend, view) for view in backend.json("GET", "buses")["buses"]}
        self.axes = _Named("axis", axes)
        self.buses = _Named("bus", buses)
        if clock != "real":
            _open_lines.add(self)

    # ---- Its life ----

    @property
    def clock(self) -> str:
        """The clock, "virtual" or "real"."""
        return "real" if self._backend.is_real else "virtual"

    @property
    def warnings(self) -> List[Diagnostic]:
        """Warnings about the line file: the line runs with them."""
        return list(self._backend.warnings)

    def close(self) -> None:
        """Ends the line. Once more does nothing. Running recordings end, and keep their values."""
        self._backend.close()

    @property
    def closed(self) -> bool:
        """True after close(), and in a forked child."""
        return not self._backend.is_open

    def __enter__(self) -> "Line":
        return self

    def __exit__(
        self, kind: Optional[Type[BaseException]], error: Optional[BaseException], trace: Optional[TracebackType]
    ) -> None:
        self.close()

    def __repr__(self) -> str:
        state = ", closed" if self.closed else ""
        return f"<line of {', '.join(self.axes)}; {self.clock} time{state}>"

    @property
    def _handle(self) -> Handle:
        """The handle in the C library. Raises NotInRealTime."""
        if isinstance(self._backend, InProcess):
            return self._backend.handle
        raise NotInRealTime("the line runs in another process", "line", 'connect to bus.link, or use clock="virtual"')

    # ---- Time ----

    @property
    def now(self) -> float:
        """Line time in seconds."""
        return self._backend.now_ns() / NS_PER_SECOND

    @property
    def now_ns(self) -> int:
        """Line time in nanoseconds."""
        return self._backend.now_ns()

    @property
    def ticks(self) -> int:
        """The number of ticks that have passed."""
        return ticks_of(self._backend.now_ns())

    def advance(self, seconds: float) -> None:
        """Runs the line by a duration; in real time waits for it. Raises BadValue for a negative duration or NaN.

        Ctrl-C ends it after at most some 50 ms with KeyboardInterrupt; the line then stands at the time that it has reached.
        """
        if type(seconds) is not float or not 0.0 <= seconds < LONGEST_S:  # otherwise without a call, which counts for a tick
            seconds = checked_seconds(seconds, "seconds")
        self._backend.advance_ns(round(seconds * 1e9))

    def run_until(self, time: float) -> None:
        """Runs the line up to a line time in seconds; in real time waits for it. Raises BadValue for a time in the past."""
        self._backend.run_until_ns(nanoseconds(time, "time"))

    def run_ticks(self, ticks: int) -> None:
        """Runs the line by whole ticks of 62.5 us. Raises BadValue, NotInRealTime."""
        if type(ticks) is not int or not 0 <= ticks <= _LONGEST_TICKS:
            ticks = whole(ticks, "ticks", 0, _LONGEST_TICKS)
        self._backend.run_ticks(ticks)

    def wait_for(self, condition: Callable[[], T], timeout: float = 60.0, what: str = "the condition") -> T:
        """Lets time pass until `condition()` is true, and returns its value: `line.wait_for(lambda: x.homed)`.

        It is called each millisecond of line time. Raises Timeout after `timeout` seconds of line time; `what` is for its
        message.
        """
        return self._backend.wait_for(condition, timeout, what)

    # ---- Values ----

    def record(self, signals: Mapping[str, Signal], rate: float = 1000.0) -> Recording:
        """Records signals from the next tick on: `line.record({"v": x.signal("velocity_rpm")}, rate=4000)`.

        `rate` is in Hz of line time: 16000 divided by a whole number. In virtual time samples are kept in this process
        without a limit; in real time the program has room for some 1000000 values of a recording, of at most 16 signals
        (`Recording.is_full`). Raises WrongType, BadValue.
        """
        if not isinstance(signals, Mapping) or not signals:
            raise WrongType("no signals", "record", 'give a dict: {"v": x.signal("velocity_rpm")}')
        stride = stride_of(rate)
        channels = self._channels(list(signals.values()))
        return Recording(self._backend.recorder(channels, stride), signals, stride)

    def read(self, signals: Sequence[Signal]) -> List[float]:
        """The present values of signals, at one instant; NaN: the axis has no power."""
        return self._backend.read(self._channels(signals))

    def positions(self) -> "NDArray[np.int64]":
        """The true positions of all axes in encoder counts, in the order of `axes`. Needs numpy (MissingPackage)."""
        result: "NDArray[np.int64]" = self._backend.positions()
        return result

    def _channels(self, signals: Sequence[Signal]) -> List[int]:
        channels: List[int] = []
        for signal in signals:
            if not isinstance(signal, Signal):
                raise WrongType(f"a signal of type {type(signal).__name__}", "signals", 'give x.signal("velocity_rpm")')
            if not signal.belongs_to(self._backend):
                raise BadValue(f"{signal!r} is of another line", "signals", "make signals from the axes of this line")
            channels.append(signal.channel)
        return channels

    # ---- Scenarios ----

    def scenario(self, file: Path = "", text: str = "") -> Scenario:
        """Begins a scenario from a file or a text (docs/scenario.md), in place of the present one.

        The line is this one, whatever the scenario's key `line` says. Raises BadValue with file, line and column of the
        first error.
        """
        if not text:
            with open(file, encoding="utf-8") as opened:
                text = opened.read()
        return Scenario(self._backend, text, os.fspath(file) or "scenario")

    # ---- The rest ----

    def stop_all(self) -> None:
        """The emergency stop: quick stop on every axis at once; all jobs end."""
        self._backend.json("POST", "stop")

    def request(self, method: str, path: str, body: Optional[Mapping[str, Any]] = None) -> Any:
        """A request of the bench API (docs/bench-api.md): `line.request("GET", "axes/x/geometry")`.

        Returns the JSON of the answer, None if it has no body.
        """
        return self._backend.json(method, path, None if body is None else dict(body))


def _check_clock(clock: str) -> None:
    if clock not in ("virtual", "real"):
        raise BadValue(f"clock is {clock!r}", "Line", 'give "virtual" or "real"')
