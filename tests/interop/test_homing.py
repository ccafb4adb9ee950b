"""Homing by a third-party master: the position of zero, as the drive reports it and by the true shaft."""

import pytest
from drive402 import BIT_12, BIT_13, HOMING, Drive402
from line import COUNTS, HOME_EDGES, LIMITS, START, TWO_DRIVES, wait_for

pytestmark = pytest.mark.once  # the behaviour of drives does not depend on the link


def true_zero(drive):
    """Returns the true position at which the drive reads 0."""
    return drive.true_position - drive.position


@pytest.mark.parametrize(
    "method, start, zero",
    [
        (17, 2, LIMITS[0]),  # the inner edge of the negative limit switch
        (18, 2, LIMITS[1]),
        (19, -2, HOME_EDGES[0]),
        (19, 0, HOME_EDGES[0]),
        (21, 2, HOME_EDGES[1]),
        (24, -2, HOME_EDGES[0]),
        (28, 2, HOME_EDGES[1]),
    ],
)
def test_zero_is_at_the_edge(drive, network, method, start, zero):
    drive.place(network, start * COUNTS)
    drive.home(method)
    # The drive reads the switch once per position loop: 50 counts at 50000 counts/s and 1 kHz.
    assert abs(true_zero(drive) - zero) <= 100
    assert drive.bench.axis(drive.name)["homed"]
    drive.set_mode(1)
    drive.set_ramps()
    drive.move_to(0)
    assert abs(drive.true_position - zero) <= 105


@pytest.mark.parametrize("method", [33, 34])
def test_zero_is_at_the_index(drive, network, method):
    drive.place(network, 2 * COUNTS + COUNTS // 3)
    drive.home(method)
    index = (2 if method == 33 else 3) * COUNTS
    assert abs(true_zero(drive) - index) <= 100


@pytest.mark.parametrize("offset", [0, 1000, -70_000])
def test_zero_is_here(drive, network, offset):
    """Method 35. Zero is at a distance of 607Ch from home. The sign differs between the ISMC and CiA 402: home reads
    -607Ch
    or 607Ch."""
    drive.place(network, 54_321)
    drive.write(0x607C, offset)
    before = drive.true_position
    drive.home(35)
    assert abs(drive.true_position - before) <= 8, "no motion"
    assert abs(abs(drive.position) - abs(offset)) <= 8


HARD_STOPS = TWO_DRIVES.replace("  negative_limit = -10\n  positive_limit = 10\n", "")


@pytest.mark.parametrize("method", [-1, -2])
@pytest.mark.parametrize("name, node_id, product", [("ismc", 1, "ismc"), ("reference", 2, "generic402")])
def test_against_a_hard_stop(start_line, connect, eds, name, node_id, product, method):
    """A travel without limit switches; the hard stop at 11 revolutions yields a little to the torque."""
    line = start_line(HARD_STOPS)
    drive = Drive402(connect(line).add_node(node_id, eds(product)), line.bench, name)
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
