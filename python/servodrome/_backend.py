"""What a line needs from the place where it runs: in this process (`_in_process.py`) or in the program (`remote.py`).

Both answer requests of the bench API (docs/bench-api.md); times and values of axes have calls of their own.
"""

from __future__ import annotations

import abc
import json
import math
import numbers
from array import array
from typing import Any, Callable, Dict, List, NamedTuple, Optional, Sequence, Tuple, TypeVar, Union
from urllib.parse import quote, urlencode

from ._library import TICK_NS, Answer
from .errors import BadValue, Diagnostic, Timeout, WrongType, refusal

TICKS_PER_SECOND = 16_000
NS_PER_SECOND = 1_000_000_000
LONGEST_S = 9e9  # some 285 years: 64 bits of nanoseconds

T = TypeVar("T")


class Samples(NamedTuple):
    """Recorded values: `values` has row after row, each with `columns` values."""

    first_tick: int
    stride: int
    rows: int
    columns: int
    values: "array[float]"
    full: bool  # the recorder stopped by itself, because its memory was full


class Recorder(abc.ABC):
    """A running recording."""

    @abc.abstractmethod
    def samples(self) -> Samples:
        """What was recorded so far."""

    @abc.abstractmethod
    def close(self) -> None:
        """Ends it; once more does nothing."""


class Backend(abc.ABC):
    """A running line."""

    is_real: bool
    warnings: List[Diagnostic]  # about the line file; the line runs with them
    on_frame: Optional[Callable[[str, Any], None]] = None  # gets each message (can.Message) that can.Bus sends, with the bus

    @abc.abstractmethod
    def request(self, method: str, target: str, body: bytes = b"") -> Answer:
        """A request of the bench API. `target` is the path with its query."""

    @abc.abstractmethod
    def now_ns(self) -> int:
        """Line time in nanoseconds."""

    @abc.abstractmethod
    def run_until_ns(self, end: int) -> None:
        """Runs the line to a time; in real time waits for it. Raises BadValue for a time in the past."""

    @abc.abstractmethod
    def advance_ns(self, duration: int) -> None:
        """Runs the line by a duration of at least 0; in real time waits."""

    @abc.abstractmethod
    def run_ticks(self, ticks: int) -> None:
        """Runs the line by whole ticks. Raises NotInRealTime."""

    @abc.abstractmethod
    def pause(self) -> None:
        """Lets some time pass for a caller that polls: a millisecond of line time, in real time some milliseconds."""

    @abc.abstractmethod
    def channel(self, axis: str, value: str) -> int:
        """The channel of a signal, input, output or object ("6064:00"). Raises UnknownName."""

    @abc.abstractmethod
    def read(self, channels: Sequence[int]) -> List[float]:
        """The present values of channels, at one instant; NaN: the axis has no power."""

    @abc.abstractmethod
    def number(self, axis: str, signal: str) -> float:
        """The present value of a signal that the axis's view has as well."""

    @abc.abstractmethod
    def positions(self) -> Any:
        """The true positions of all axes in counts, as a numpy array of int64."""

    @abc.abstractmethod
    def recorder(self, channels: Sequence[int], stride: int) -> Recorder:
        """Records channels at every tick that is a multiple of `stride`, from the next one on."""

    @abc.abstractmethod
    def links(self, bus: str) -> List[str]:
        """The names by which masters in other programs reach a bus. Raises NotInVirtualTime."""

    @abc.abstractmethod
    def close(self) -> None:
        """Ends the line; once more does nothing."""

    @property
    @abc.abstractmethod
    def is_open(self) -> bool:
        """False after close() and in a forked child."""

    # ---- Requests in JSON ----

    def json(self, method: str, path: str, body: Optional[Dict[str, Any]] = None) -> Any:
        """Sends a request and returns the JSON of the answer; None if it has no body. Raises the exception of a refusal."""
        answer = self.request(method, "/api/v1/" + path, b"" if body is None else json_bytes(body))
        if answer.status >= 400:
            raise refusal(answer.status, answer.body)
        return json.loads(answer.body) if answer.body else None

    def content(self, path: str) -> bytes:
        """The body of an answer that is not JSON."""
        answer = self.request("GET", "/api/v1/" + path)
        if answer.status >= 400:
            raise refusal(answer.status, answer.body)
        return answer.body

    # ---- Waiting ----

    def wait_for(self, condition: Callable[[], T], timeout_s: float, what: str) -> T:
        """Lets time pass until `condition()` is true, and returns its value. Raises Timeout."""
        end = self.now_ns() + nanoseconds(timeout_s, "timeout")
        while True:
            value = condition()
            if value:
                return value
            if self.now_ns() >= end:
                raise Timeout(f"waited {timeout_s:g} s of line time for {what}", "line", "give a longer timeout")
            self.pause()


