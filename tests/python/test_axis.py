"""Axes: their values, the test bench, jobs."""

import math

import pytest
import servodrome
from conftest import COUNTS, axes
from servodrome import JobState, Mode, NmtState, PowerState


@pytest.fixture
def y(line):
    return line.axes["y"]


@pytest.fixture
def enabled(line, x):
    line.advance(0.5)
    x.enable()
    return x


# ---- Values ----


def test_an_axis_at_rest(x, line):
    assert x.name == "x" and x.product == "generic402"
    assert x.position == 2 * COUNTS and isinstance(x.position, int)
    assert x.velocity_rpm == 0
    assert x.state is PowerState.NOT_READY_TO_SWITCH_ON
    line.run_ticks(1)
    assert x.state is PowerState.SWITCH_ON_DISABLED
    assert x.statusword & 0x6F == 0x40
    assert x.controlword == 0
    assert x.mode is Mode.NONE
    assert x.error_code == 0
    assert x.faults == [] and x.warnings == [] and x.fault_history == []
    assert x.node_id == 2 and x.nmt_state is NmtState.PRE_OPERATIONAL and x.al_state is None
    assert not x.homed and not x.in_motion and x.powered
    assert x.outputs == {"DO0": False, "DO1": False, "DO2": False, "DO3": False}
    assert [(lamp.name, lamp.colour, lamp.light) for lamp in x.lamps] == [("RUN", "green", "blinking"), ("ERR", "red", "off")]
    assert x.temperature_c == x.stage_temperature_c == 25
    line.advance(1)
    assert x.supply_v == pytest.approx(310, abs=1)
    assert x.view()["name"] == "x"


def test_an_axis_on_ethercat(line):
    z = line.axes["z"]
    assert z.al_state is servodrome.AlState.INIT
    assert z.nmt_state is None and z.node_id is None
    assert z.view()["position"] == 1


def test_states_print_their_names():
    assert str(PowerState.OPERATION_ENABLED) == f"{PowerState.OPERATION_ENABLED}" == "OPERATION_ENABLED"
    assert PowerState.OPERATION_ENABLED == 4 and PowerState.OPERATION_ENABLED.text == "operation enabled"
    assert f"{Mode.HOMING:+d}" == "+6"
    assert [state.value for state in PowerState] == list(range(-1, 8))


def test_values_in_motion(enabled, line):
    enabled.velocity(10, acceleration=100, units="revolutions")
    line.advance(0.05)
    assert enabled.velocity_rpm == pytest.approx(600, rel=0.02)
    assert enabled.mode is Mode.PROFILE_VELOCITY
    assert enabled.state is PowerState.OPERATION_ENABLED
    assert enabled.in_motion
    assert enabled.torque_nm > 0 and enabled.current_a > 0


def test_a_mode_of_a_maker_is_a_number(y):
    assert servodrome.states.mode_of(-77) == -77
    assert servodrome.states.mode_of(8) is Mode.CYCLIC_SYNC_POSITION


# ---- Power ----


def test_power(x, line):
    x.objects["Target position"] = 5
    x.power("off")
    assert x.state is PowerState.NO_POWER
    assert not x.powered
    assert math.isnan(x.signal("statusword").value)
    assert x.position == 2 * COUNTS
    assert x.faults == []
    for use in (lambda: x.statusword, lambda: x.mode, lambda: x.lamps, lambda: x.outputs, lambda: x.nmt_state, x.enable):
        with pytest.raises(servodrome.Refused, match="power"):
            use()
    x.power("on")
    assert x.powered
    assert x.objects["Target position"] == 0
    x.objects["Target position"] = 5
    x.power("cycle")
    assert x.objects["Target position"] == 0
    with pytest.raises(servodrome.BadValue, match="cycle"):
        x.power("up")
    with pytest.raises(servodrome.WrongType):
        x.power(True)


# ---- Inputs ----


def test_inputs_follow_the_travel_until_they_are_forced(x, line):
    assert x.inputs["DI2"] is False  # two revolutions beside the home switch
    x.plant.position_counts = 0
    line.run_ticks(1)
    assert x.inputs["DI2"] is True
    x.inputs["DI2"] = False
    assert x.inputs.forced == ["DI2"]
    assert x.inputs["DI2"] is False
    x.inputs["DI5"] = True
    x.inputs.release("DI2")
    assert x.inputs.forced == ["DI5"]
    assert x.inputs["DI2"] is True
    x.inputs.release()
    assert x.inputs.forced == []
    assert list(x.inputs) == [f"DI{n}" for n in range(8)] and len(x.inputs) == 8
    assert "DI7" in x.inputs and "DI8" not in x.inputs
    assert dict(x.inputs)["DI2"] is True


