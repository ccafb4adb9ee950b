"""What a test leaves of its line: captures of the buses, pictures of the axes, the line's text, and a script that repeats it."""

from __future__ import annotations

import json
import pathlib
from array import array
from typing import Any, Callable, Dict, List, NamedTuple, Optional

from ._backend import TICKS_PER_SECOND, path
from ._library import Answer
from ._plot import SIGNALS, svg_of
from .errors import Error, Refused
from .line import Line
from .remote import _HEAD as RECORDING_HEAD

RATE_HZ = 1000
LAST_S = 1.0
SCRIPT = "replay.py"
LINE_TEXT = "line.toml"
_SUFFIXES = {
    "can": {"candump": ".candump.log", "pcap": ".pcap"},
    "ethercat": {"pcap": ".pcap"},
    "rs485": {"pcap": ".pcapng", "text": ".txt"},
}
_ROOT = "/api/v1/"
_NOT_REPEATED = ("recordings", "clock")  # besides the traffic of buses: they change nothing in the drives

_MOST_ACTIONS = 100_000  # of a script; 8 MB of text

_REPLAY = '''"""Repeats what a test did with a line: {test}

ACTIONS has the requests that the test made through the package servodrome (jobs, objects, inputs, injected faults, plant, power,
disturbances), and the frames that it sent through can.Bus(interface="servodrome"). They are repeated at the same line time, in virtual
time, all frames of a bus from one port. After a test in real time the times are approximate, and frames of masters that were connected
to a link are not known. What a test sent through a serial port or an EtherCAT port is not repeated: the captures have it.
"""

import servodrome

TEXT = {text}
NAME = {name}  # relative paths in the text start at its folder
END_NS = {end}
# Line time in ns, and: method, path and body of a request, as in docs/bench-api.md; or "frame", bus and message.
ACTIONS = [
{actions}]


def replay(line, until_ns=END_NS):
    """Repeats the actions before a line time, and runs the line to it."""
    ports = {{}}
    for time_ns, method, where, what in ACTIONS:
        if time_ns > until_ns:
            break
        line.run_until(time_ns / 1e9)
        try:
            if method == "frame":
                send(line, ports, where, what)
            else:
                line.request(method, where, what)
        except servodrome.Error as error:
            print(f"{{time_ns / 1e9:.6f}} s: {{method}} {{where}}: {{error}}")
    line.run_until(until_ns / 1e9)
    for port in ports.values():
        port.shutdown()


def send(line, ports, bus, message):
    """Sends a frame through the port of a bus, which the first frame opens."""
    import can
    import servodrome.can_bus

    if bus not in ports:
        ports[bus] = servodrome.can_bus.ServodromeBus(bus, line=line)
    ports[bus].send(can.Message(**message))


if __name__ == "__main__":
    with servodrome.Line() if TEXT is None else servodrome.Line.from_text(TEXT, name=NAME) as line:
        replay(line)  # an earlier until_ns shows the line before the failure
        print(f"{{line.now:.6f}} s")
        for axis in line.axes.values():
            print(f"{{axis.name}}: {{axis.position}} counts, {{axis.state.text}}")
'''


class Description(NamedTuple):
    """A line of a test."""

    text: Optional[str]
    """The text of its line file; None: the built-in line."""
    name: str
    """The name of its file."""


class Action(NamedTuple):
    """A request that changes something, or a frame that a can.Bus sent."""

    time_ns: int
    method: str
    """"frame" for a frame."""
    where: str
    what: Optional[Dict[str, Any]]


