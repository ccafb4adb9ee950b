"""A small CANopen client on a socketcand link: SDO transfers of up to 4 bytes."""

import socket


class SdoError(Exception):
    """The drive has refused an access."""


class Lost(Exception):
    """The connection has ended."""


class Client:
    """A raw client of `socketcand:HOST:PORT/BUS`."""

    def __init__(self, link, patience_s=60.0):
        address, _, bus = link.removeprefix("socketcand:").partition("/")
        host, _, port = address.rpartition(":")
        self._socket = socket.create_connection((host, int(port)), patience_s)
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._rest = b""
        self._read_until(b"< hi >")
        self._send(f"< open {bus} >")
        self._read_until(b"< ok >")
        self._send("< rawmode >")
        self._read_until(b"< ok >")

    def close(self):
        self._socket.close()

    def _send(self, text):
        try:
            self._socket.sendall(text.encode())
        except OSError as error:
            raise Lost(str(error)) from error

    def _message(self):
        while b">" not in self._rest:
            try:
                received = self._socket.recv(4096)
            except OSError as error:
                raise Lost(str(error)) from error
            if not received:
                raise Lost("the line has closed the connection")
            self._rest += received
        message, _, self._rest = self._rest.partition(b">")
        return message.strip() + b" >"

    def _read_until(self, wanted):
        while self._message() != wanted:
            pass

    def begin(self, node, data):
        """Sends an SDO request."""
        self._send(f"< send {0x600 + node:x} 8 {' '.join(f'{byte:02x}' for byte in data)} >")

    def end(self, node):
        """Waits for the answer; its bytes."""
        wanted = f"{0x580 + node:x}"
        while True:
            words = self._message().decode().split()
            if words[:2] == ["<", "frame"] and words[2].lower() == wanted:
                return bytes.fromhex(words[4])

    def _ask(self, node, data):
        self.begin(node, data)
        answer = self.end(node)
        if answer[0] == 0x80:
            raise SdoError(f"abort {int.from_bytes(answer[4:8], 'little'):08X}h")
        return answer

    def write(self, node, index, sub, value, size):
        """An expedited download."""
        self._ask(node, write_request(index, sub, value, size))

    def read(self, node, index, sub=0):
        """An expedited upload; unsigned."""
        answer = self._ask(node, bytes([0x40]) + index.to_bytes(2, "little") + bytes([sub, 0, 0, 0, 0]))
        size = 4 - (answer[0] >> 2 & 3)
        return int.from_bytes(answer[4 : 4 + size], "little")


def write_request(index, sub, value, size):
    """The bytes of an expedited download."""
    command = 0x23 | (4 - size) << 2
    return bytes([command]) + index.to_bytes(2, "little") + bytes([sub]) + value.to_bytes(size, "little").ljust(4, b"\0")