def test_wrong_inputs(x):
    for use in (
        lambda: x.inputs["DI8"],
        lambda: x.inputs.release("DI8"),
        lambda: x.inputs.__setitem__("DO0", True),
        lambda: x.signal("DI8"),
    ):
        with pytest.raises(servodrome.UnknownName):
            use()
    for value in (1, None, "on"):
        with pytest.raises(servodrome.WrongType):
            x.inputs["DI0"] = value
    assert x.inputs.forced == []


def test_an_input_stops_the_drive(enabled, line):
    enabled.inputs["DI1"] = True  # positive limit switch
    with pytest.raises(servodrome.JobFailed):
        enabled.move(by=3, velocity=5, units="revolutions", timeout=5)


# ---- Plant ----


def test_the_plant(x, line):
    plant = x.plant
    values = dict(load_torque_nm=0.4, load_inertia_kgm2=0.0001, friction_nm=0.02, supply_v=300.0, ambient_c=40.0)
    for name, value in values.items():
        setattr(plant, name, value)
        assert getattr(plant, name) == value
    plant.locked_rotor = True
    assert plant.locked_rotor is True
    plant.position_counts = 77
    assert plant.position_counts == x.position == 77
    plant.set(friction_nm=0.01, ambient_c=20)
    assert {**plant.view()} == {**values, "friction_nm": 0.01, "ambient_c": 20, "locked_rotor": True, "position_counts": 77}


def test_a_load_moves_the_axis(x, line):
    x.plant.load_torque_nm = 0.4
    line.advance(0.1)
    assert x.position < 2 * COUNTS
    assert x.velocity_rpm < -10


def test_the_plant_has_no_second_spelling(x):
    with pytest.raises(AttributeError):
        x.plant.load_torque = 0.4
    with pytest.raises(servodrome.WrongType, match="load_torque_nm"):
        x.plant.set(load_torque=0.4)


def test_wrong_values_of_the_plant_change_nothing(x):
    before = x.plant.view()
    for wrong in (
        lambda: x.plant.set(friction_nm=0.5, load_inertia_kgm2=-1),
        lambda: setattr(x.plant, "supply_v", math.inf),
        lambda: setattr(x.plant, "load_torque_nm", math.nan),
        lambda: setattr(x.plant, "load_torque_nm", 1e9),
        lambda: setattr(x.plant, "position_counts", 2**80),
    ):
        with pytest.raises((servodrome.BadValue, servodrome.WrongType)):
            wrong()
    for wrong in (None, "1", [1]):
        with pytest.raises(servodrome.WrongType):
            x.plant.load_torque_nm = wrong
    assert x.plant.view() == before


# Also in the tick in which the drive switches the motor on.
@pytest.mark.parametrize("ms_before", range(100, 104))
def test_an_energised_axis_is_not_put_elsewhere(x, line, ms_before):
    line.advance(ms_before / 1000)
    x.enable()
    with pytest.raises(servodrome.Refused, match="energised"):
        x.plant.position_counts = 0


# ---- Faults ----


def test_a_fault_and_its_end(enabled, line):
    enabled.inject("encoder_loss")
    assert enabled.injections == ["encoder_loss"]
    line.advance(0.1)
    assert enabled.state is PowerState.FAULT
    fault = enabled.faults[0]
    assert fault.code == enabled.error_code != 0
    assert fault.name and fault.cause and fault.remedy
    assert str(fault) == f"{fault.code:04X}h {fault.name}"
    with pytest.raises(servodrome.JobFailed) as caught:
        enabled.reset_fault()
    assert caught.value.what and caught.value.where
    enabled.remove("encoder_loss")
    assert enabled.injections == []
    line.advance(0.1)
    enabled.reset_fault()
    assert enabled.faults == []
    assert enabled.state is PowerState.SWITCH_ON_DISABLED
    assert [past.code for past in enabled.fault_history] == [fault.code]


