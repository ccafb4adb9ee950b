"""A bus of a running line."""

from __future__ import annotations

from types import TracebackType
from typing import Any, Dict, Iterator, List, NamedTuple, Optional, Type

from ._backend import Backend, path

_ROWS_AT_ONCE = 5000


class Frame(NamedTuple):
    """A recorded frame (on EtherCAT: a datagram) in words, as `servodrome sniff` explains it."""

    number: int
    time_ns: int
    """Line time, in nanoseconds."""
    sender: str
    """The axis, "master", "slaves", or "drive" of Modbus TCP."""
    kind: str
    """The service: "sdo", "pdo", "nmt", "emcy" ..."""
    node: Optional[int]
    about: str
    bytes: str
    """The frame's bytes, in hexadecimal, with identifier and length."""
    text: str
    """What it says: "SDO read 6041:00 Statusword"."""
    error: bool
    values: Dict[str, str]
    """Values of objects in the frame, by their name."""


class Traffic:
    """The recorded frames of a bus, the oldest first. A ring buffer keeps the newest 4 MiB of frames, and 10000 rows."""

    def __init__(self, backend: Backend, bus: str) -> None:
        self._backend = backend
        self._bus = bus
        self._path = path("buses", bus, "traffic")

    def rows(
        self,
        *,
        since: int = 0,
        node: Optional[int] = None,
        kind: Optional[str] = None,
        object: Optional[str] = None,
        text: Optional[str] = None,
        errors: bool = False,
    ) -> List[Frame]:
        """The frames after number `since` that have this node, kind ("sdo,emcy"), object ("6041:00"), text, or an error."""
        given = {"node": node, "kind": kind, "object": object, "text": text, "errors": "true" if errors else None}
        frames: List[Frame] = []
        while True:
            address = path("buses", self._bus, "traffic", since=since, limit=_ROWS_AT_ONCE, **given)
            answer = self._backend.json("GET", address)
            frames += [_frame_of(row) for row in answer["rows"]]
            if not answer["rows"]:
                return frames
            since = answer["next"]

    def __iter__(self) -> Iterator[Frame]:
        return iter(self.rows())

    def __len__(self) -> int:
        """The number of frames that were recorded, with those that the ring buffer has lost."""
        return int(self._backend.json("GET", path("buses", self._bus, "traffic", limit=0))["frames"])

    def clear(self) -> None:
        """Deletes the recorded frames."""
        self._backend.json("DELETE", self._path)

    def __repr__(self) -> str:
        return f"<traffic of {self._bus}>"


def _frame_of(row: Dict[str, Any]) -> Frame:
    return Frame(
        row["number"],
        row["time_ns"],
        row["from"],
        row["kind"],
        row["node"],
        row["about"],
        row["bytes"],
        row["text"],
        row["error"],
        {value["name"]: value["value"] for value in row["values"]},
    )


class _Until:
    """A state of a bus that a `with` block ends."""

    def __init__(self, bus: "LiveBus") -> None:
        self._bus = bus

    def end(self) -> None:
        """Ends it."""
        raise NotImplementedError

    def __enter__(self) -> "LiveBus":
        return self._bus

    def __exit__(
        self, kind: Optional[Type[BaseException]], error: Optional[BaseException], trace: Optional[TracebackType]
    ) -> None:
        self.end()


class Disturbance(_Until):
    """A disturbance of a bus. It lasts until end(), or to the end of its `with` block."""

    def end(self) -> None:
        """Ends it; delayed frames are released."""
        self._bus.calm()


class TrafficRecording(_Until):
    """The recording of a bus's frames. It lasts until end(), or to the end of its `with` block; the frames stay."""

    def end(self) -> None:
        """Ends it."""
        self._bus.record(False)


class LiveBus:
    """A bus of a line."""

    name: str
    type: str
    """"can", "ethercat" or "rs485"."""
    traffic: Traffic
    """The recorded frames: record() begins."""

    def __init__(self, backend: Backend, view: Dict[str, Any]) -> None:
        self._backend = backend
        self.name = view["name"]
        self.type = view["type"]
        self.traffic = Traffic(backend, self.name)

    def view(self) -> Dict[str, Any]:
        """Load, counters, error states and the present disturbance, as the bench API shows them."""
        view: Dict[str, Any] = self._backend.json("GET", path("buses", self.name))
        return view

    @property
    def links(self) -> List[str]:
        """The names by which masters in other programs reach the bus: "socketcand:127.0.0.1:40123/can0".

        Raises NotInVirtualTime.
        """
        return self._backend.links(self.name)

    @property
    def link(self) -> str:
        """The first of `links`. Raises NotInVirtualTime."""
        return self.links[0]

    def disturb(
        self,
        *,
        drop: Optional[float] = None,
        delay: Optional[float] = None,
        delay_ms: Optional[float] = None,
        corrupt: Optional[float] = None,
        seed: Optional[int] = None,
        id: Optional[int] = None,
        id_mask: Optional[int] = None,
        axis: Optional[str] = None,
        limit: Optional[int] = None,
        cut: Optional[bool] = None,
        drop_answer: Optional[float] = None,
        position: Optional[int] = None,
        unplug: Optional[int] = None,
        ring: Optional[bool] = None,
    ) -> Disturbance:
        """Disturbs the bus from now on, in place of the present disturbance; calm(), or the end of a `with` block, ends it.

        `drop`, `delay`, `corrupt` and `drop_answer` are probabilities, 0 .. 1. docs/bench-api.md ("Buses") has which keys
        each type of bus accepts. Equal seeds and equal traffic give an equal disturbance. Raises BadValue, WrongType.
        """
        keys = {
            "drop": drop,
            "delay": delay,
            "delay_ms": delay_ms,
            "corrupt": corrupt,
            "seed": seed,
            "id": id,
            "id_mask": id_mask,
            "axis": axis,
            "limit": limit,
            "cut": cut,
            "drop_answer": drop_answer,
            "position": position,
            "unplug": unplug,
            "ring": ring,
        }
        given = {key: value for key, value in keys.items() if value is not None}
        self._backend.json("POST", path("buses", self.name, "disturb"), given)
        return Disturbance(self)

    def calm(self) -> None:
        """Ends the disturbance, and connects cables again."""
        self._backend.json("DELETE", path("buses", self.name, "disturb"))

    def record(self, on: bool = True) -> TrafficRecording:
        """Begins to record frames for `traffic` and `capture`, or ends that. It changes nothing on the bus."""
        self._backend.json("PUT", path("buses", self.name, "traffic"), {"record": on})
        return TrafficRecording(self)

    def capture(self, format: str = "pcap") -> bytes:
        """The recorded frames as a file: "pcap" (of an RS485 line pcapng), "candump" of a CAN bus, "text" of an RS485 line."""
        return self._backend.content(path("buses", self.name, "capture", format=format))

    def __repr__(self) -> str:
        return f"<bus {self.name}: {self.type}>"
