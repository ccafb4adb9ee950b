"""Cable, supply or drive fail during a command: it ends with status 1 and reports the error, its place and the remedy.

Afterwards the axis rests, judged by the plant: on CAN the drive monitors its master. There is one exception: on a
serial line the drive cannot detect that the master's cable is cut, so a motion continues there (docs/commands.md).
"""

import select
import subprocess

import pytest
from line import COUNTS, PROGRAM, Line, axis_text, bus_text, wait_for

pytestmark = [pytest.mark.once, pytest.mark.program("the program is the master")]

LINE = (
    bus_text("can0")
    + bus_text("ecat", "ethercat")
    + bus_text("rs", "rs485")
    + bus_text("rs10", "rs485")
    + axis_text("can", "generic402", bus="can0", node=2)
    + axis_text("ecat", "generic402-ec", bus="ecat")
    + axis_text("modbus", "generic402", bus="can0", node=3, serial="rs")
    + axis_text("serial10", "ismk", serial="rs10")
)
BUSES = {"can": "can0", "ecat": "ecat", "modbus": "rs", "serial10": "rs10"}
NODES = {"can": 2, "ecat": 1, "modbus": 3, "serial10": 1}
SERIAL = ["modbus", "serial10"]
SLOWLY = ["--velocity", str(COUNTS // 4)]

# Commands that are running at the time of the failure: a motion, or communication only.
MOVING = {
    "home": ["home", "--method", "19", "--speed", str(COUNTS // 4), "--zero-speed", str(COUNTS // 8)],
    "move": ["move", "--by", str(5 * COUNTS), *SLOWLY],
    "jog": ["jog", *SLOWLY, "--seconds", "60"],
    "torque": ["torque", "--percent", "10", "--seconds", "60"],
    "probe": ["probe", "--source", "input", "--by", str(5 * COUNTS), *SLOWLY],
    "run": ["run", "{script}"],
    "scope": ["scope", "position", "--run", "{script}", "-o", "{recording}"],
    "tune": ["tune", "--propose", "--seconds", "4"],
}
TALKING = {
    "monitor": ["monitor", "--axis", "--seconds", "600"],
    "monitor objects": ["monitor", "statusword", "6064", "--seconds", "600"],
    "scope": ["scope", "position", "--do", "wait 0.1", "--do", "print recording", "--seconds", "600", "-o", "{recording}"],
}
# Commands that are too short to be interrupted start after the failure.
AT_ONCE = {
    "scan": ["scan", "--timeout", "1"],
    "get": ["get", "6041"],
    "set": ["set", "6083", "1000"],
    "faults": ["faults"],
    "params": ["params", "save", "{file}"],
    "conform": ["conform", "--only", "power"],
    "nmt": ["nmt", "reset-node", "--wait"],
    "state": ["state", "preop"],
    "clone": ["clone", "-o", "{file}"],
}
# Commands that some buses do not support.
ONLY = {
    "tune": ["can", "ecat"], "nmt": ["can"], "state": ["ecat"], "clone": ["can", "ecat"],
    "scan": ["can", "ecat", "modbus"], "conform": ["can", "ecat", "modbus"], "probe": ["can", "ecat", "modbus"],
    "home": ["can", "ecat", "modbus"],  # the iSMK has no home switch here
}


def on_its_buses(commands):
    pairs = [(axis, name) for name in commands for axis in ONLY.get(name, BUSES)]
    return pytest.mark.parametrize("axis, name", pairs)


@pytest.fixture
def broken_line(tmp_path):
    line = Line(tmp_path, LINE, ["can0=socketcand:127.0.0.1:0/can0", "ecat=udp:127.0.0.1:0", f"rs=pty:{tmp_path}/rs", f"rs10=pty:{tmp_path}/rs10"])
    yield line
    line.stop()


def link_of(line, axis):
    link = line.links[BUSES[axis]][0]
    return f"{axis}:serial:{link.removeprefix('pty:')}" if axis in SERIAL else link


def start(line, axis, words, tmp_path):
    script = tmp_path / "it.script"
    script.write_text(f"enable\nmove by {5 * COUNTS} velocity {COUNTS // 4}\n")
    words = [word.format(script=script, file=tmp_path / "saved.par", recording=tmp_path / "kept.csv") for word in words]
    command = [PROGRAM, *words, "--bus", link_of(line, axis)]
    if words[0] != "scan":
        command += ["--node", str(NODES[axis])]
    elif axis == "modbus":
        command += ["--first", "3", "--last", "3"]
    return subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def pull_cable(line, axis):
    line.bench.post(f"buses/{BUSES[axis]}/disturb", {"unplug": 1} if axis == "ecat" else {"cut": True})


def switch_off(line, axis):
    line.bench.post(f"axes/{axis}/power", {"action": "off"})


def cause_fault(line, axis):
    line.bench.post(f"axes/{axis}/faults", {"inject": "over_voltage"})


BREAKS = {"cable": pull_cable, "power": switch_off, "fault": cause_fault}


def ends_with_a_message(process):
    _, said = process.communicate(timeout=300)
    assert process.returncode == 1, (process.returncode, said)
    assert said.startswith("servodrome: ") and ";" in said, said
    return said


def rests(line, axis):
    if not line.bench.axis(axis)["powered"]:
        return True
    return abs(line.bench.axis(axis)["velocity_rpm"]) < 1


def assert_recording_is_kept(tmp_path):
    rows = (tmp_path / "kept.csv").read_text().splitlines()
    assert rows[0].startswith("seconds,") and len(rows) > 2, rows[:3]


def turns(line, axis):
    return abs(line.bench.axis(axis)["velocity_rpm"]) > 0.3  # the iSMK's units make it slow: 2 rpm


@on_its_buses(MOVING)
@pytest.mark.parametrize("how", list(BREAKS))
def test_broken_while_it_moves(broken_line, tmp_path, axis, how, name):
    process = start(broken_line, axis, MOVING[name], tmp_path)
    wait_for(lambda: turns(broken_line, axis) or process.poll() is not None, "the axis to turn")
    BREAKS[how](broken_line, axis)
    said = ends_with_a_message(process)
    if name == "scope":
        assert_recording_is_kept(tmp_path)
    if how == "fault":
        # A computer with a high load may detect the failure too late, or may itself fail to send process data in time.
        assert "fault" in said or "no answer" in said or "watchdog" in said, said
    if how != "cable" or axis not in SERIAL:
        wait_for(lambda: rests(broken_line, axis), "the axis at rest")
        if how == "fault":
            wait_for(lambda: broken_line.bench.axis(axis)["state"] == "fault", "the end of the fault reaction")


@on_its_buses(TALKING)
@pytest.mark.parametrize("how", ["cable", "power"])
def test_broken_while_it_looks(broken_line, tmp_path, axis, how, name):
    process = start(broken_line, axis, TALKING[name], tmp_path)
    assert process.stdout.readline()  # the command is at work
    BREAKS[how](broken_line, axis)
    ends_with_a_message(process)
    if name == "scope":
        assert_recording_is_kept(tmp_path)


@on_its_buses(AT_ONCE)
@pytest.mark.parametrize("how", ["cable", "power"])
def test_found_broken(broken_line, tmp_path, axis, how, name):
    BREAKS[how](broken_line, axis)
    process = start(broken_line, axis, AT_ONCE[name], tmp_path)
    if name == "scan" and axis == "can" and how == "power":  # the bus has another node, which the scan finds
        found, said = process.communicate(timeout=300)
        assert process.returncode == 0 and "reference drive" in found, said
        assert not any(line.split()[:1] == [str(NODES[axis])] for line in found.splitlines()), found
        return
    ends_with_a_message(process)
    assert not (tmp_path / "saved.par").exists()


@on_its_buses(MOVING)
def test_ctrl_c(broken_line, tmp_path, axis, name):
    process = start(broken_line, axis, MOVING[name], tmp_path)
    wait_for(lambda: turns(broken_line, axis) or process.poll() is not None, "the axis to turn")
    process.send_signal(subprocess.signal.SIGINT)
    _, said = process.communicate(timeout=300)
    assert process.returncode == 130, said
    if name == "scope":
        assert_recording_is_kept(tmp_path)
    wait_for(lambda: rests(broken_line, axis), "the axis at rest")
    assert broken_line.bench.axis(axis)["state"] != "operation enabled"


@pytest.mark.parametrize("axis", ["can", "ecat"])
@pytest.mark.parametrize("how", list(BREAKS))
def test_prove_is_broken(broken_line, tmp_path, axis, how):
    """The command continues with the other axes, and reports which axes failed and why."""
    command = [PROGRAM, "prove", "--bus", link_of(broken_line, axis), "--speed", "1", "--revolutions", "20"]
    process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    wait_for(lambda: turns(broken_line, axis) or process.poll() is not None, "the axis to turn")
    BREAKS[how](broken_line, axis)
    wait_for(lambda: rests(broken_line, axis), "the axis at rest")
    if how == "cable" and axis == "can":
        broken_line.bench.delete("buses/can0/disturb")  # so that the other drive need not wait for its timeouts
    out, said = process.communicate(timeout=300)
    assert process.returncode == 1, (out, said)
    assert "FAILED" in out and "axes failed, see above" in said, (out, said)
    row = out.splitlines().index(next(line for line in out.splitlines() if "FAILED" in line))
    assert ";" in out.splitlines()[row + 1], out


def test_held_slaves_go_away(broken_line, tmp_path):
    process = start(broken_line, "ecat", ["state", "op", "--seconds", "600"], tmp_path)
    wait_for(lambda: broken_line.bench.axis("ecat")["al_state"] == "Operational" or process.poll() is not None, "OP")
    pull_cable(broken_line, "ecat")
    ends_with_a_message(process)


def test_what_is_listened_to_goes_away(broken_line, tmp_path):
    process = subprocess.Popen(
        [PROGRAM, "sniff", link_of(broken_line, "can")], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
        stderr=subprocess.PIPE, text=True,
    )

    def hears():  # a command that receives no frames before it has connected
        assert start(broken_line, "can", AT_ONCE["get"], tmp_path).wait(300) == 0
        return select.select([process.stdout], [], [], 1)[0]

    wait_for(hears, "something to be heard")
    assert process.stdout.readline()
    broken_line.stop()
    ends_with_a_message(process)


def test_a_drive_watches_its_master_as_long_as_it_is_moved(broken_line, tmp_path):
    def objects():
        return [broken_line.bench.get(f"axes/can/objects/{path}")["value"] for path in ("1016/1", "6007/0")]

    before = objects()
    process = start(broken_line, "can", ["jog", *SLOWLY, "--seconds", "2"], tmp_path)
    wait_for(lambda: turns(broken_line, "can") or process.poll() is not None, "the axis to turn")
    assert objects()[0] == 126 << 16 | 1500 and objects()[1] == 1  # 126: the first choice for node 2
    assert process.wait(300) == 0
    assert objects() == before
    process = start(broken_line, "can", ["jog", *SLOWLY, "--seconds", "2", "--no-watch"], tmp_path)
    wait_for(lambda: turns(broken_line, "can") or process.poll() is not None, "the axis to turn")
    assert objects() == before
    assert process.wait(300) == 0


def test_sigterm(broken_line, tmp_path):
    process = start(broken_line, "can", MOVING["move"], tmp_path)
    wait_for(lambda: turns(broken_line, "can") or process.poll() is not None, "the axis to turn")
    process.terminate()
    _, said = process.communicate(timeout=300)
    assert process.returncode == 143, said
    wait_for(lambda: rests(broken_line, "can"), "the axis at rest")


@pytest.mark.parametrize("name", ["jog", "torque", "run"])
@pytest.mark.parametrize("name_of_signal, status", [("SIGTSTP", 148), ("SIGQUIT", 131)])
def test_ctrl_z_and_ctrl_backslash(broken_line, tmp_path, name, name_of_signal, status):
    """The drive does not monitor its master over Modbus, so a suspended or killed command would leave the axis turning."""
    process = start(broken_line, "modbus", MOVING[name], tmp_path)
    try:
        wait_for(lambda: turns(broken_line, "modbus") or process.poll() is not None, "the axis to turn")
        process.send_signal(getattr(subprocess.signal, name_of_signal))
        _, said = process.communicate(timeout=60)
    finally:
        process.kill()
    assert process.returncode == status, said
    wait_for(lambda: rests(broken_line, "modbus"), "the axis at rest")
    assert broken_line.bench.axis("modbus")["state"] != "operation enabled"