def test_faults_by_their_code(x, line):
    able = x.injectable
    assert "encoder_loss" in able.plant
    cause, code = next(iter(able.drive.items()))
    x.inject(code)
    x.inject("brake_stuck")
    assert set(x.injections) == {"brake_stuck", f"0x{code:04X}"}
    x.remove(code)
    assert x.injections == ["brake_stuck"]
    x.inject(cause)
    x.remove()
    assert x.injections == []


@pytest.mark.parametrize("wrong", ["encoder_los", 0xFFFF, ""])
def test_faults_that_the_axis_does_not_have(x, wrong):
    for use in (x.inject, x.remove):
        with pytest.raises(servodrome.BadValue, match="there is no fault"):
            use(wrong)


@pytest.mark.parametrize("wrong", [None, 1.5, True, ["encoder_loss"]])
def test_faults_of_another_type(x, wrong):
    with pytest.raises(servodrome.WrongType):
        x.inject(wrong)


# ---- Jobs ----


def test_the_usual_jobs(x, line):
    job = x.enable()
    assert job.state is JobState.DONE and job.is_over
    assert x.state is PowerState.OPERATION_ENABLED
    result = x.home(method=21, speed=2, zero_speed=0.5, units="revolutions").result
    assert x.homed
    assert result.seconds > 0.1 and abs(x.position - COUNTS / 2) < 500
    result = x.move(to=3, velocity=5, acceleration=100, deceleration=50, units="revolutions").result
    assert result.position == pytest.approx(3, abs=1e-3)
    begin = x.position
    x.move(by=-1000)
    assert x.position == pytest.approx(begin - 1000, abs=50)
    x.velocity(-2, units="revolutions", acceleration=20)
    assert x.velocity_rpm == pytest.approx(-120, rel=0.05)
    x.stop()
    assert x.velocity_rpm == pytest.approx(0, abs=1)
    assert x.state is PowerState.OPERATION_ENABLED
    x.torque(5, slope=100)
    assert x.mode is Mode.PROFILE_TORQUE
    x.quick_stop()
    line.advance(0.1)
    assert x.state in (PowerState.QUICK_STOP_ACTIVE, PowerState.SWITCH_ON_DISABLED)
    x.disable()
    assert x.state is not PowerState.OPERATION_ENABLED


def test_a_job_takes_line_time_and_not_more_than_it_needs(enabled, line):
    begin = line.now
    job = enabled.move(by=1, velocity=2, acceleration=20, units="revolutions")
    assert line.now - begin == pytest.approx(job.result.seconds, abs=0.0021)  # a poll each millisecond
    assert line.ticks % 16 == 0


def test_a_job_without_waiting(enabled, line):
    begin = line.now
    job = enabled.move(by=5, velocity=5, units="revolutions", wait=False)
    assert line.now == begin
    assert job.state is JobState.RUNNING and job.result is None and not job.is_over
    line.advance(0.2)
    assert enabled.in_motion
    with pytest.raises(servodrome.Refused, match="the axis has a job"):
        enabled.move(by=1)
    assert job.wait() is job
    assert job.state is JobState.DONE
    assert repr(job).endswith("move of x, done>")
    job.end()  # no effect
    assert job.state is JobState.DONE
    assert job.wait() is job


def test_ending_a_job(enabled, line):
    job = enabled.velocity(5, units="revolutions", acceleration=1, wait=False)
    line.advance(0.5)
    job.end()
    with pytest.raises(servodrome.JobFailed) as caught:
        job.wait()
    assert caught.value.job is job
    assert job.state is JobState.CANCELLED
    assert enabled.velocity_rpm == pytest.approx(0, abs=1)


def test_a_job_replaced_by_a_stop(enabled, line):
    job = enabled.velocity(5, units="revolutions", acceleration=1, wait=False)
    line.advance(0.5)
    enabled.stop()
    assert job.state is JobState.CANCELLED
    with pytest.raises(servodrome.JobFailed, match="replaced by the job stop"):
        job.check()


def test_a_job_that_fails(x, line):
    with pytest.raises(servodrome.JobFailed) as caught:
        x.move(by=1)
    error = caught.value
    assert error.job.state is JobState.FAILED
    assert "enabled" in error.what and error.where == "x" and error.hint
    x.enable()
    with pytest.raises(servodrome.JobFailed, match="0609 0030h"):
        x.home(method=99)


