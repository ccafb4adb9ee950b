"""A pyserial port on an RS485 line of a line in this process.

    import serial, servodrome.serial_port                       # registers the URLs with pyserial
    serial.serial_for_url("servodrome://rs485", 115200, timeout=1)
    pymodbus.client.ModbusSerialClient("servodrome://rs485", baudrate=115200)

In `servodrome.virtual_time` every wait is one of line time; outside of it, line time passes while read() waits.
"""

from __future__ import annotations

import ctypes
from typing import TYPE_CHECKING, Any, Optional

from . import _library
from ._library import error_of, text_of
from ._ports import Port, line_of
from .errors import Error, MissingPackage

try:
    import serial
except ImportError as _missing:
    raise MissingPackage("pyserial is not installed", "servodrome.serial_port", "install it: pip install pyserial") from _missing

if TYPE_CHECKING:
    from .line import Line

_SCHEME = "servodrome://"
_CAPACITY = 4096  # bytes of one call
_MOST_SENT = 65536  # bytes of one call


class SerialPort(serial.SerialBase):
    """A port on an RS485 line; what pyserial's Serial does.

    `port` is the URL "servodrome://BUS" or the name of the bus, `line` the line: by default that of the present virtual_time(), or else
    the only open one that has such a bus. Bit rate and format must be those of the drives, as on a real line; pyserial's default is
    9600 8N1. A frame that ends with a wrong format is received as the bytes that result from it.

    Handshake lines do not exist: CTS, DSR and CD read as set, and RTS and DTR do nothing. There is no break, no parity MARK or SPACE, and
    no file descriptor.
    """

    def __init__(self, *arguments: Any, line: "Optional[Line]" = None, **keywords: Any) -> None:
        self._line = line
        self._link: Optional[Port] = None
        self._buffer = bytearray()
        self._sent_ns = 0  # the line time at which everything is sent
        self._place = ctypes.create_string_buffer(_CAPACITY)
        self._size = ctypes.c_size_t()
        c = _library.library()
        self._receive = c.servodrome_serial_receive
        self._send = c.servodrome_serial_send
        super().__init__(*arguments, **keywords)

    # ---- Its life ----

    def open(self) -> None:
        """Opens the port. Raises SerialException."""
        if self.is_open:
            raise serial.SerialException("the port is already open")
        name = self.port
        if name is None:
            raise serial.SerialException('set `port` before: "servodrome://rs485"')
        if name.lower().startswith(_SCHEME):
            name = name[len(_SCHEME) :].rstrip("/")
        try:
            line = self._line if self._line is not None else line_of(name, "rs485")
            self._link = Port(line, "servodrome_serial_open", text_of(name, "bus"))
            self._reconfigure_port()
        except Error as error:
            self._close_link()
            raise serial.SerialException(f"servodrome: {error}") from error
        except ValueError:
            self._close_link()
            raise
        self._buffer.clear()
        self._sent_ns = 0
        self.is_open = True

    def close(self) -> None:
        """Closes the port; once more does nothing."""
        self.is_open = False
        self._close_link()

    def _close_link(self) -> None:
        link = getattr(self, "_link", None)
        if link is not None:
            link.close()
        self._link = None

    def _opened(self) -> Port:
        link = self._link
        if link is None:
            raise serial.PortNotOpenError
        return link

    def _reconfigure_port(self) -> None:
        link = self._opened()
        if self.parity not in ("N", "E", "O"):
            raise ValueError(f"parity {self.parity!r}: an RS485 line of servodrome has N, E and O")
        if self.stopbits not in (1, 2):
            raise ValueError(f"{self.stopbits} stop bits: an RS485 line of servodrome has 1 and 2")
        configure = _library.library().servodrome_serial_configure
        _library.call(configure, link.handle, self.baudrate, self.bytesize, self.parity.encode(), int(self.stopbits))
        bits = 1 + self.bytesize + (self.parity != "N") + int(self.stopbits)
        self._character_ns = -(-bits * 1_000_000_000 // self.baudrate)

    # ---- Reading ----

    def _fill(self, timeout: Optional[float]) -> bool:
        """Moves what has come into the buffer; False: nothing before the timeout."""
        place, size = self._place, self._size
        receive = self._receive

        def attempt(handle: int, timeout_ns: int) -> int:
            return int(receive(handle, timeout_ns, place, _CAPACITY, ctypes.byref(size)))

        try:
            if not self._opened().receive(attempt, timeout):
                return False
        except Error as error:
            raise serial.SerialException(f"servodrome: {error}") from error
        self._buffer += place.raw[: size.value]
        return True

    def _drain(self) -> None:
        link = self._opened()
        size = self._size
        while self._receive(link.handle.value, 0, self._place, _CAPACITY, ctypes.byref(size)) == 0:
            self._buffer += self._place.raw[: size.value]

    @property
    def in_waiting(self) -> int:
        """The number of bytes that read() returns at once."""
        self._drain()
        return len(self._buffer)

    def read(self, size: int = 1) -> bytes:
        """Up to `size` bytes: fewer after `timeout`, or after a gap of `inter_byte_timeout`, seconds of line time."""
        line = self._opened().line
        self._drain()
        end = None if self.timeout is None else line.now_ns + round(self.timeout * 1e9)
        while len(self._buffer) < size:
            wait = None if end is None else max(0, end - line.now_ns) / 1e9
            if self.inter_byte_timeout and self._buffer:
                wait = self.inter_byte_timeout if wait is None else min(wait, self.inter_byte_timeout)
            if not self._fill(wait):
                break
        data = bytes(self._buffer[:size])
        del self._buffer[:size]
        return data

    def cancel_read(self) -> None:
        """Ends a read() of another thread: it returns what it has."""
        self._opened().cancel()

    def reset_input_buffer(self) -> None:
        """Discards what has come."""
        self._drain()
        self._buffer.clear()

    # ---- Writing ----

    def write(self, data: Any) -> int:
        """Queues bytes; they go out in line time, without a gap. Returns their number."""
        link = self._opened()
        if isinstance(data, str):
            raise TypeError(f"text cannot be sent, give bytes: {data!r}")
        sent = bytes(data)
        self._sent_ns = max(self._sent_ns, link.line.now_ns) + len(sent) * self._character_ns
        for begin in range(0, len(sent), _MOST_SENT):
            part = sent[begin : begin + _MOST_SENT]
            result = self._send(link.handle.value, part, len(part))
            if result != 0:
                error = error_of(result, link.handle)
                raise serial.SerialException(f"servodrome: {error}") from error
        return len(sent)

    @property
    def out_waiting(self) -> int:
        """The number of bytes that are not sent yet."""
        left = self._sent_ns - self._opened().line.now_ns
        return max(0, -(-left // self._character_ns))

    def flush(self) -> None:
        """Lets line time pass until everything is sent."""
        if self._link is None:  # io.IOBase calls it when the port is collected
            return
        left = self._sent_ns - self._link.line.now_ns
        if left > 0:
            self._link.let_pass(left / 1e9)

    def reset_output_buffer(self) -> None:
        """Does nothing: bytes that were written cannot be taken back."""
        self._opened()

    # ---- What RS485 does not have ----

    def _update_break_state(self) -> None:
        raise serial.SerialException("servodrome: an RS485 line has no break")

    def _update_rts_state(self) -> None:
        pass

    def _update_dtr_state(self) -> None:
        pass

    @property
    def cts(self) -> bool:
        """True."""
        return True

    @property
    def dsr(self) -> bool:
        """True."""
        return True

    @property
    def cd(self) -> bool:
        """True."""
        return True

    @property
    def ri(self) -> bool:
        """False."""
        return False


if "servodrome" not in serial.protocol_handler_packages:
    serial.protocol_handler_packages.append("servodrome")
