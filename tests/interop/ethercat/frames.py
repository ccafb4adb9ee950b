"""A small EtherCAT master that composes its frames (ETG.1000.4 clause 5), over UDP or an Ethernet interface."""

import socket
import struct

from line import PATIENCE

NOP, APRD, APWR, APRW, FPRD, FPWR, FPRW, BRD, BWR, BRW, LRD, LWR, LRW, ARMW, FRMW = range(15)
ETHERTYPE = 0x88A4


def datagram(command, address, data, index=0, more=False):
    """`address`: (ADP, ADO), or a logical address."""
    place = struct.pack("<I", address) if isinstance(address, int) else struct.pack("<HH", *address)
    length = len(data) | (0x8000 if more else 0)
    return struct.pack("<BB", command, index) + place + struct.pack("<HH", length, 0) + data + b"\0\0"


def content(*datagrams):
    body = b"".join(datagrams)
    return struct.pack("<H", len(body) | 0x1000) + body


def taken_apart(received):
    """Returns [(command, index, address as 32 bits, data, working counter)] of a frame's content."""
    (header,) = struct.unpack_from("<H", received)
    assert header >> 12 == 1
    end, at, found = 2 + (header & 0x7FF), 2, []
    while at < end:
        command, index, address, length, _ = struct.unpack_from("<BBIHH", received, at)
        data = received[at + 10 : at + 10 + (length & 0x7FF)]
        (counter,) = struct.unpack_from("<H", received, at + 10 + len(data))
        found.append((command, index, address, data, counter))
        at += 12 + len(data)
        if not length & 0x8000:
            break
    return found


class UdpLink:
    def __init__(self, host, port):
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.settimeout(PATIENCE)
        self.socket.connect((host, int(port)))

    def exchange(self, payload):
        self.socket.send(payload)
        return self.socket.recv(2048)

    def close(self):
        self.socket.close()


class RawLink:
    """Uses its own source address; in answers the second bit of that address is inverted (ETG.1000.4 5.3.3)."""

    SOURCE = bytes.fromhex("001b19000001")
    ANSWER = bytes.fromhex("021b19000001")

    def __init__(self, interface):
        self.socket = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(ETHERTYPE))
        self.socket.bind((interface, ETHERTYPE))
        self.socket.settimeout(PATIENCE)

    def send(self, payload, destination=b"\xff" * 6):
        self.socket.send((destination + self.SOURCE + struct.pack(">H", ETHERTYPE) + payload).ljust(60, b"\0"))

    def receive(self):
        while True:
            frame = self.socket.recv(2048)
            if frame[6:12] == self.ANSWER:
                return frame[14:]

    def exchange(self, payload):
        self.send(payload)
        return self.receive()

    def close(self):
        self.socket.close()


class FrameMaster:
    def __init__(self, link):
        self.link = link
        self.index = 0

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.link.close()

    def exchange(self, *requests):
        """Sends datagrams (command, address, data) in one frame; returns (data, working counter) of each."""
        self.index = (self.index + 1) & 0xFF
        last = len(requests) - 1
        frame = content(*(datagram(*request, self.index, n < last) for n, request in enumerate(requests)))
        answer = taken_apart(self.link.exchange(frame))
        assert [(command, index) for command, index, *_ in answer] == [(r[0], self.index) for r in requests]
        return [(data, counter) for *_, data, counter in answer]

    def read(self, command, address, size):
        return self.exchange((command, address, bytes(size)))[0]

    def count(self):
        return self.read(BRD, (0, 0x0000), 1)[1]

    def read_sii(self, position, word):
        """Reads four bytes of a slave's information memory (ETG.1000.4 6.4)."""
        adp = -position & 0xFFFF
        for owner in (2, 0):  # forces the access, in case another master gave it to the slave
            assert self.exchange((APWR, (adp, 0x0500), bytes((owner,))))[0][1] == 1
        assert self.exchange((APWR, (adp, 0x0502), struct.pack("<HI", 0x0100, word)))[0][1] == 1
        while True:
            control, counter = self.read(APRD, (adp, 0x0502), 2)
            assert counter == 1
            if not control[1] & 0x80:
                return self.read(APRD, (adp, 0x0508), 4)[0]
