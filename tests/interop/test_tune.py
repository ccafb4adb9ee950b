"""`servodrome tune` in real time, over CAN and EtherCAT in UDP.

The quality of the gains is tested in virtual time (tests/tools/tuning/tuning_test.cpp). A busy computer loses cycles;
`tune` then reports this and measures nothing, and the test repeats it. If it never succeeds, the drive must be
unchanged.
"""

import json
import signal
import subprocess
import xml.etree.ElementTree

import pytest
from line import CAN_AND_ETHERCAT, PROGRAM, Line, four_drives, servodrome, wait_for

pytestmark = [pytest.mark.once, pytest.mark.program("the program is the master")]

# Without a travel: the axes may turn without end.
LINE = four_drives({"reference-ec": "generic402-ec", "ismk-ec": "ismk-ea"}, travel="")
# Bus, node, and the object with the proportional gain of the velocity loop.
AXES = {
    "reference": ("can0", 2, "2010/2"),
    "ismk": ("can0", 4, "60F9/1"),
    "reference-ec": ("ecat", 1, "2010/2"),
    "ismk-ec": ("ecat", 2, "60F9/1"),
}
# Messages after lost cycles. A late heartbeat is a fault of the drive. A slave whose watchdog has expired (100 ms)
# leaves OP, and its drive leaves operation enabled.
TOO_BUSY = (
    "a computer with less load",
    "no longer sends its process data",
    "in a row",
    "frames do not come back",
    "8130h",
    "the drive has a fault",
)
WATCHDOG = ("sync manager watchdog", "switch on disabled")
# Messages after cycles that were not regular: the measured delay is longer than the drive's, or the new gains do not
# have the calculated result.
UNEVEN = ("the loop delay of", "with the new gains")
ATTEMPTS = 8
SHORT = ["--seconds", "4", "--reset-fault"]


def brief(words):
    """The options for a short test; with --auto there is no measurement whose duration could be given."""
    return ["--reset-fault"] if "--auto" in words else SHORT


@pytest.fixture
def tuned_line(tmp_path):
    line = Line(tmp_path, LINE, CAN_AND_ETHERCAT)
    yield line
    line.stop()


def start(line, axis, *words):
    bus, node, _ = AXES[axis]
    command = [PROGRAM, "tune", "--bus", line.links[bus][0], "--node", str(node), *map(str, words)]
    return subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def in_time(attempt):
    """Repeats attempt(), which returns (expected exit status, process, output, error message), while the computer is
    too busy.

    Returns None if it always was too busy: then only tuning_test, which uses virtual time, checks the results. This
    test then only checks that the drive is unchanged."""
    for _ in range(ATTEMPTS):
        wanted, process, out, said = attempt()
        if process.returncode == wanted:
            return out, said
        busy = TOO_BUSY + UNEVEN + (WATCHDOG if "udp:" in said else ())
        assert process.returncode == 1 and any(text in said for text in busy), (process.returncode, said)
    print(f"cycles were lost {ATTEMPTS} times: {said}")
    return None, None


def tune(line, axis, *words):
    def attempt():
        process = start(line, axis, *words, *brief(words), "--json")
        return 0, process, *process.communicate(timeout=200)

    out, _ = in_time(attempt)
    return out and json.loads(out)


def gain(line, axis):
    return line.bench.get(f"axes/{axis}/objects/{AXES[axis][2]}")["value"]


def is_at_rest(line, axis):
    now = line.bench.axis(axis)
    return now["state"] != "operation enabled" and abs(now["velocity_rpm"]) < 0.5


@pytest.mark.parametrize("axis", AXES)
def test_a_proposal_writes_nothing(axis, tuned_line):
    before = gain(tuned_line, axis)
    if said := tune(tuned_line, axis, "--propose", "--bandwidth", 30):
        assert said["result"] == "proposed" and "after" not in said and not said["stored"]
        assert said["before"]["inertia"] > 0 and len(said["before"]["open_loop"]) > 10
        assert said["gains"][0]["before"] == before and said["gains"][0]["after"] > 0
    assert gain(tuned_line, axis) == before
    assert is_at_rest(tuned_line, axis)


