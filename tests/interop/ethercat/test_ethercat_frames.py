"""A master that composes its frames, over UDP: the effect of each command, byte by byte."""

import struct

import pytest
from frames import (
    APRD,
    APRW,
    APWR,
    ARMW,
    BRD,
    BRW,
    BWR,
    FPRD,
    FPRW,
    FPWR,
    FRMW,
    LRD,
    LRW,
    LWR,
    NOP,
    FrameMaster,
    UdpLink,
)
from segment import segment

COUNT = 3


@pytest.fixture
def line(start_line):
    return start_line(segment(COUNT, serial_number=lambda n: 40 + n), link="udp:127.0.0.1:0")


@pytest.fixture
def frames(line):
    (name,) = line.links["ecat"]
    host, port = name.removeprefix("udp:").rsplit(":", 1)
    with FrameMaster(UdpLink(host, port)) as master:
        yield master


def test_scan(frames):
    assert frames.count() == COUNT
    assert [struct.unpack("<I", frames.read_sii(n, 14)) for n in range(COUNT)] == [(41,), (42,), (43,)]
    for n in range(COUNT):
        assert frames.exchange((APWR, (-n & 0xFFFF, 0x0010), struct.pack("<H", 0x1001 + n)))[0][1] == 1
    assert [frames.read(FPRD, (0x1001 + n, 0x0010), 2) for n in range(COUNT)] == [
        (struct.pack("<H", 0x1001 + n), 1) for n in range(COUNT)
    ]


def test_working_counters(frames):
    """All commands (ETG.1000.4 5.4): per slave a read counts 1, a write 1, a read and write in one command 3."""
    for n in range(COUNT):
        frames.exchange((APWR, (-n & 0xFFFF, 0x0010), struct.pack("<H", 0x1001 + n)))
    word, place = b"\0\0", 0x0F80  # user RAM
    expected = [
        (NOP, (0, place), 0),
        (APRD, (0xFFFF, place), 1),
        (APWR, (0xFFFF, place), 1),
        (APRW, (0xFFFF, place), 3),
        (FPRD, (0x1002, place), 1),
        (FPWR, (0x1002, place), 1),
        (FPRW, (0x1002, place), 3),
        (FPRD, (0x2002, place), 0),
        (BRD, (0, place), COUNT),
        (BWR, (0, place), COUNT),
        (BRW, (0, place), 3 * COUNT),
        (ARMW, (0, place), COUNT),
        (FRMW, (0x1001, place), COUNT),
        (LRD, 0x10000, 0),
        (LWR, 0x10000, 0),
        (LRW, 0x10000, 0),
    ]
    answers = frames.exchange(*((command, address, word) for command, address, _ in expected))
    assert [counter for _, counter in answers] == [counter for *_, counter in expected]


def test_sdo_upload_byte_by_byte(frames, line):
    """Reads 1018h:02 of the second slave: station addresses, mailbox sync managers, Pre-Operational."""
    for n in range(COUNT):
        frames.exchange((APWR, (-n & 0xFFFF, 0x0010), struct.pack("<H", 0x1001 + n)))
    station = 0x1002
    managers = bytes.fromhex("0010 0001 26 00 01 00  0011 0001 22 00 01 00")
    assert frames.exchange((FPWR, (station, 0x0800), managers))[0][1] == 1
    frames.exchange((FPWR, (station, 0x0120), b"\2\0"))
    while frames.read(FPRD, (station, 0x0130), 2)[0] != b"\2\0":
        pass
    request = bytes.fromhex("0a00 0000 00 13  0020 40 1810 02 00000000").ljust(256, b"\0")
    assert frames.exchange((FPWR, (station, 0x1000), request))[0][1] == 1
    while not frames.read(FPRD, (station, 0x080D), 1)[0][0] & 8:  # mailbox full
        pass
    answer, counter = frames.read(FPRD, (station, 0x1100), 256)
    assert counter == 1
    assert answer[:16].hex(" ") == "0a 00 00 00 00 13 00 30 43 18 10 02 45 32 30 34"
    assert frames.read(FPRD, (station, 0x1100), 256)[1] == 0  # the mailbox has been read
    axes = line.bench.get("buses/ecat")["axes"]
    assert [axes[f"drive{n}"]["state"] for n in (1, 2, 3)] == ["Init", "Pre-Operational", "Init"]
