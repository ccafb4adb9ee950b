"""Homing by third-party master: where zero ends up, told by the drive and by the true shaft."""

import pytest
from drive402 import BIT_12, BIT_13, HOMING
from line import COUNTS, HOME_EDGES, LIMITS, START, wait_for


def true_zero(drive):
    """The true position where the drive reads 0."""
    return drive.true_position - drive.position


@pytest.mark.parametrize(
    "method, zero",
    [
        (17, LIMITS[0]),  # negative limit switch, its inner edge
        (18, LIMITS[1]),
        (19, HOME_EDGES[0]),  # home switch coming from its low side (as the region is a switch that is high inside)
        (24, HOME_EDGES[0]),
        (28, HOME_EDGES[1]),
    ],
)
def test_zero_is_at_the_edge(drive, method, zero):
    if method == 19:
        drive.bench.put(f"axes/{drive.name}/plant", {"position_counts": -2 * COUNTS})
    drive.home(method)
    # One position-loop sample at 50000 counts/s is 50 counts at 1 kHz; the switch has no hysteresis here.
    assert abs(true_zero(drive) - zero) <= 100
    assert drive.bench.axis(drive.name)["homed"]
    drive.set_mode(1)
    drive.set_ramps()
    drive.move_to(0)
    assert abs(drive.true_position - zero) <= 110


@pytest.mark.parametrize("method", [33, 34])
def test_zero_is_at_the_index(drive, method):
    drive.bench.put(f"axes/{drive.name}/plant", {"position_counts": START + 1000})
    drive.home(method)
    assert abs(true_zero(drive) % COUNTS - 0) <= 100 or COUNTS - true_zero(drive) % COUNTS <= 100


def test_zero_is_here(drive):
    drive.bench.put(f"axes/{drive.name}/plant", {"position_counts": 54_321})
    drive.write(0x607C, 1000)
    drive.home(35)
    assert abs(true_zero(drive) - (54_321 - drive.position)) <= 1
    assert abs(abs(drive.position) - 1000) <= 1


@pytest.mark.parametrize("method", [-1, -2])
def test_against_a_hard_stop(drive, method):
    """The stop of the travel is at 11 revolutions; the limit switches are no part of these methods."""
    drive.home(method, fast=300_000)
    stop = 11 * COUNTS if method == -2 else -11 * COUNTS
    assert abs(true_zero(drive) - stop) <= COUNTS // 20


def test_an_unknown_method_is_refused_or_fails(drive):
    drive.set_mode(HOMING)
    drive.write(0x6099, 100_000, 1)
    drive.write(0x6099, 10_000, 2)
    drive.write(0x609A, 1_000_000)
    if drive.name == "reference":
        with pytest.raises(Exception, match="06090030|0609 0030|Code 0x06090030"):
            drive.write(0x6098, 99)
        return
    drive.write(0x6098, 36)
    drive.enable()
    drive.control(0x1F)
    drive.wait_state("Fault")
    assert drive.read(0x603F) == 0x6289


def test_homing_is_aborted_by_the_controlword(drive):
    drive.set_mode(HOMING)
    drive.write(0x6098, 17)
    drive.write(0x6099, 20_000, 1)
    drive.write(0x6099, 1_000, 2)
    drive.write(0x609A, 1_000_000)
    drive.enable()
    drive.control(0x1F)
    wait_for(lambda: drive.true_position < START - 1000, "motion")
    drive.control(0x0F)
    drive.wait_standstill()
    assert not drive.statusword & (BIT_12 | BIT_13)
    assert drive.true_position > LIMITS[0]
