"""Ten tests of the gantry. They check true values of the machine, not the values that the drives report."""

import threading

import pytest
from machine import Stopped
from servodrome import PowerState

TURN = 131072  # counts
HOME = 0.5 * TURN  # the upper edge of the home switch
RATED_NM = 1.27


@pytest.fixture
def during(servodrome_line):
    """`during(0.3, action)`: calls `action` 0.3 s from now, while the machine's program runs."""
    timers = []

    def later(seconds, action):
        timer = threading.Timer(seconds, action)  # in the line's time
        timer.start()
        timers.append(timer)

    yield later
    for timer in timers:
        timer.cancel()


def at_rest(*axes):
    return all(abs(axis.velocity_rpm) < 1 for axis in axes)


def test_homing_finds_the_edge_of_the_switch(gantry, left, right):
    assert left.position == right.position == 2 * TURN
    gantry.start()
    gantry.home()
    for axis in (left, right):
        assert axis.position == pytest.approx(HOME, abs=TURN / 200)
    gantry.move(to=3)
    for axis in (left, right):
        assert axis.position == pytest.approx(HOME + 3 * TURN, abs=TURN / 200)


def test_an_open_door_stops_the_bridge(ready, left, right, during):
    during(0.5, lambda: left.inputs.__setitem__("DI3", False))
    with pytest.raises(Stopped, match="door"):
        ready.move(to=8)
    assert at_rest(left, right) and HOME + TURN / 10 < left.position < HOME + 7 * TURN
    before = left.position
    with pytest.raises(Stopped, match="door"):
        ready.start()
    assert abs(left.position - before) < TURN / 100


def test_a_blocked_end_stops_the_other(ready, left, right):
    right.plant.locked_rotor = True
    with pytest.raises(Stopped, match="right: fault 8611h"):  # following error
        ready.move(to=5)
    assert at_rest(left, right) and right.state is PowerState.FAULT
    assert right.position == pytest.approx(HOME, abs=TURN / 200)
    assert left.position < HOME + 2 * TURN


def test_a_cable_breaks(servodrome_line, ready, left, right, during):
    during(0.5, lambda: servodrome_line.buses["can0"].disturb(axis="right", cut=True))
    with pytest.raises(Stopped, match="right: no heartbeat"):
        ready.move(to=8)
    assert at_rest(left, right)
    assert right.state is PowerState.FAULT and right.error_code == 0x8130, "it has stopped by itself"
    assert abs(left.position - right.position) < TURN


def test_power_loss_of_one_end(ready, left, right, during):
    during(0.5, lambda: left.power("off"))
    with pytest.raises(Stopped, match="left: no heartbeat"):
        ready.move(to=8)
    assert left.state is PowerState.NO_POWER and at_rest(right)
    assert right.position < HOME + 7 * TURN


def test_the_limit_switch_ends_a_move_that_is_too_long(ready, left, right):
    with pytest.raises(Stopped, match="at a limit switch"):
        ready.move(to=12)
    assert at_rest(left, right)
    for axis in (left, right):
        assert 10 * TURN <= axis.position < 11 * TURN, "past the switch, and not in the stop"


def test_a_fault_is_reset_when_its_cause_is_gone(ready, left, right, during):
    during(0.3, lambda: left.inject("encoder_loss"))
    with pytest.raises(Stopped, match="left: fault"):
        ready.move(to=5)
    with pytest.raises(Stopped, match="stays"):
        ready.start()
    assert left.state is PowerState.FAULT and at_rest(right)
    left.remove("encoder_loss")
    ready.start()
    ready.home()
    ready.move(to=1)
    assert left.state is PowerState.OPERATION_ENABLED
    assert left.position == pytest.approx(HOME + TURN, abs=TURN / 200)


def test_overload_does_not_exceed_the_torque_limit(servodrome_line, ready, left, right):
    ready.limit_torque(500)
    left.plant.load_torque_nm = 1.0  # more than half of the rated torque
    with servodrome_line.record({"torque": left.signal("torque_nm")}) as recording:
        with pytest.raises(Stopped, match="left: fault 8611h"):
            ready.move(to=5)
    torque = recording.columns()["torque"]
    assert max(torque) == pytest.approx(0.5 * RATED_NM, rel=0.05)
    assert left.position < HOME, "the load has pulled it back"


def test_both_ends_move_in_step(servodrome_line, ready, left, right):
    signals = {"left": left.signal("position_counts"), "right": right.signal("position_counts")}
    with servodrome_line.record(signals) as recording:
        ready.move(to=6, speed=8)
        ready.move(to=0, speed=8)
    columns = recording.columns()
    assert max(columns["left"]) > HOME + 5.9 * TURN
    assert max(abs(a - b) for a, b in zip(columns["left"], columns["right"])) < TURN / 10000


def test_after_a_restart_it_must_be_homed(servodrome_line, ready, left, right):
    ready.move(to=2)
    for axis in (left, right):
        axis.power("cycle")
    servodrome_line.advance(2)
    ready.start()
    with pytest.raises(Stopped, match="not homed"):
        ready.move(to=3)
    assert left.position == pytest.approx(HOME + 2 * TURN, abs=TURN / 50)
    ready.home()
    ready.move(to=3)
    assert left.position == pytest.approx(HOME + 3 * TURN, abs=TURN / 200)
