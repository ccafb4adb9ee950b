"""Faults of a machine: cables, power, drives, and masters."""

import random
import signal
import struct
import subprocess
import sys
from pathlib import Path

import pysoem
import pytest
from drive import Drive
from frames import BRD, FPRD, FrameMaster, RawLink, UdpLink
from line import ApiError, wait_for
from master import OP, PREOP
from segment import segment


@pytest.fixture
def line(start_line):
    return start_line(segment(3))


@pytest.fixture
def master(line, open_master):
    opened = open_master()
    assert opened.scan() == 3
    return opened


def states(bench):
    axes = bench.get("buses/ecat")["axes"]
    return [(axes[f"drive{n}"].get("state"), axes[f"drive{n}"].get("status_code")) for n in (1, 2, 3)]


def expect_counter(master, value):
    master.wait(lambda: master.working_counter == value, lambda: f"{value}, is {master.working_counter}")


@pytest.mark.parametrize("cable, left", [(3, 2), (2, 1)])
@pytest.mark.parametrize("dc_cycle_ns", [None, 2_000_000])
def test_a_cable_is_unplugged_and_plugged_in_again(bench, master, cable, left, dc_cycle_ns):
    """The slaves behind the cable detect the loss by their watchdog; the others continue. After the repair all return
    without a new scan."""
    for slave in master.slaves:
        slave.sdo_write(0x10F1, 2, b"\0\0")
    master.run(watchdog_ms=1000, dc_cycle_ns=dc_cycle_ns)
    expect_counter(master, 9)
    bench.post("buses/ecat/disturb", {"unplug": cable})
    assert bench.get("buses/ecat")["unplugged"] == [cable]
    expect_counter(master, 3 * left)
    master.wait(
        lambda: states(bench) == [("Operational", 0)] * left + [("Safe-Operational", 0x1B)] * (3 - left),
        lambda: f"the watchdogs: {states(bench)}",
    )
    assert master.working_counter == 3 * left
    bench.delete("buses/ecat/disturb")
    expect_counter(master, 9 - 2 * (3 - left))  # inputs are read, outputs are not accepted
    master.wait(master.mend, lambda: f"all Operational, are {master.states()}")
    expect_counter(master, 9)
    assert states(bench) == [("Operational", 0)] * 3


def test_no_cable_at_all(bench, master, open_master):
    bench.post("buses/ecat/disturb", {"unplug": 1})
    other = open_master()
    assert other.scan() <= 0
    bench.delete("buses/ecat/disturb")
    assert other.scan() == 3


def test_a_drive_is_switched_off_and_on_again(bench, master, objects):
    """The drive returns in Init without address and configuration, and the slaves behind it were disconnected."""
    drives = [Drive(master, n, bench, f"drive{n + 1}", objects("generic402-ec")) for n in range(3)]
    for drive in drives:
        drive.learn_mapping()
    master.run(watchdog_ms=1000)
    drives[1].enable()
    drives[2].enable()
    bench.post("axes/drive2/power", {"action": "off"})
    expect_counter(master, 3)
    master.wait(lambda: states(bench)[2] == ("Safe-Operational", 0x1B), "the last one's watchdog")
    assert bench.get("buses/ecat")["axes"]["drive2"] == {"position": 2, "powered": False}
    assert bench.axis("drive3")["state"] != "operation enabled"
    bench.post("axes/drive2/power", {"action": "on"})
    assert states(bench)[1] == ("Init", 0)
    master.wait(master.mend, lambda: f"all Operational, are {master.states()}")
    expect_counter(master, 9)
    assert [bytes(slave._fprd(0x0010, 2, 1_000_000)) for slave in master.slaves] == [
        struct.pack("<H", 0x1001 + n) for n in range(3)
    ]
    for drive in drives[1:]:
        drive.values[0x6040, 0] = 0
        if drive.state == "Fault":
            drive.reset_fault()
        drive.wait_state("Switch on disabled")
        drive.values[0x607A, 0] = drive.position
        drive.enable()