class Watch:
    """Follows a line from its start. With `record`, it records every bus (4 MiB of memory each), and the last second of each axis: the line
    keeps four signals at 1 kHz in a ring buffer of 32 kB."""

    def __init__(self, line: Line, description: Description, record: bool) -> None:
        self.line = line
        self.description = description
        self.record = record
        self.actions: List[Action] = []
        self._last: Dict[str, int] = {}  # the recording of each axis
        if record:
            for bus in line.buses.values():
                bus.record()
            for name in line.axes:
                try:
                    self._last[name] = _record_last(line, name)
                except Refused:  # a line samples at most 512 values: these axes get no picture
                    break
        self._follow()

    def _follow(self) -> None:
        """Notes requests and frames from now on."""
        backend: Any = self.line._backend
        original: Callable[[str, str, bytes], Answer] = backend.request

        def request(method: str, target: str, body: bytes = b"") -> Answer:
            where = target[len(_ROOT) :]
            if method != "GET" and not where.endswith("/traffic") and where.split("/")[0] not in _NOT_REPEATED:
                self._note(method, where, json.loads(body) if body else None)
            return original(method, target, body)

        backend.request = request
        if self.record:
            backend.on_frame = lambda bus, message: self._note("frame", bus, _frame(message))

    def _note(self, method: str, where: str, what: Optional[Dict[str, Any]]) -> None:
        """Notes an action; one more than a script has, which says where the script must end."""
        if len(self.actions) <= _MOST_ACTIONS:
            self.actions.append(Action(self.line._backend.now_ns(), method, where, what))

    def write(self, folder: pathlib.Path, test: str) -> List[str]:
        """Writes the files into a folder, and returns lines of text about them and the axes.

        What cannot be written, for example because the test has closed the line, is named in these lines.
        """
        folder.mkdir(parents=True, exist_ok=True)
        about: List[str] = []

        def attempt(what: str, action: Callable[[], None]) -> None:
            try:
                action()
            except (Error, OSError) as error:
                about.append(f"{what}: {error}")

        for name, number in self._last.items():
            attempt(f"{name}.svg", lambda: self._write_picture(folder / f"{name}.svg", name, number))  # noqa: B023
        self._last.clear()
        for bus in self.line.buses.values() if self.record else ():
            for format, suffix in _SUFFIXES[bus.type].items():
                file = folder / (bus.name + suffix)
                attempt(file.name, lambda: _write(file, bus.capture(format)))  # noqa: B023
        if self.description.text is not None:
            attempt(
                LINE_TEXT, lambda: _write(folder / LINE_TEXT, (self.description.text or "").encode("utf-8", "surrogateescape"))
            )
        attempt(SCRIPT, lambda: _write(folder / SCRIPT, self._script(test).encode()))
        if len(self.actions) > _MOST_ACTIONS:
            about.append(f"replay.py ends at {self.actions[-1].time_ns / 1e9:.6f} s, after {_MOST_ACTIONS} requests and frames")
        attempt("axes", lambda: about.extend(self._axes()))
        return about

    def _write_picture(self, file: pathlib.Path, axis: str, recording: int) -> None:
        columns = _take_last(self.line, recording)
        if columns["time_s"]:
            _write(file, svg_of(axis, columns).encode())

    def _script(self, test: str) -> str:
        is_cut = len(self.actions) > _MOST_ACTIONS
        known = self.actions[-1].time_ns if self.actions else 0
        end = known if is_cut or self.line.closed else self.line.now_ns
        actions = "".join(f"    {tuple(action)!r},\n" for action in self.actions[:_MOST_ACTIONS])
        title = test.replace("\\", "/").replace('"', "'")
        return _REPLAY.format(
            test=title, text=repr(self.description.text), name=repr(self.description.name), end=end, actions=actions
        )

    def _axes(self) -> List[str]:
        lines = [f"at {self.line.now:.6f} s of line time ({self.line.clock})"]
        for name, axis in self.line.axes.items():
            view = axis.view()
            state = view["state"] if view["powered"] else "no power"
            faults = "".join(f"; fault {fault}" for fault in axis.faults) if view["powered"] else ""
            lines.append(f"{name}: {axis.position} counts, {axis.velocity_rpm:.1f} rpm, {axis.torque_nm:.3f} Nm, {state}{faults}")
        return lines


def _record_last(line: Line, axis: str) -> int:
    """Begins a recording that waits for a trigger that never comes: until then it keeps the last second."""
    body = {
        "name": "pytest",
        "channels": [{"axis": axis, "signal": signal} for signal in SIGNALS],
        "rate_hz": RATE_HZ,
        "duration_ms": LAST_S * 1000,
        "trigger": {"kind": "level", "channel": 0, "level": 1e300},
    }
    return int(line.request("POST", "recordings", body)["id"])


def _take_last(line: Line, number: int) -> Dict[str, "array[float]"]:
    """Ends the recording: "time_s" and the values of each signal."""
    address = path("recordings", number)
    line.request("POST", address + "/stop")
    data = line._backend.content(address + "/data")
    line.request("DELETE", address)
    _, stride, first_tick, rows, _ = RECORDING_HEAD.unpack_from(data)
    values = array("d", data[RECORDING_HEAD.size :])
    columns = {signal: values[place * rows : (place + 1) * rows] for place, signal in enumerate(SIGNALS)}
    columns["time_s"] = array("d", [(first_tick + row * stride) / TICKS_PER_SECOND for row in range(rows)])
    return columns


def _frame(message: Any) -> Dict[str, Any]:
    """The keywords of a can.Message."""
    frame: Dict[str, Any] = {"arbitration_id": message.arbitration_id, "is_extended_id": message.is_extended_id}
    if message.is_remote_frame:
        return {**frame, "is_remote_frame": True, "dlc": message.dlc}
    return {**frame, "data": bytes(message.data)}


def _write(file: pathlib.Path, content: bytes) -> None:
    file.write_bytes(content)