@pytest.mark.parametrize("axis", ["reference", "reference-ec"])
def test_gains_are_written_measured_and_drawn(axis, tuned_line, tmp_path):
    picture = tmp_path / "bode.svg"
    before = gain(tuned_line, axis)
    if said := tune(tuned_line, axis, "--apply", "--bandwidth", 60, "--plot", picture):
        assert said["result"] == "applied"
        assert abs(said["after"]["bandwidth_hz"] / 60 - 1) <= 0.15
        assert said["after"]["phase_margin_deg"] >= 40
        assert said["step_after"]["rise_ms"] > 0
        drawn = "".join(xml.etree.ElementTree.parse(picture).getroot().itertext())
        assert "open loop before" in drawn and "closed loop after" in drawn
        assert said["gains"][0]["after"] > 0
    assert gain(tuned_line, axis) == (said["gains"][0]["after"] if said else before)
    assert is_at_rest(tuned_line, axis)


@pytest.mark.parametrize("axis", ["ismk", "ismk-ec"])
def test_an_ismk_tunes_itself(axis, tuned_line):
    before = gain(tuned_line, axis)
    if said := tune(tuned_line, axis, "--auto"):
        assert said["result"] == "tuned by the drive itself" and "nothing was measured" in said["note"]
        assert said["gains"][0]["after"] > 0
    assert gain(tuned_line, axis) == (said["gains"][0]["after"] if said else before)
    wait_for(lambda: is_at_rest(tuned_line, axis), "the axis at rest")


def printed(line, axis, *words):
    def attempt():
        process = start(line, axis, *words, *brief(words))
        return 0, process, *process.communicate(timeout=200)

    out, _ = in_time(attempt)
    return out


def test_what_becomes_slower_is_printed(tuned_line):
    """The bandwidth of an iSMK with the factory's gains is about 15 Hz."""
    if out := printed(tuned_line, "ismk", "--bandwidth", 8):
        assert "\nnote: the proposed loop is slower than the present one: bandwidth 8.0 Hz instead of " in out, out
        assert "the proposed position gain is lower than the present one: " in out, out
    if out := printed(tuned_line, "ismk", "--auto"):
        assert "\nnote: the drive chose these gains, and nothing was measured before and after" in out, out
    if out := printed(tuned_line, "reference", "--apply", "--bandwidth", 60):
        assert "position gain: the drive's own -> " in out and "note: " not in out, out


def until_it_moves(line, axis, process):
    wait_for(
        lambda: process.poll() is not None or abs(line.bench.axis(axis).get("velocity_rpm", 0)) > 10, "a moving axis"
    )


@pytest.mark.parametrize("axis", ["reference", "reference-ec"])
def test_ctrl_c_stops_the_axis(axis, tuned_line):
    before = gain(tuned_line, axis)

    def attempt():
        process = start(tuned_line, axis, "--apply", *SHORT)
        until_it_moves(tuned_line, axis, process)
        process.send_signal(signal.SIGINT)
        return 130, process, *process.communicate(timeout=200)

    _, said = in_time(attempt)
    assert said is None or ("interrupted" in said and "stopped" in said)
    assert is_at_rest(tuned_line, axis)
    assert gain(tuned_line, axis) == before


@pytest.mark.parametrize("axis", AXES)
def test_the_supply_fails(axis, tuned_line):
    process = start(tuned_line, axis, "--apply", *SHORT)
    until_it_moves(tuned_line, axis, process)
    tuned_line.bench.post(f"axes/{axis}/power", {"action": "off"})
    _, said = process.communicate(timeout=200)
    assert process.returncode == 1
    assert said.startswith("servodrome: ") and ";" in said, said


def objects_of_the_measurement(line):
    """Those that `tune` changes and restores: the PDOs, and the objects by which the drive monitors its master."""
    watch = [line.bench.get(f"axes/reference/objects/{path}")["value"] for path in ("1016/1", "6007/0")]
    return watch, line.bench.get("axes/reference/pdos")["pdos"]


