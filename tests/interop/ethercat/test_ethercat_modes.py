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
from drive import Drive
from segment import segment

CYCLE_NS = 2_000_000
MODES = [(0x6040, 0, 16), (0x6060, 0, 8), (0x607A, 0, 32), (0x60FF, 0, 32), (0x6071, 0, 16)]
FEEDBACK = [(0x6041, 0, 16), (0x6061, 0, 8), (0x6064, 0, 32), (0x606C, 0, 32), (0x6077, 0, 16), (0x603F, 0, 16)]


TURNS = {"generic402-ec": 131072, "jmc_ec": 4000}  # encoder counts per revolution, factory setting
START = 2  # revolutions
TRAVEL = """
  [axis.travel]
  counts_per_unit = {turn}
  start = 2
  low_stop = -11
  high_stop = 11
  negative_limit = -10
  positive_limit = 10
  home = {{ from = -0.5, to = 0.5 }}
"""


@pytest.fixture(params=[(product, clocks) for product in TURNS for clocks in ("DC", "free run")], ids="-".join)
def running(request, start_line, open_master, objects):
    """A drive in Op with process data for all modes; `turn`: counts per revolution, which are also the drive's
    units."""
    product, clocks = request.param
    turn = TURNS[product]
    line = start_line(segment(1, product=product, travel=TRAVEL.format(turn=turn)))
    master = open_master()
    assert master.scan() == 1
    drive = Drive(master, 0, line.bench, "drive1", objects(product))
    drive.turn = turn
    drive.remap(0x1C12, MODES, 0x1600)
    drive.remap(0x1C13, FEEDBACK, 0x1A00)
    drive.download(0x10F1, 0, 2)  # delays of a busy machine must not cause a fault
    drive.learn_mapping()
    master.run(dc_cycle_ns=CYCLE_NS if clocks == "DC" else None)
    assert (drive.upload(0x1C32, 1) == 2) == (clocks == "DC")  # by SYNC0
    return drive


@pytest.fixture
def master(running):
    return running.master


def enable(drive, mode):
    drive.set_mode(mode)
    drive.write(0x607A, drive.position)
    drive.write(0x60FF, 0)
    drive.write(0x6071, 0)
    drive.enable()


def turns(drive, revolutions):
    return round(revolutions * drive.turn)


def set_ramps(drive):
    # 180 rpm: the factory limit of a JMC drive is 216 rpm (607Fh).
    drive.set_ramps(velocity=turns(drive, 3), acceleration=turns(drive, 40))


def moved(drive, revolutions):
    drive.wait_standstill()
    assert abs(drive.true_position / drive.turn - revolutions) <= 1 / 500, drive.true_position


def ramp(drive, start, end, speed):
    """Sends 607Ah in each cycle, from start to end, with `speed` counts per cycle."""
    sign = 1 if end >= start else -1

    first = drive.master.cycles

    def step(cycle):
        distance = min(abs(end - start), speed * (cycle - first))
        drive.values[0x607A, 0] = start + sign * distance

    return step


def test_cyclic_position(running, master):
    enable(running, CYCLIC_POSITION)
    for target in (START + 1, START - 0.5):
        counts = turns(running, target)
        ramped = ramp(running, running.values[0x607A, 0], counts, turns(running, 1 / 256))
        running.master.each_cycle.insert(0, ramped)
        master.wait(lambda: running.values[0x607A, 0] == counts, "the set-points")
        tolerance = running.turn // 500
        master.wait(lambda: abs(running.position - counts) <= tolerance, lambda: f"{counts}, is {running.position}")
        master.each_cycle.pop(0)
        moved(running, target)
    assert running.state == "Operation enabled"


def test_cyclic_velocity(running, master):
    enable(running, CYCLIC_VELOCITY)
    before = running.true_position
    running.write(0x60FF, running.turn)
    master.wait(lambda: running.true_position - before > running.turn, "a revolution")
    assert running.get(0x606C) == pytest.approx(running.turn, rel=0.05)
    assert running.bench.axis(running.name)["velocity_rpm"] == pytest.approx(60, rel=0.05)
    running.write(0x60FF, 0)
    running.wait_standstill()
    assert running.state == "Operation enabled"


def test_cyclic_torque(running, master):
    enable(running, CYCLIC_TORQUE)
    before = running.true_position
    running.write(0x6071, 100)
    master.wait(lambda: running.true_position - before > running.turn // 8, "the shaft to turn")
    assert running.get(0x6077) == pytest.approx(100, abs=10)
    assert running.bench.axis(running.name)["velocity_rpm"] > 0
    running.write(0x6071, 0)
    running.control(0x06)
    running.wait_standstill()


def test_profile_position(running):
    enable(running, PROFILE_POSITION)
    set_ramps(running)
    running.move_to(turns(running, START + 2))
    moved(running, START + 2)
    running.move_to(-running.turn, relative=True)
    moved(running, START + 1)


def test_profile_velocity(running, master):
    enable(running, PROFILE_VELOCITY)
    set_ramps(running)
    running.write(0x60FF, -running.turn)
    before = running.true_position
    running.wait_bits(1 << 10, 1 << 10)
    master.wait(lambda: before - running.true_position > running.turn // 2, "the shaft to turn")
    assert running.get(0x606C) == pytest.approx(-running.turn, rel=0.05)
    running.write(0x60FF, 0)
    running.wait_standstill()


def test_profile_torque(running, master):
    running.write(0x6087, 1000)
    enable(running, PROFILE_TORQUE)
    before = running.true_position
    running.write(0x6071, -100)
    master.wait(lambda: before - running.true_position > running.turn // 8, "the shaft to turn")
    running.write(0x6071, 0)
    running.control(0x06)
    running.wait_standstill()


def test_homing(running):
    """Method 24 (the home switch from the positive side), then a move relative to home."""
    running.home(24, fast=turns(running, 3), slow=turns(running, 0.4), acceleration=turns(running, 40))
    edge = running.true_position - running.position
    assert abs(abs(edge) - running.turn // 2) <= running.turn // 500
    running.control(0x06)
    running.set_mode(PROFILE_POSITION)
    running.write(0x607A, running.position)
    running.enable()
    set_ramps(running)
    running.move_to(running.turn)
    moved(running, edge / running.turn + 1)