def path(*parts: object, **query: object) -> str:
    """A path of the bench API from its parts, with a query of the values that are not None."""
    text = "/".join(quote(str(part), safe="", errors="replace") for part in parts)
    given = {key: value for key, value in query.items() if value is not None}
    return f"{text}?{urlencode(given, safe=':,', errors='replace')}" if given else text


def _plain(value: Any) -> Any:
    """Numbers of numpy, and enums that are not numbers, for JSON."""
    if hasattr(value, "item") and callable(value.item):
        return value.item()
    raise TypeError(f"{type(value).__name__} cannot be sent")


def json_bytes(body: Dict[str, Any]) -> bytes:
    """The body of a request. Raises BadValue for NaN and infinity, WrongType for what JSON does not have."""
    try:
        return json.dumps(body, allow_nan=False, default=_plain).encode()
    except TypeError as error:
        raise WrongType(str(error), "value", "give a number, a text, a boolean or None") from None
    except ValueError:
        raise BadValue("a number is NaN or infinite", "value", "give a finite number") from None


def seconds(value: Union[float, int], name: str) -> float:
    """A duration or time in seconds, checked: a finite number of at least 0."""
    if isinstance(value, bool) or not isinstance(value, numbers.Real):
        raise WrongType(f"{name} is of type {type(value).__name__}", name, "give a number of seconds")
    number = float(value)
    if not (0 <= number < LONGEST_S):
        reason = "not a finite number" if not math.isfinite(number) else "negative" if number < 0 else "too large"
        raise BadValue(f"{name} is {number:g}, {reason}", name, "give a finite number of seconds, at least 0")
    return number


def nanoseconds(value: Union[float, int], name: str) -> int:
    """A duration or time in seconds as whole nanoseconds."""
    return round(seconds(value, name) * 1e9)


def whole(value: Any, name: str, least: int, most: int) -> int:
    """A whole number within a range."""
    if isinstance(value, bool) or not isinstance(value, numbers.Integral):
        raise WrongType(f"{name} is of type {type(value).__name__}", name, "give a whole number")
    number = int(value)
    if not least <= number <= most:
        raise BadValue(f"{name} is {number}", name, f"give {least} .. {most}")
    return number


def stride_of(rate: Union[float, int]) -> int:
    """The number of ticks from sample to sample at a rate in Hz."""
    hint = "give 16000 divided by a whole number: 16000, 8000, 4000, 2000, 1000 ..."
    if isinstance(rate, bool) or not isinstance(rate, numbers.Real):
        raise WrongType(f"rate is of type {type(rate).__name__}", "rate", hint)
    number = float(rate)
    if not (1 <= number <= TICKS_PER_SECOND):
        raise BadValue(f"rate is {number:g} Hz", "rate", "give 1 .. 16000 Hz")
    stride = round(TICKS_PER_SECOND / number)
    if abs(TICKS_PER_SECOND / stride - number) > 1e-9 * number:
        raise BadValue(f"no whole number of ticks makes {number:g} Hz", "rate", hint)
    return stride


def ticks_of(now_ns: int) -> int:
    """The number of the latest tick."""
    return now_ns // TICK_NS


ObjectAddress = Tuple[int, int]


def object_text(address: ObjectAddress) -> str:
    """ "6064:00": index and sub-index in hexadecimal."""
    return f"{address[0]:04X}:{address[1]:02X}"
