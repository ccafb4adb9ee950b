"""Every mode of operation over process data, compared with the true shaft."""

import pytest
from drive402 import (
    CYCLIC_POSITION,
    CYCLIC_TORQUE,
    CYCLIC_VELOCITY,
    PROFILE_POSITION,
    PROFILE_TORQUE,
    PROFILE_VELOCITY,
)
from line import COUNTS, START

CYCLE_NS = 2_000_000
MODES = [(0x6040, 0, 16), (0x6060, 0, 8), (0x607A, 0, 32), (0x60FF, 0, 32), (0x6071, 0, 16)]
FEEDBACK = [(0x6041, 0, 16), (0x6061, 0, 8), (0x6064, 0, 32), (0x606C, 0, 32), (0x6077, 0, 16), (0x603F, 0, 16)]


@pytest.fixture(params=["DC", "free run"])
def running(request, master, drives):
    """The first drive, operational, its process data laid out for all modes."""
    for drive in drives:
        drive.remap(0x1C12, MODES, 0x1600)
        drive.remap(0x1C13, FEEDBACK, 0x1A00)
        drive.download(0x10F1, 0, 2)  # a busy machine is no fault of the drive's
        drive.learn_mapping()
    clocked = request.param == "DC"
    master.run(dc_cycle_ns=CYCLE_NS if clocked else None)
    assert (drives[0].upload(0x1C32, 1) == 2) == clocked  # by SYNC0
    return drives[0]


def enable(drive, mode):
    drive.set_mode(mode)
    drive.write(0x607A, drive.position)
    drive.write(0x60FF, 0)
    drive.write(0x6071, 0)
    drive.enable()


def moved(drive, position, tolerance=COUNTS // 500):
    drive.wait_standstill()
    assert abs(drive.true_position - position) <= tolerance, (drive.true_position, position)


def ramp(drive, start, end, speed):
    """A step for each cycle: 607Ah from start to end, `speed` counts per cycle."""
    sign = 1 if end >= start else -1

    first = drive.master.cycles

    def step(cycle):
        distance = min(abs(end - start), speed * (cycle - first))
        drive.values[0x607A, 0] = start + sign * distance

    return step


def test_cyclic_position(running, master):
    enable(running, CYCLIC_POSITION)
    for target in (START + COUNTS, START - COUNTS // 2):
        running.master.each_cycle.insert(0, ramp(running, running.values[0x607A, 0], target, 500))
        master.wait(lambda: running.values[0x607A, 0] == target, "the set-points")
        master.wait(lambda: abs(running.position - target) <= COUNTS // 500, lambda: f"{target}, is {running.position}")
        master.each_cycle.pop(0)
        moved(running, target)
    assert running.state == "Operation enabled"


def test_cyclic_velocity(running, master):
    enable(running, CYCLIC_VELOCITY)
    before = running.true_position
    running.write(0x60FF, COUNTS)
    master.wait(lambda: running.true_position - before > COUNTS, "a revolution")
    assert abs(running.get(0x606C) - COUNTS) < COUNTS // 20
    assert running.bench.axis(running.name)["velocity_rpm"] == pytest.approx(60, rel=0.05)
    running.write(0x60FF, 0)
    running.wait_standstill()
    assert running.state == "Operation enabled"


def test_cyclic_torque(running, master):
    enable(running, CYCLIC_TORQUE)
    before = running.true_position
    running.write(0x6071, 100)
    master.wait(lambda: running.true_position - before > COUNTS // 8, "the shaft to turn")
    assert running.get(0x6077) == pytest.approx(100, abs=10)
    assert running.bench.axis(running.name)["velocity_rpm"] > 0
    running.write(0x6071, 0)
    running.control(0x06)
    running.wait_standstill()


def test_profile_position(running):
    enable(running, PROFILE_POSITION)
    running.set_ramps()
    running.move_to(START + 2 * COUNTS)
    moved(running, START + 2 * COUNTS)
    running.move_to(-COUNTS, relative=True)
    moved(running, START + COUNTS)


def test_profile_velocity(running, master):
    enable(running, PROFILE_VELOCITY)
    running.set_ramps()
    running.write(0x60FF, -COUNTS)
    before = running.true_position
    running.wait_bits(1 << 10, 1 << 10)
    master.wait(lambda: before - running.true_position > COUNTS // 2, "the shaft to turn")
    assert running.get(0x606C) == pytest.approx(-COUNTS, rel=0.05)
    running.write(0x60FF, 0)
    running.wait_standstill()


def test_profile_torque(running, master):
    running.write(0x6087, 1000)
    enable(running, PROFILE_TORQUE)
    before = running.true_position
    running.write(0x6071, -100)
    master.wait(lambda: before - running.true_position > COUNTS // 8, "the shaft to turn")
    running.write(0x6071, 0)
    running.control(0x06)
    running.wait_standstill()


def test_homing(running):
    """Method 24, the home switch from the positive side, then a move in the homed frame."""
    running.home(24)
    edge = running.true_position - running.position
    assert abs(abs(edge) - COUNTS // 2) <= COUNTS // 500
    running.control(0x06)
    running.set_mode(PROFILE_POSITION)
    running.write(0x607A, running.position)
    running.enable()
    running.set_ramps()
    running.move_to(COUNTS)
    moved(running, edge + COUNTS)
