"""Slow, half-open and hostile clients for the ports of `servodrome up`. `python hostile.py KIND LINK SECONDS SEED` is one.

A kind ends by itself; it continues if the line closes the connection.
"""

import base64
import contextlib
import os
import random
import select
import socket
import struct
import sys
import time

SOCKETCAND_BEGIN = b"< open can0 >< rawmode >"
SOCKETCAND_REQUEST = b"< send 601 8 40 00 10 00 00 00 00 00 >"
MODBUS_REQUEST = bytes.fromhex("000100000006020300000001")
RTU_REQUEST = bytes.fromhex("0203000000018439")
HTTP_REQUEST = b"GET /api/v1/axes/x/objects HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n"
SLCAN_REQUEST = b"O\rt60184000100000000000\r"
ETHERCAT = b"\x88\xa4"
CHANNELS = ",".join('{"axis":"x","signal":"velocity_rpm"}' for _ in range(16))
SUBSCRIBE = '{"subscribe":{"id":1,"rate_hz":16000,"channels":[' + CHANNELS + "]}}"


def connect(link):
    """A TCP connection to socketcand:, tcp: or http:; None if the line refuses it."""
    address = link.split("//")[-1] if link.startswith("http") else link.partition(":")[2]
    host, _, port = address.split("/")[0].rpartition(":")
    try:
        return socket.create_connection((host, int(port)), 2.0)
    except OSError:
        return None


def good_words(link):
    """Returns bytes with which a correct client of this link begins, and a request that it repeats."""
    if link.startswith("socketcand"):
        return SOCKETCAND_BEGIN, SOCKETCAND_REQUEST
    if link.startswith("http"):
        return b"", HTTP_REQUEST
    return b"", MODBUS_REQUEST


def reset(connection):
    """Closes it with RST."""
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    connection.close()


def until(end):
    while time.monotonic() < end:
        yield


def connections_until(link, end):
    """Yields new connections, one after the other; tries a refused connection again."""
    for _ in until(end):
        connection = connect(link)
        if connection is None:
            time.sleep(0.05)
        else:
            yield connection


# ---- TCP ----


def silent(link, end, _draw):
    """Opens more connections than the port accepts, and sends nothing."""
    connections = []
    for _ in until(end):
        connections.append(connect(link))
        if len(connections) > 60:
            oldest = connections.pop(0)
            if oldest is not None:
                oldest.close()
        time.sleep(0.05)


def slow(link, end, _draw):
    """Sends a valid request, one byte at a time."""
    first, request = good_words(link)
    while time.monotonic() < end:
        with contextlib.suppress(OSError), contextlib.closing(connect(link) or socket.socket()) as connection:
            for byte in (first + request) * 4:
                connection.sendall(bytes([byte]))
                time.sleep(0.02)
                if time.monotonic() > end:
                    return


def broken(link, end, draw):
    """Connects, sends a part of a request and disconnects, often with RST."""
    first, request = good_words(link)
    for connection in connections_until(link, end):
        with contextlib.suppress(OSError):
            connection.sendall((first + request)[: draw.randrange(len(first + request) + 1)])
            reset(connection) if draw.random() < 0.7 else connection.close()
        time.sleep(0.005)


def garbage(link, end, draw):
    """Sends random bytes."""
    for connection in connections_until(link, end):
        with contextlib.suppress(OSError), connection:
            for _ in range(50):
                connection.sendall(draw.randbytes(draw.randrange(1, 2000)))
                time.sleep(0.005)


def deaf(link, end, _draw):
    """Sends valid requests and never reads an answer."""
    first, request = good_words(link)
    for connection in connections_until(link, end):
        with contextlib.suppress(OSError), connection:
            connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
            connection.sendall(first)
            connection.settimeout(0.5)
            for _ in until(min(end, time.monotonic() + 5)):
                connection.sendall(request * 8)
                time.sleep(0.005)


def huge(link, end, draw):
    """Announces or sends far more than a client is allowed to."""
    words = [
        b"< " + b"x" * 200_000,
        bytes.fromhex("00010000ffff0203") + b"\0" * 70_000,
        b"POST /api/v1/scenario HTTP/1.1\r\nHost: a\r\nContent-Length: 999999999999\r\n\r\n" + b"{" * 200_000,
        b"GET /" + b"a" * 200_000 + b" HTTP/1.1\r\n\r\n",
        b"GET / HTTP/1.1\r\n" + b"a: b\r\n" * 40_000,
        b"POST /api/v1/stop HTTP/1.1\r\nTransfer-Encoding: chunked\r\n\r\n" + b"fffffffffffffffff\r\n",
    ]
    for connection in connections_until(link, end):
        with contextlib.suppress(OSError), connection:
            connection.settimeout(0.5)
            connection.sendall(draw.choice(words))
        time.sleep(0.02)


