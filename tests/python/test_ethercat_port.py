"""A master that composes Ethernet frames, on an EtherCAT segment of a line in this process."""

import struct
import threading
import time

import pytest
import servodrome
from servodrome.ethercat import EthercatPort
from servodrome.virtual_time import virtual_time

APRD, APWR, FPRD, FPWR, BRD, BWR = 1, 2, 4, 5, 7, 8
HEADER = b"\xff" * 6 + bytes.fromhex("001b19000001") + struct.pack(">H", 0x88A4)
STATION = 0x1001


@pytest.fixture
def line():
    with servodrome.Line(axes=[servodrome.Axis("a", "generic402-ec"), servodrome.Axis("b", "generic402-ec")]) as opened:
        yield opened


@pytest.fixture
def port(line):
    with EthercatPort(line) as opened:
        yield opened


def ask(port, command, slave, register, data):
    """Sends one datagram; returns its data and working counter."""
    body = struct.pack("<BBHHHH", command, 7, slave & 0xFFFF, register, len(data), 0) + data + b"\0\0"
    frame = HEADER + struct.pack("<H", len(body) | 0x1000) + body
    answer = port.exchange(frame.ljust(60, b"\0"))
    assert answer[12:14] == b"\x88\xa4" and answer[16:18] == bytes((command, 7))
    return answer[26 : 26 + len(data)], struct.unpack_from("<H", answer, 26 + len(data))[0]


def write(port, slave, register, data):
    assert ask(port, FPWR, slave, register, data)[1] == 1


def set_state(port, line, state):
    write(port, STATION, 0x0120, struct.pack("<H", state))
    for _ in range(1000):
        status = struct.unpack("<H", ask(port, FPRD, STATION, 0x0130, bytes(2))[0])[0]
        if status == state:
            return
        assert not status & 0x10, f"AL status {status:04X}h"
        line.advance(0.001)
    pytest.fail(f"AL status {status:04X}h, not {state:04X}h")


def read_sii(port, line, word):
    """Reads four bytes of the slave's information memory (ETG.1000.4 6.4), as two words."""
    write(port, STATION, 0x0502, struct.pack("<HI", 0x0100, word))
    while ask(port, FPRD, STATION, 0x0502, bytes(2))[0][1] & 0x80:
        line.advance(0.001)
    return struct.unpack("<HH", ask(port, FPRD, STATION, 0x0508, bytes(4))[0])


def to_preop(port, line):
    """Configures the mailboxes of the information memory (ETG.1000.6 table 17): where to write, where to read, and
    their
    sizes."""
    assert ask(port, APWR, 0, 0x0010, struct.pack("<H", STATION))[1] == 1
    mailboxes = read_sii(port, line, 0x18) + read_sii(port, line, 0x1A)
    for number, control in ((0, 0x26), (1, 0x22)):
        start, size = mailboxes[2 * number : 2 * number + 2]
        write(port, STATION, 0x0800 + 8 * number, struct.pack("<HHBBBB", start, size, control, 0, 1, 0))
    set_state(port, line, 2)
    return mailboxes


def read_object(port, line, mailboxes, index, sub):
    """A CoE SDO upload, expedited (ETG.1000.6 5.6.2)."""
    out, out_size, back, back_size = mailboxes
    request = struct.pack("<HHBB", 10, 0, 0, 0x13) + struct.pack("<HBHBI", 2 << 12, 0x40, index, sub, 0)
    write(port, STATION, out, request.ljust(out_size, b"\0"))
    for _ in range(100):
        answer, counter = ask(port, FPRD, STATION, back, bytes(back_size))
        if counter == 1:
            break
        line.advance(0.001)
    assert answer[5] & 0x0F == 3 and struct.unpack_from("<H", answer, 6)[0] >> 12 == 3
    assert answer[8] & 0xE2 == 0x42 and struct.unpack_from("<HB", answer, 9) == (index, sub)
    return answer[12:16]


def test_states_and_mailbox_of_a_slave(line, port):
    status, counter = ask(port, BRD, 0, 0x0130, bytes(2))
    assert (status, counter) == (b"\x01\x00", 2), "both slaves are in Init"
    mailboxes = to_preop(port, line)
    assert read_object(port, line, mailboxes, 0x1000, 0) == bytes.fromhex("92010200")
    assert ask(port, BRD, 0, 0x0130, bytes(2)) == (b"\x03\x00", 2), "one is in Pre-Operational, one in Init"
    assert line.buses["ecat"].view()["axes"]["a"]["state"] == "Pre-Operational"


def test_frames_take_line_time(line, port):
    frame = HEADER + struct.pack("<H", 14 | 0x1000) + bytes(44)  # a NOP datagram
    before = line.now
    port.send(frame)
    assert port.receive(0) is None and line.now == before
    assert port.receive(1)[12:14] == b"\x88\xa4"
    assert before < line.now < before + 1e-4
    assert port.receive(0.25) is None and line.now == pytest.approx(before + 0.25, abs=1e-4)


def test_a_cut_cable(line, port):
    line.buses["ecat"].disturb(unplug=1)
    with pytest.raises(servodrome.Timeout, match="did not come back"):
        port.exchange(HEADER + bytes(46), timeout=0.01)


def test_in_virtual_time(line):
    stamps = []

    def cycle(port):
        for _ in range(5):
            ask(port, BRD, 0, 0x0130, bytes(2))
            stamps.append(line.now)
            time.sleep(0.001)

    with virtual_time(line), EthercatPort(line) as port:
        thread = threading.Thread(target=cycle, args=(port,))
        thread.start()
        time.sleep(0.0025)
        assert len(stamps) == 3
        thread.join()
    assert [second - first for first, second in zip(stamps, stamps[1:])] == pytest.approx([0.001] * 4, abs=1e-4)


def test_what_is_refused(line, port):
    for frame in (b"", bytes(13), bytes(1515)):
        with pytest.raises(servodrome.BadValue, match="14 .. 1514"):
            port.send(frame)
    with pytest.raises(servodrome.WrongType):
        port.send("frame")
    with pytest.raises(servodrome.UnknownName):
        EthercatPort(line, "no")
    port.close()
    port.close()
    with pytest.raises(servodrome.Closed):
        port.receive(1)
