"""A master starts distributed clocks; the oscillators deviate and the cables have different lengths."""

import struct

from master import OP
from segment import segment

PPM = [0, 100, -100, 37, -64]
CABLE_NS = [0, 500, 2500, 10, 1000]
CYCLE_NS = 2_000_000


def register(slave, address, size):
    return int.from_bytes(slave._fprd(address, size, 1_000_000), "little")


def difference_ns(slave):
    """092Ch: sign and amount of the difference between the local system time and the received one."""
    value = register(slave, 0x092C, 4)
    return value & 0x7FFFFFFF if value >> 31 else -value


def test_start_up(start_line, open_master):
    line = start_line(segment(5, oscillator_ppm=lambda n: PPM[n - 1], cable_ns=lambda n: CABLE_NS[n - 1]))
    master = open_master()
    assert master.scan() == 5
    for slave in master.slaves:
        slave.sdo_write(0x10F1, 2, b"\0\0")
    master.run(dc_cycle_ns=CYCLE_NS)

    # Transmission delays: the differences between neighbours are those of the cables.
    delays = [register(slave, 0x0928, 4) for slave in master.slaves]
    assert delays[0] == 0
    hops = [behind - before for before, behind in zip(delays, delays[1:])]
    shortest = hops[2] - CABLE_NS[3]
    assert 0 < shortest < 2000
    for hop, cable in zip(hops, CABLE_NS[1:]):
        assert abs(hop - shortest - cable) <= 20, hops

    # Every frame distributes the time of the reference clock; all other clocks follow it.
    master.wait(
        lambda: all(abs(difference_ns(slave)) < 1000 for slave in master.slaves[1:]),
        lambda: f"the clocks to agree: {[difference_ns(slave) for slave in master.slaves]}",
    )
    for slave in master.slaves:
        assert slave.sdo_read(0x1C32, 1) == b"\2\0"
        assert slave.sdo_read(0x1C32, 2) == struct.pack("<I", CYCLE_NS)
        start = register(slave, 0x0990, 8)
        assert start % CYCLE_NS == 0
    assert master.states() == [(OP, 0)] * 5
    assert line.bench.get("clock")["mode"] == "real"


def test_pulses_come_at_the_same_time(start_line, open_master):
    """The times of SYNC0 (0990h) of all slaves have the period and phase of the reference clock."""
    start_line(segment(3, oscillator_ppm=lambda n: 50 * n))
    master = open_master()
    assert master.scan() == 3
    for slave in master.slaves:
        slave.sdo_write(0x10F1, 2, b"\0\0")
    master.run(dc_cycle_ns=CYCLE_NS)
    master.pass_cycles(200)
    for _ in range(20):
        starts = [register(slave, 0x0990, 8) for slave in master.slaves]
        assert len({start % CYCLE_NS for start in starts}) == 1, starts
