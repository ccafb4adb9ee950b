"""Cable, supply or drive fail in the middle of a command: it ends with 1 and says what, where and what to do.

The axis rests afterwards by what the plant says: on CAN the drive was told to watch its master. With one exception: on
Modbus it cannot know that its master's cable is gone, so there a motion under way goes on (docs/commands.md).
"""

import subprocess

import pytest
from line import COUNTS, PROGRAM, TRAVEL, Line, wait_for

pytestmark = pytest.mark.once

LINE = f"""
[[bus]]
name = "can0"

[[bus]]
name = "ecat"
type = "ethercat"

[[bus]]
name = "rs"
type = "rs485"

[[axis]]
name = "can"
product = "generic402"
bus = "can0"
node = 2
{TRAVEL}

[[axis]]
name = "ecat"
product = "generic402-ec"
bus = "ecat"
{TRAVEL}

[[axis]]
name = "modbus"
product = "generic402"
bus = "can0"
node = 3
serial = "rs"
{TRAVEL}
"""
BUSES = {"can": "can0", "ecat": "ecat", "modbus": "rs"}
NODES = {"can": 2, "ecat": 1, "modbus": 3}
SLOWLY = ["--velocity", str(COUNTS // 4)]

MARK = 1234567  # written by a command that prints nothing before its end, when it is at work

# What goes on when it breaks: a motion, or something that only talks.
MOVING = {
    "home": ["home", "--method", "19", "--speed", str(COUNTS // 4), "--zero-speed", str(COUNTS // 8)],
    "move": ["move", "--by", str(5 * COUNTS), *SLOWLY],
    "jog": ["jog", *SLOWLY, "--seconds", "60"],
    "torque": ["torque", "--percent", "10", "--seconds", "60"],
    "probe": ["probe", "--source", "input", "--by", str(5 * COUNTS), *SLOWLY],
    "run": ["run", "{script}"],
    "scope": ["scope", "position", "--run", "{script}", "-o", "{recording}"],
}
TALKING = {
    "monitor": ["monitor", "--axis", "--for", "600"],
    "scope": ["scope", "position", "--do", f"set 6083 {MARK}", "--duration", "600", "-o", "{recording}"],
}
# What is over too soon to be broken in the middle finds it broken.
AT_ONCE = {
    "scan": ["scan", "--timeout", "1"],
    "get": ["get", "6041"],
    "set": ["set", "6083", "1000"],
    "faults": ["faults"],
    "params": ["params", "save", "{file}"],
    "conform": ["conform", "--only", "power"],
}


@pytest.fixture
def broken_line(tmp_path):
    line = Line(tmp_path, LINE, ["can0=socketcand:127.0.0.1:0/can0", "ecat=udp:127.0.0.1:0", f"rs=pty:{tmp_path}/rs"])
    yield line
    line.stop()


def link_of(line, axis):
    link = line.links[BUSES[axis]][0]
    return f"modbus:serial:{link.removeprefix('pty:')}" if axis == "modbus" else link


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
AXES = pytest.mark.parametrize("axis", list(BUSES))


def ends_with_a_message(process):
    _, said = process.communicate(timeout=300)
    assert process.returncode == 1, (process.returncode, said)
    assert said.startswith("servodrome: ") and ";" in said, said
    return said


def rests(line, axis):
    if not line.bench.axis(axis)["powered"]:
        return True
    return abs(line.bench.axis(axis)["velocity_rpm"]) < 1


def has_mark(line, axis):
    return line.bench.get(f"axes/{axis}/objects/6083/0")["value"] == MARK


def assert_recording_is_kept(tmp_path):
    rows = (tmp_path / "kept.csv").read_text().splitlines()
    assert rows[0].startswith("seconds,") and len(rows) > 2, rows[:3]


def turns(line, axis):
    return abs(line.bench.axis(axis)["velocity_rpm"]) > 5


@AXES
@pytest.mark.parametrize("how", list(BREAKS))
@pytest.mark.parametrize("name", list(MOVING))
def test_broken_while_it_moves(broken_line, tmp_path, axis, how, name):
    process = start(broken_line, axis, MOVING[name], tmp_path)
    wait_for(lambda: turns(broken_line, axis) or process.poll() is not None, "the axis to turn")
    BREAKS[how](broken_line, axis)
    said = ends_with_a_message(process)
    if name == "scope":
        assert_recording_is_kept(tmp_path)
    if how == "fault":
        # A computer at its limit may be too late to hear of it, or to keep its own end of the process data.
        assert "fault" in said or "no answer" in said or "watchdog" in said, said
    if how != "cable" or axis != "modbus":
        wait_for(lambda: rests(broken_line, axis), "the axis at rest")
        if how == "fault":
            assert broken_line.bench.axis(axis)["state"] == "fault"


@AXES
@pytest.mark.parametrize("how", ["cable", "power"])
@pytest.mark.parametrize("name", list(TALKING))
def test_broken_while_it_looks(broken_line, tmp_path, axis, how, name):
    process = start(broken_line, axis, TALKING[name], tmp_path)
    if name == "monitor":
        process.stdout.readline()
    else:
        wait_for(lambda: has_mark(broken_line, axis) or process.poll() is not None, "the mark")
        with pytest.raises(subprocess.TimeoutExpired):
            process.wait(0.5)
    BREAKS[how](broken_line, axis)
    ends_with_a_message(process)
    if name == "scope":
        assert_recording_is_kept(tmp_path)


@AXES
@pytest.mark.parametrize("how", ["cable", "power"])
@pytest.mark.parametrize("name", list(AT_ONCE))
def test_found_broken(broken_line, tmp_path, axis, how, name):
    BREAKS[how](broken_line, axis)
    process = start(broken_line, axis, AT_ONCE[name], tmp_path)
    if name == "scan" and axis == "can" and how == "power":  # the bus has another node, which is found
        found, said = process.communicate(timeout=300)
        assert process.returncode == 0 and "reference drive" in found, said
        assert not any(line.split()[:1] == [str(NODES[axis])] for line in found.splitlines()), found
        return
    ends_with_a_message(process)
    assert not (tmp_path / "saved.par").exists()


@AXES
@pytest.mark.parametrize("name", list(MOVING))
def test_ctrl_c(broken_line, tmp_path, axis, name):
    process = start(broken_line, axis, MOVING[name], tmp_path)
    wait_for(lambda: turns(broken_line, axis) or process.poll() is not None, "the axis to turn")
    process.send_signal(subprocess.signal.SIGINT)
    _, said = process.communicate(timeout=300)
    assert process.returncode == 130, said
    if name == "scope":
        assert_recording_is_kept(tmp_path)
    wait_for(lambda: rests(broken_line, axis), "the axis at rest")


def test_a_drive_watches_its_master_as_long_as_it_is_moved(broken_line, tmp_path):
    def objects():
        return [broken_line.bench.get(f"axes/can/objects/{path}")["value"] for path in ("1016/1", "6007/0")]

    before = objects()
    process = start(broken_line, "can", ["jog", *SLOWLY, "--seconds", "2"], tmp_path)
    wait_for(lambda: turns(broken_line, "can") or process.poll() is not None, "the axis to turn")
    assert objects()[0] == 0x7F << 16 | 1500 and objects()[1] == 1
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
