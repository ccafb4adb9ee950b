"""A python-can bus on a link of the line, with the `canopen` package on top, and a recorder of its frames."""

import socket
import threading
import time

import can
import canopen

from line import PATIENCE, wait_for

# The package's timeout is 0.3 s, which is too short on a busy machine. These tests do not judge response times.
canopen.sdo.SdoClient.RESPONSE_TIMEOUT = PATIENCE
SO_RCVBUFFORCE = 33  # Linux: SO_RCVBUF without the system's limit, for root (as in tools/with-socketcan)


def open_bus(link):
    """Returns python-can's interface for a link name that `servodrome up` prints."""
    kind, _, rest = link.partition(":")
    if kind == "socketcand":
        address, _, name = rest.rpartition("/")
        host, _, port = address.rpartition(":")
        return can.Bus(interface="socketcand", host=host, port=int(port), channel=name)
    if kind == "slcan":
        bus = can.Bus(interface="slcan", channel=rest, bitrate=1_000_000, sleep_after_open=0)
        # The client does not wait for the answer to "open". The next answer shows that the channel is open.
        assert bus.get_version(timeout=PATIENCE) != (None, None)
        return bus
    if kind == "memory":
        return can.Bus(interface="servodrome", channel=rest)
    assert kind == "socketcan", link
    bus = can.Bus(interface="socketcan", channel=rest)
    # After a pause of some ten milliseconds the line sends all overdue frames in one burst, which exceeds the default
    # size of a socket's buffer.
    bus.socket.setsockopt(socket.SOL_SOCKET, SO_RCVBUFFORCE, 4 << 20)
    return bus


class Recorder(can.Listener):
    """Records all received frames, and can wait for frames."""

    def __init__(self):
        self.frames = []
        self.lock = threading.Lock()

    def on_message_received(self, msg):
        with self.lock:
            self.frames.append(msg)

    def clear(self):
        with self.lock:
            self.frames.clear()

    def of(self, identifier):
        with self.lock:
            return [frame for frame in self.frames if frame.arbitration_id == identifier]

    def data(self, identifier):
        return [bytes(frame.data) for frame in self.of(identifier)]

    def wait(self, identifier, count=1, seconds=PATIENCE):
        """Returns the data of the first `count` frames of an identifier."""
        wait_for(
            lambda: len(self.of(identifier)) >= count,
            lambda: f"{count} frames {identifier:03X}h, have {len(self.of(identifier))}",
            seconds,
        )
        return self.data(identifier)[:count]


class Network(canopen.Network):
    def __init__(self, link):
        super().__init__(open_bus(link))
        self.seen = Recorder()
        self.listeners.append(self.seen)
        self.connect()

    def send(self, identifier, data=b"", remote=False):
        self.send_message(identifier, bytes(data), remote=remote)

    def send_sync(self):
        self.send(0x080)

    def settle(self, node_id):
        """Returns when that node has processed all earlier frames, because it has answered a request that was sent
        after
        them."""
        answers = len(self.seen.of(0x580 + node_id))
        self.send(0x600 + node_id, bytes.fromhex("4000100000000000"))
        self.seen.wait(0x580 + node_id, answers + 1)

    def quiet(self, seconds=0.2):
        """Waits, for tests of frames that must not arrive. It can only show that no frame arrived in this time."""
        time.sleep(seconds)