def test_emergency(bench, master, objects):
    """Code and register of a fault come through the mailbox, and again when the fault is reset."""
    drive = Drive(master, 1, bench, "drive2", objects("generic402-ec"))
    drive.learn_mapping()
    master.run()
    seen = []
    master.slaves[1].add_emergency_callback(seen.append)

    def come(count):
        master.slaves[1].mbx_receive()
        return len(seen) >= count

    bench.post("axes/drive2/faults", {"inject": "encoder_loss"})
    master.wait(lambda: come(1), "the emergency")
    assert seen[0].slave_pos == 2
    assert seen[0].error_code == drive.upload(0x603F) != 0
    assert seen[0].error_reg == drive.upload(0x1001) != 0
    drive.wait_state("Fault")
    bench.delete("axes/drive2/faults")
    drive.reset_fault()
    master.wait(lambda: come(2), "the end of it")
    assert (seen[-1].error_code, seen[-1].error_reg) == (0, 0)


def test_a_ring_holds_when_one_cable_breaks(start_line, open_master):
    """Uses both ports of the master; disconnects every cable in turn."""
    ring = start_line(segment(3), link="raw:servo0+servo1")
    ring.bench.post("buses/ecat/disturb", {"ring": True})
    master = open_master(ring=True)
    assert master.scan() == 3
    master.run()
    expect_counter(master, 9)
    for cable in (1, 2, 3):
        ring.bench.post("buses/ecat/disturb", {"unplug": cable, "ring": True})
        master.pass_cycles(3)
        expect_counter(master, 9)
        master.pass_cycles(20)
        expect_counter(master, 9)
        assert states(ring.bench) == [("Operational", 0)] * 3
        ring.bench.delete("buses/ecat/disturb")
        master.pass_cycles(3)
        expect_counter(master, 9)
    ring.bench.post("buses/ecat/disturb", {"unplug": 2, "ring": False})
    expect_counter(master, 3)


def test_frames_that_are_lost(bench, master):
    """Loses a tenth of all frames: process data continue, and mailbox transfers succeed if they are repeated (SOEM
    gives up a transfer if the frame that requests the repetition is lost as well)."""
    master.run()
    bench.post("buses/ecat/disturb", {"drop": 0.1, "seed": 5})
    master.pass_cycles(100)
    assert bench.get("buses/ecat")["dropped"] >= 3
    master.soem.sdo_read_timeout = 500_000

    def read():
        try:
            return master.slaves[2].sdo_read(0x1008, 0)
        except (pysoem.WkcError, pysoem.PacketError):
            return None

    for _ in range(20):
        assert master.wait(read, "an answer").startswith(b"Servodrome")
    bench.delete("buses/ecat/disturb")
    expect_counter(master, 9)
    assert master.states() == [(OP, 0)] * 3


def test_frames_that_come_broken_are_counted_where_they_break(bench, master):
    """The second slave counts invalid frames at its port 0 (0300h), the third one forwarded errors (0308h), because the
    second one has marked them. The first one counts them at port 1 when they come back."""
    master.run()
    bench.post("buses/ecat/disturb", {"corrupt": 1, "position": 2, "limit": 10})
    master.wait(lambda: bench.get("buses/ecat")["corrupted"] >= 10, "ten bad frames")
    bench.delete("buses/ecat/disturb")
    expect_counter(master, 9)
    first, second, third = (slave._fprd(0x0300, 0x0C, 1_000_000) for slave in master.slaves)
    invalid, forwarded = 0, 8
    assert (first[invalid], first[forwarded], first[forwarded + 1]) == (0, 0, 10)
    assert (second[invalid], second[forwarded]) == (10, 0)
    assert (third[invalid], third[forwarded]) == (0, 10)


class TestTwoMasters:
    def test_one_looks_while_the_other_one_drives(self, master, cables):
        master.run()
        with FrameMaster(RawLink(cables[0][0])) as other:
            for _ in range(50):
                assert other.count() == 3
                data, counter = other.read(BRD, (0, 0x0130), 2)
                assert (data, counter) == (struct.pack("<H", OP), 3)
                assert [other.read_sii(position, 8)[:4] for position in range(3)] == [struct.pack("<I", 0x53455256)] * 3
        expect_counter(master, 9)
        # SOEM may still take an answer for the other master as its own; then it knows no state.
        master.wait(lambda: master.states() == [(OP, 0)] * 3, "all three slaves operational")

    def test_on_two_links(self, start_line, line, open_master):
        """Two masters at the same time, over Ethernet and over UDP."""
        line.stop()
        both = start_line(segment(3), arguments=["--bus", "ecat=udp:127.0.0.1:0"])
        master = open_master()
        assert master.scan() == 3
        master.run()
        name = next(link for link in both.links["ecat"] if link.startswith("udp:"))
        with FrameMaster(UdpLink(*name[4:].rsplit(":", 1))) as other:
            assert other.read(FPRD, (0x1003, 0x0130), 2) == (struct.pack("<H", OP), 1)
            for _ in range(100):
                assert other.count() == 3
        expect_counter(master, 9)

    def test_one_takes_the_slaves_away(self, master, open_master, bench):
        """The second master's scan brings all slaves to Pre-Operational; the third one operates them again. (The first
        one does not continue: SOEM accepts answers for any SOEM on its interface.)"""
        master.run()
        master.stop_cycle()
        other = open_master()
        assert other.scan() == 3
        assert states(bench) == [("Pre-Operational", 0)] * 3
        master.close()
        other.close()
        third = open_master()
        assert third.scan() == 3
        third.run()
        assert states(bench) == [("Operational", 0)] * 3