def test_only_the_gains_are_stored(tuned_line):
    tuned_line.bench.put("axes/reference/objects/6007/0", {"value": 0})  # so that the command changes it
    old, before = gain(tuned_line, "reference"), objects_of_the_measurement(tuned_line)
    said = tune(tuned_line, "reference", "--apply", "--store", "--bandwidth", 60)
    if not said:
        return
    assert said["stored"] and said["gains"][0]["after"] != old
    tuned_line.bench.post("axes/reference/power", {"action": "cycle"})
    assert gain(tuned_line, "reference") == said["gains"][0]["after"]
    assert objects_of_the_measurement(tuned_line) == before


def test_an_axis_that_turns_is_stopped_by_its_ramp(tmp_path):
    """The axis turns on after its master has died; the ramp takes 0.5 s. The first process data would switch its motor off."""
    text = '[[bus]]\nname = "can0"\n[[axis]]\nname = "reference"\nproduct = "generic402"\nbus = "can0"\nnode = 2\n'
    line = Line(tmp_path, text, ["can0=socketcand:127.0.0.1:0/can0"])
    try:
        where = ["--bus", line.links["can0"][0], "--node", "2"]
        velocity = ["--revolutions", "--velocity", "10", "--acceleration", "20"]
        jog = subprocess.Popen([PROGRAM, "jog", *where, *velocity, "--seconds", "60", "--no-watch"], stdin=subprocess.DEVNULL)
        try:
            wait_for(lambda: line.bench.axis("reference")["velocity_rpm"] > 590 or jog.poll() is not None, "the velocity")
            assert jog.poll() is None
        finally:
            jog.kill()
            jog.wait()
        seen = []

        def rests():
            now = line.bench.axis("reference")
            seen.append((now["state"], now["velocity_rpm"]))
            return abs(now["velocity_rpm"]) < 1

        process = start(line, "reference", *SHORT)
        try:
            wait_for(rests, "the axis at rest")
            process.send_signal(signal.SIGINT)
            _, said = process.communicate(timeout=200)
        finally:
            process.kill()
        assert "it is stopped and switched off before the measurement" in said, said
        assert {state for state, velocity in seen if velocity > 30} == {"operation enabled"}, seen
        assert any(30 < velocity < 570 for _, velocity in seen), seen
    finally:
        line.stop()


def test_wrong_uses(tuned_line):
    can = ["--bus", tuned_line.links["can0"][0], "--node", 2]
    assert "not both" in servodrome("tune", *can, "--apply", "--propose", status=2)
    assert "--apply" in servodrome("tune", *can, "--store", status=2)
    for wrong in [["--propose"], ["--plot", "/tmp/x.svg"], ["--bandwidth", 50], ["--seconds", 5]]:
        said = servodrome("tune", *can, "--auto", *wrong, status=2)
        assert "excludes" in said and "--auto" in said and wrong[0] in said, said
    assert "fixed rate" in servodrome("tune", "--bus", "modbus:tcp:127.0.0.1:1", status=2)
    assert "no automatic tuning" in servodrome("tune", *can, "--auto", status=1)
    nowhere = ["--bus", "socketcand:127.0.0.1:1/can0"]
    assert "x.svg: cannot be written" in servodrome("tune", *nowhere, "--plot", "/nowhere/x.svg", status=2)
    assert "x.xml: cannot be written" in servodrome("conform", *nowhere, "--junit", "/nowhere/x.xml", status=2)


def test_a_picture_that_cannot_be_written_leaves_the_result(tuned_line):
    """The disk is full at the end."""
    for _ in range(ATTEMPTS):
        process = start(tuned_line, "reference", "--propose", *SHORT, "--json", "--plot", "/dev/full")
        out, said = process.communicate(timeout=200)
        assert process.returncode == 1
        if not any(text in said for text in TOO_BUSY + UNEVEN):
            assert "/dev/full: cannot be written" in said and json.loads(out)["result"] == "proposed", (out, said)
            return