def stream(link, end, _draw):
    """A WebSocket that subscribes to the maximum and reads nothing."""
    host = link.split("//")[-1].split("/")[0]
    handshake = (
        f"GET /api/v1/stream HTTP/1.1\r\nHost: {host}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        f"Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: {base64.b64encode(os.urandom(16)).decode()}\r\n\r\n"
    )
    payload = SUBSCRIBE.encode()
    message = b"\x81\xfe" + struct.pack(">H", len(payload)) + b"\0\0\0\0" + payload
    connections = []
    for _ in until(end):
        connection = connect(link)
        if connection is not None:
            with contextlib.suppress(OSError):
                connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
                connection.sendall(handshake.encode() + message)
                connections.append(connection)
        while len(connections) > 10:
            reset(connections.pop(0))
        time.sleep(0.3)


# ---- UDP, Ethernet and ptys ----


def datagrams(link, end, draw):
    """Sends datagrams of every size and content, frames with wrong lengths, and valid frames of another master that
    only reads."""
    host, _, port = link.removeprefix("udp:").rpartition(":")
    address = (host, int(port))
    other = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    good = struct.pack("<H", 0x100E) + struct.pack("<BBHHHH", 7, 0, 0, 0x0130, 2, 0) + b"\0\0" + b"\0\0"
    for _ in until(end):
        kind = draw.randrange(4)
        if kind == 0:
            # Random content with the EtherType of EtherCAT could be a command that stops the slaves, so the type is
            # changed.
            content = draw.randbytes(draw.choice((0, 1, 2, 11, 60, 1472, 9000)))
            content = content[:1] + bytes([content[1] & 0x0F | 0x20]) + content[2:] if len(content) > 1 else content
        elif kind == 1:
            content = struct.pack("<H", 0x1000 | draw.randrange(2048)) + good[2 : draw.randrange(3, len(good))]
        else:
            content = good
        with contextlib.suppress(OSError):
            other.sendto(content, address)
        if draw.randrange(100) == 0:
            other.close()
            other = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        time.sleep(0.001)


def frames(link, end, draw):
    """Sends Ethernet frames of every size and type, EtherCAT frames with wrong lengths, and valid ones of another
    master that only reads."""
    other = socket.socket(socket.AF_PACKET, socket.SOCK_RAW)
    other.bind((link.removeprefix("raw:"), 0))
    good = struct.pack("<H", 0x100E) + struct.pack("<BBHHHH", 7, 0, 0, 0x0130, 2, 0) + b"\0\0" + b"\0\0"
    for _ in until(end):
        kind = draw.randrange(5)
        ether_type = ETHERCAT
        if kind == 0:  # not EtherCAT, so that its content commands no slave
            ether_type = draw.choice((b"\x08\x00", b"\x08\x06", b"\x86\xdd", b"\xff\xff", b"\0\0"))
            content = draw.randbytes(draw.choice((0, 1, 46, 60, 1500)))
        elif kind == 1:  # EtherCAT of another type than commands
            content = struct.pack("<H", draw.choice((0, 0x2000, 0x4000, 0xF000)) | draw.randrange(2048))
            content += draw.randbytes(draw.choice((0, 1, 11, 60, 1400)))
        elif kind == 2:
            content = struct.pack("<H", 0x1000 | draw.randrange(2048)) + good[2 : draw.randrange(3, len(good))]
        elif kind == 3:
            ether_type, content = b"\x81\x00", draw.randbytes(2) + ETHERCAT + good
        else:
            content = good
        with contextlib.suppress(OSError):
            other.send(b"\xff" * 6 + draw.randbytes(6) + ether_type + content)
        time.sleep(0.001)


def open_pty(link):
    import tty

    file = os.open(link.partition(":")[2], os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    tty.setraw(file)
    return file


def pty_deaf(link, end, _draw):
    """Sends valid requests and never reads."""
    request = SLCAN_REQUEST if link.startswith("slcan") else RTU_REQUEST
    file = open_pty(link)
    for _ in until(end):
        with contextlib.suppress(OSError):
            os.write(file, request)
        time.sleep(0.002)
    os.close(file)


def pty_garbage(link, end, draw):
    """Sends random bytes and parts of requests; opens and closes the port."""
    request = SLCAN_REQUEST if link.startswith("slcan") else RTU_REQUEST
    for _ in until(end):
        file = open_pty(link)
        for _ in range(draw.randrange(20)):
            content = draw.randbytes(draw.randrange(1, 300)) if draw.random() < 0.7 else request[: draw.randrange(9)]
            with contextlib.suppress(OSError):
                os.write(file, content)
            if draw.random() < 0.3 and select.select([file], [], [], 0)[0]:
                with contextlib.suppress(OSError):
                    os.read(file, 100)
            time.sleep(0.002)
        os.close(file)


TCP = (silent, slow, broken, garbage, deaf, huge)
KINDS = {function.__name__: function for function in (*TCP, stream, datagrams, frames, pty_deaf, pty_garbage)}


def kinds_for(link):
    """The names of the kinds for a link."""
    scheme = link.partition(":")[0]
    if scheme == "udp":
        return ["datagrams"]
    if scheme == "raw":
        return ["frames"]
    if scheme in ("pty", "slcan"):
        return ["pty_deaf", "pty_garbage"]
    return [function.__name__ for function in TCP] + (["stream"] if scheme == "http" else [])


def main():
    kind, link, seconds, seed = sys.argv[1:]
    KINDS[kind](link, time.monotonic() + float(seconds), random.Random(int(seed)))


if __name__ == "__main__":
    main()