CRASHING = """
import sys
sys.path[:0] = {path!r}
from master import Master
master = Master({interface!r})
master.scan()
master.run(dc_cycle_ns={dc})
print("operational", flush=True)
master.pass_cycles(10**9)
"""


@pytest.mark.parametrize("dc", [None, 2_000_000])
def test_a_master_is_killed(line, cables, open_master, dc):
    folder = Path(__file__).parent
    program = CRASHING.format(path=[str(folder), str(folder.parent)], interface=cables[0][0], dc=dc)
    crashing = subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, text=True)
    try:
        assert crashing.stdout.readline() == "operational\n"
        assert states(line.bench) == [("Operational", 0)] * 3
    finally:
        crashing.send_signal(signal.SIGKILL)
        crashing.wait()
        crashing.stdout.close()
    wait_for(lambda: all(state == "Safe-Operational" for state, _ in states(line.bench)), lambda: states(line.bench))
    master = open_master()
    assert master.scan() == 3
    assert master.states() == [(PREOP, 0)] * 3
    master.run(dc_cycle_ns=dc)


@pytest.mark.parametrize("seed", range(3))
def test_a_master_that_does_everything_wrong(start_line, cables, open_master, seed):
    """Sends thousands of frames with random commands, addresses and data; the next master's scan must work as usual.
    The test does not write data that intentionally survive a master: write protection, loops that a command closed, the
    information memory."""
    line = start_line(segment(3), log=None)  # no log, because the frames are invalid on purpose
    draw = random.Random(seed)
    places = [0x0000, 0x0010, 0x0110, 0x0120, 0x0200, 0x0300, 0x0420, 0x0600, 0x0620, 0x0800]
    places += [0x0806, 0x080E, 0x0816, 0x081E, 0x0910, 0x0920, 0x0980, 0x0981, 0x0990, 0x09A0, 0x1000, 0x1100, 0x1200]
    with FrameMaster(RawLink(cables[0][0])) as wrong:
        sent = 0
        for _ in range(2000):
            frame = bytearray(struct.pack("<H", 0x1000))
            for more in reversed(range(draw.randint(1, 4))):
                data = draw.randbytes(draw.choice((1, 2, 4, 8, 16, 64)))
                where = draw.choice(places) if draw.random() < 0.9 else draw.randrange(0x10000)
                who = draw.choice((0, 0xFFFF, 0xFFFE, 0x1001, 0x1002, draw.randrange(65536)))
                address = struct.pack("<HH", who, where)
                spared = ((0x0020, 0x0040), (0x0100, 0x0104), (0x0500, 0x0510))
                if any(where < end and where + len(data) > start for start, end in spared):
                    continue
                length = len(data) if draw.random() < 0.98 else draw.randrange(0x800)
                frame += struct.pack("<BB", draw.randrange(16), draw.randrange(256)) + address
                frame += struct.pack("<HH", length | (0x8000 if more else 0), draw.randrange(65536)) + data + b"\0\0"
            length = len(frame) - 2 if draw.random() < 0.98 else draw.randrange(0x800)
            frame[:2] = struct.pack("<H", length | 0x1000)
            wrong.link.send(bytes(frame))
            sent += 1
            if sent % 20 == 0:
                wait_for(lambda: line.bench.get("buses/ecat")["frames"] >= sent, "the line to have seen them")
    master = open_master()
    assert master.scan() == 3
    assert [state for state, _ in master.states()] == [PREOP] * 3, master.states()
    master.run()


def test_states_the_bench_refuses(bench):
    for body in ({"unplug": 0}, {"unplug": 4}, {"drop": 2}, {"unplugged": 1}):
        with pytest.raises(ApiError):
            bench.post("buses/ecat/disturb", body)
    assert bench.get("buses/ecat")["unplugged"] == []
