"""A master's port on an EtherCAT segment of a line in this process: Ethernet frames out and in.

A master that takes a socket or a function for its frames can use it. Masters that contain their driver of the network interface, as
pysoem contains that of SOEM, cannot; they reach a line of `servodrome up` (docs/ethercat.md).
"""

from __future__ import annotations

import ctypes
from types import TracebackType
from typing import TYPE_CHECKING, Optional, Type

from . import _library
from ._library import call, text_of
from ._ports import Port
from .errors import BadValue, Timeout, WrongType

if TYPE_CHECKING:
    from .line import Line

_CAPACITY = 2048
_LEAST, _MOST = 14, 1514  # bytes of an Ethernet frame without its FCS


class EthercatPort:
    """A port at the begin of a segment, or with `second` at its end: the other port of a master with a redundant cable.

    Raises UnknownName.
    """

    def __init__(self, line: "Line", bus: str = "ecat", second: bool = False) -> None:
        c = _library.library()
        self._send = c.servodrome_ethercat_send
        self._receive = c.servodrome_ethercat_receive
        self._port = Port(line, "servodrome_ethercat_open", text_of(bus, "bus"), 1 if second else 0)
        self._place = ctypes.create_string_buffer(_CAPACITY)
        self._size = ctypes.c_size_t()

    def send(self, frame: bytes) -> None:
        """Sends an Ethernet frame with its header, without FCS: 14 .. 1514 bytes. It passes the slaves at this instant.

        Raises BadValue, WrongType, Closed.
        """
        if not isinstance(frame, (bytes, bytearray, memoryview)):
            raise WrongType(f"a frame of type {type(frame).__name__}", "send", "give bytes")
        if not _LEAST <= len(frame) <= _MOST:
            raise BadValue(f"a frame of {len(frame)} bytes", "send", f"give {_LEAST} .. {_MOST} bytes")
        call(self._send, self._port.handle, bytes(frame), len(frame))

    def receive(self, timeout: Optional[float] = None) -> Optional[bytes]:
        """The next frame that comes back; None if there is none within `timeout` seconds of line time (None: without a limit)."""
        place, size = self._place, self._size
        receive = self._receive

        def attempt(handle: int, timeout_ns: int) -> int:
            return int(receive(handle, timeout_ns, place, _CAPACITY, ctypes.byref(size)))

        if not self._port.receive(attempt, timeout):
            return None
        return place.raw[: size.value]

    def exchange(self, frame: bytes, timeout: float = 0.1) -> bytes:
        """Sends a frame, and returns it as it comes back. Frames that came before are discarded.

        Raises Timeout after `timeout` seconds of line time: a frame is lost where a cable is cut.
        """
        size = self._size
        while self._receive(self._port.handle.value, 0, self._place, _CAPACITY, ctypes.byref(size)) == 0:
            pass
        self.send(frame)
        answer = self.receive(timeout)
        if answer is None:
            raise Timeout(f"the frame did not come back within {timeout:g} s", "EtherCAT", "check the cables of the segment")
        return answer

    def close(self) -> None:
        """Closes the port; once more does nothing."""
        self._port.close()

    def __enter__(self) -> "EthercatPort":
        return self

    def __exit__(
        self, kind: Optional[Type[BaseException]], error: Optional[BaseException], trace: Optional[TracebackType]
    ) -> None:
        self.close()
