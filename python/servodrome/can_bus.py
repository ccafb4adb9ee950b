"""A python-can interface to a CAN bus of a line in this process: `can.Bus(interface="servodrome", channel="can0", line=line)`.

The interface is an entry point of the package (`can.interface`). Where the package is not installed, importing this module registers
it. In `servodrome.virtual_time` everything that python-can and packages on it do is in line time: Notifier, send_periodic, timeouts.
Outside of it, recv() lets line time pass while it waits: python-can's other timeouts are real there.
"""

from __future__ import annotations

import ctypes
import logging
from typing import TYPE_CHECKING, Any, List, Optional, Tuple

import can
import can.interfaces
import can.util

from . import _library
from ._library import CanFrame, error_of, text_of
from ._open_lines import open_lines
from ._ports import Port, line_of
from .errors import Error, Refused

if TYPE_CHECKING:
    from .line import Line

_log = logging.getLogger("can.servodrome")
_STATES = (can.BusState.ACTIVE, can.BusState.PASSIVE, can.BusState.ERROR)
_FULL_PAUSE_S = 0.001  # of line time, between two attempts to send while the port's queue is full


class ServodromeBus(can.BusABC):
    """A port on a CAN bus of a line. Timestamps of messages are line time in seconds: the end of the frame on the bus.

    `channel` is the name of the bus, `line` the line: by default that of the present virtual_time(), or else the only open line that has
    such a bus. CAN FD is refused. `state` is that of the port's controller: active, passive, or ERROR for bus-off.
    Raises can.CanInitializationError, and can.CanOperationError in later calls.
    """

    def __init__(
        self,
        channel: Any = None,
        can_filters: Any = None,
        line: "Optional[Line]" = None,
        fd: bool = False,
        bitrate: Optional[int] = None,
        **kwargs: Any,
    ) -> None:
        """`bitrate`: if given, it must be that of the bus (bit/s)."""
        if fd:
            raise can.CanInitializationError("servodrome: the buses of a line are classic CAN; leave out fd=True")
        if channel is None:
            raise can.CanInitializationError('servodrome: no channel; give the name of a bus: channel="can0"')
        try:
            name = str(channel)
            its_line = line if line is not None else line_of(name, "can")
            self._check_rate(its_line, name, bitrate)
            self._port = Port(its_line, "servodrome_can_open", text_of(name, "channel"))
        except Error as error:
            raise can.CanInitializationError(f"servodrome: {error}") from error
        c = _library.library()
        self._receive = c.servodrome_can_receive
        self._send = c.servodrome_can_send
        self.channel = name
        self.channel_info = f"servodrome {name}"
        super().__init__(channel=name, can_filters=can_filters, **kwargs)

    @staticmethod
    def _check_rate(line: "Line", name: str, bitrate: Optional[int]) -> None:
        if bitrate is None or name not in line.buses:
            return
        its = line.buses[name].view().get("bit_rate")
        if its != int(bitrate):
            raise Refused(f"the bit rate of {name} is {its}, not {bitrate}", "can.Bus", "leave out bitrate, or give that of the bus")

    def recv(self, timeout: Optional[float] = None) -> Optional[can.Message]:
        """The next message that a filter lets through; None after `timeout` seconds of line time (None: without a limit)."""
        if timeout is None:
            while True:
                message, _ = self._recv_internal(None)
                if message is not None and self._matches_filters(message):
                    return message
        line = self._port.line
        end = line.now_ns + round(timeout * 1e9)
        left = timeout
        while True:
            message, _ = self._recv_internal(left)
            if message is None or self._matches_filters(message):
                return message
            left = max(0, end - line.now_ns) / 1e9

    def _recv_internal(self, timeout: Optional[float]) -> Tuple[Optional[can.Message], bool]:
        frame = CanFrame()
        to_frame = ctypes.byref(frame)
        receive = self._receive
        try:
            if not self._port.receive(lambda handle, timeout_ns: int(receive(handle, timeout_ns, to_frame)), timeout):
                return None, False
        except Error as error:
            raise can.CanOperationError(f"servodrome: {error}") from error
        if frame.lost:
            _log.warning("%s: frames were lost before this one, because they were not read in time", self.channel)
        length = frame.length
        is_remote = bool(frame.remote)
        message = can.Message(
            timestamp=frame.time_ns / 1e9,
            arbitration_id=frame.id,
            is_extended_id=bool(frame.extended),
            is_remote_frame=is_remote,
            channel=self.channel,
            dlc=length,
            data=None if is_remote else bytes(frame.data)[:length],
        )
        return message, False

    def send(self, msg: can.Message, timeout: Optional[float] = None) -> None:
        """Puts a message into the port's queue. If that is full, waits for at most `timeout` seconds of line time (default: 0)."""
        if msg.is_fd:
            raise can.CanOperationError("servodrome: the buses of a line are classic CAN; send a message without is_fd")
        if msg.is_error_frame:
            raise can.CanOperationError("servodrome: an error frame cannot be sent; disturb the bus: line.buses[...].disturb()")
        data = bytes(msg.data)
        frame = CanFrame(id=msg.arbitration_id, extended=msg.is_extended_id, remote=msg.is_remote_frame, length=msg.dlc)
        if data and not msg.is_remote_frame:
            ctypes.memmove(frame.data, data, len(data))
        handle = self._port.handle
        left = timeout or 0.0
        on_frame = self._port.line._backend.on_frame
        while True:
            result = self._send(handle.value, ctypes.byref(frame))
            if result == 0:
                if on_frame is not None:
                    on_frame(str(self.channel), msg)
                return
            if result != _library.REFUSED or left <= 0:
                error = error_of(result, handle)
                raise can.CanOperationError(f"servodrome: {error}") from error
            self._port.let_pass(min(left, _FULL_PAUSE_S))
            left -= _FULL_PAUSE_S

    def shutdown(self) -> None:
        """Stops the periodic messages, and closes the port."""
        super().shutdown()
        port = getattr(self, "_port", None)
        if port is not None:
            port.close()

    @property
    def state(self) -> can.BusState:
        number = ctypes.c_uint()
        result = _library.library().servodrome_can_state(self._port.handle.value, ctypes.byref(number))
        if result < 0:
            error = error_of(result, self._port.handle)
            raise can.CanOperationError(f"servodrome: {error}") from error
        return _STATES[number.value]

    @state.setter
    def state(self, new_state: can.BusState) -> None:
        raise NotImplementedError("the state of a port follows from its errors; disturb the bus: line.buses[...].disturb()")

    def fileno(self) -> int:
        """-1: a Notifier reads the bus in a thread."""
        return -1

    @staticmethod
    def _detect_available_configs() -> List[Any]:
        buses = [(line, bus) for line in open_lines() for bus in line.buses.values()]
        return [{"interface": "servodrome", "channel": bus.name, "line": line} for line, bus in buses if bus.type == "can"]


def _register() -> None:
    """As the entry point does, for a package that is not installed."""
    if "servodrome" in can.interfaces.BACKENDS:
        return
    can.interfaces.BACKENDS["servodrome"] = (__name__, "ServodromeBus")
    known = frozenset([*can.interfaces.VALID_INTERFACES, "servodrome"])
    for module in (can, can.interfaces, can.util):
        module.VALID_INTERFACES = known  # type: ignore[attr-defined]


_register()