def test_a_motion_that_takes_too_long_stops_the_axis(enabled, line):
    with pytest.raises(servodrome.JobFailed) as caught:
        enabled.move(by=8, velocity=0.5, units="revolutions", timeout=0.5)
    assert caught.value.job.state is JobState.FAILED
    assert line.now < 3
    assert enabled.velocity_rpm == pytest.approx(0, abs=1)


def test_a_wait_that_takes_too_long_ends_the_job(enabled, line):
    job = enabled.move(by=8, velocity=0.5, units="revolutions", wait=False)
    begin = line.now
    with pytest.raises(servodrome.JobTimeout, match=r"move is not over after 0.5 s") as caught:
        job.wait(0.5)
    assert isinstance(caught.value, TimeoutError)
    assert line.now - begin == pytest.approx(0.5)
    assert job.view()["ending"]
    line.advance(1)
    assert job.state is JobState.CANCELLED
    assert enabled.velocity_rpm == pytest.approx(0, abs=1)


@pytest.mark.parametrize(
    "use, error",
    [
        (lambda x: x.move(), servodrome.WrongType),
        (lambda x: x.move(to=1, by=1), servodrome.WrongType),
        (lambda x: x.move(by=1, velocity=-1), servodrome.BadValue),
        (lambda x: x.move(by=2**40), servodrome.BadValue),
        (lambda x: x.move(by=math.nan), servodrome.BadValue),
        (lambda x: x.move(by="1"), servodrome.WrongType),
        (lambda x: x.move(by=1, units="mm"), servodrome.BadValue),
        (lambda x: x.move(by=1, timeout=-1), servodrome.BadValue),
        (lambda x: x.move(by=1, timeout="1"), servodrome.WrongType),
        (lambda x: x.home(method=1.5), servodrome.BadValue),
        (lambda x: x.home(method=1000), servodrome.BadValue),
        (lambda x: x.velocity(math.inf), servodrome.BadValue),
        (lambda x: x.torque(10000), servodrome.BadValue),
        (lambda x: x.job("dance"), servodrome.BadValue),
        (lambda x: x.job("enable", speed=1), servodrome.WrongType),
    ],
)
def test_orders_that_are_refused_begin_nothing(enabled, line, use, error):
    before = line.now, line.request("GET", "jobs")
    with pytest.raises(error):
        use(enabled)
    assert (line.now, line.request("GET", "jobs")) == before
    enabled.move(by=100)  # the axis has no job


def test_other_jobs_by_their_name(enabled):
    job = enabled.job("step", amplitude=1, units="revolutions", seconds=0.1)
    assert job.state is JobState.DONE
    assert job.note == ""


def test_the_emergency_stop(line):
    moving = [line.axes["x"], line.axes["y"]]
    for axis in moving:
        axis.enable()
        axis.velocity(2, acceleration=20, units="revolutions")
    line.stop_all()
    line.advance(1)
    for axis in moving:
        assert axis.velocity_rpm == pytest.approx(0, abs=1)
        assert axis.state is not PowerState.OPERATION_ENABLED


# ---- Signals ----


def test_signals_of_all_kinds(x, line):
    line.advance(0.5)
    x.objects["Target position"] = 9
    for key, value in {
        "position_counts": 2 * COUNTS,
        "607A:00": 9,
        0x607A: 9,
        "Target position": 9,
        (0x607A, 0): 9,
        "DI2": 0,
        "DO0": 0,
        "state": 1,
    }.items():
        assert x.signal(key).value == value, key
    assert x.signal("607A:00").name == x.signal(0x607A).name == "607A:00"
    assert repr(x.signal("DO0")) == "<signal DO0 of x>"


@pytest.mark.parametrize("key", ["velocity", "9999:00", 0x9999, "1008:00", "No such", "DI99", ""])
def test_signals_that_do_not_exist(x, key):
    with pytest.raises((servodrome.UnknownName, servodrome.UnknownObject)):
        x.signal(key)


def test_signals_without_power(x):
    x.power("off")
    assert math.isnan(x.signal("statusword").value)
    assert math.isnan(x.signal("6041:00").value)
    assert x.signal("position_counts").value == 2 * COUNTS


def test_axes_of_two_lines_are_independent(line):
    with servodrome.Line(axes=axes()) as other:
        other.axes["x"].plant.position_counts = 1
        other.advance(1)
        assert line.axes["x"].position == 2 * COUNTS
        assert line.now == 0
