"""The end of `servodrome run` and `scope --disable`: the axes of the program are at rest and off, or the command fails;
other programs keep theirs."""

import json
import subprocess

import pytest
from line import COUNTS, PROGRAM, Line, axis_text, bus_text, servodrome, wait_for

pytestmark = [pytest.mark.once, pytest.mark.program("the program is the master")]

STAYS_ON = """
[[rule]]
name = "stays-on"
axis = "reference"
when = { state = "operation_enabled" }
do = "ignore"
object = "6040"
mask = 0x000F
"""


def test_a_drive_that_does_not_switch_off_is_an_error(line, tmp_path):
    line.bench.post("scenario/rules", {"text": STAYS_ON})
    script = tmp_path / "enable.script"
    script.write_text("axis a 2\naxis b 1\na enable\nb enable\n")
    command = [PROGRAM, "run", "--bus", line.links["can0"][0], "--disable", "--json", str(script)]
    done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 1 and "did not switch off" in done.stderr, done
    ran = json.loads(done.stdout)
    assert not ran["passed"] and "did not switch off" in ran["failure"]["message"] and len(ran["steps"]) == 2, ran
    assert line.bench.axis("reference")["state"] == "operation enabled"
    assert line.bench.axis("ismc")["state"] != "operation enabled", "the other drive is tried, too"


def test_scope_stops_an_axis_before_it_disables_it(line, tmp_path):
    """Another program has begun the motion. Without friction the axis would coast for seconds."""
    drive = ["--bus", line.links["can0"][0], "--node", 2]
    line.bench.put("axes/reference/plant", {"friction_nm": 0})
    script = tmp_path / "enable.script"
    script.write_text("enable\n")
    servodrome("run", *drive, script)
    for index, value in (("6060", 3), ("6083", 10 * COUNTS), ("6084", 10 * COUNTS), ("60FF", COUNTS), ("6040", 15)):
        servodrome("set", *drive, index, value)

    def speed():
        return abs(line.bench.axis("reference")["velocity_rpm"])

    wait_for(lambda: speed() > 30, "the axis to turn")
    servodrome("scope", *drive, "position", "--disable", "--do", "wait 0.1")
    assert speed() < 1
    assert line.bench.axis("reference")["state"] != "operation enabled"


def speed(line, name):
    return abs(line.bench.axis(name)["velocity_rpm"])


@pytest.fixture
def kincos(tmp_path):
    """Two drives on EtherCAT whose 6007h is 0."""
    text = bus_text("ecat", "ethercat") + "".join(axis_text(name, "ismk-ea", bus="ecat") for name in ("first", "second"))
    line = Line(tmp_path, text, ("ecat=udp:127.0.0.1:0",))
    yield line
    line.stop()


def test_a_drive_on_ethercat_stops_when_the_other_loses_its_supply(kincos, tmp_path):
    script = tmp_path / "both.script"
    lines = ["axis a 1", "axis b 2", "units revolutions"]
    lines += [f"{axis} {step}" for step in ("reset", "enable", "velocity 1 acceleration 10") for axis in "ab"]
    script.write_text("\n".join([*lines, "wait 60\n"]))
    command = [PROGRAM, "run", "--bus", kincos.links["ecat"][0], str(script)]
    process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    wait_for(lambda: speed(kincos, "first") > 30 and speed(kincos, "second") > 30 or process.poll() is not None, "both axes")
    kincos.bench.post("axes/second/power", {"action": "off"})
    said = process.communicate(timeout=60)
    assert process.returncode == 1 and "both.script:" in said[1], said
    assert speed(kincos, "first") < 1
    assert kincos.bench.axis("first")["state"] != "operation enabled"


def jog(line, *options):
    command = [PROGRAM, "jog", "--bus", line.links["can0"][0], "--node", "2", "--revolutions", "--velocity", "0.3", "--seconds", "60"]
    process = subprocess.Popen([*command, *options], stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
    wait_for(lambda: speed(line, "reference") > 5 or process.poll() is not None, "the axis to turn")
    return process


def test_an_axis_that_the_script_only_reads_belongs_to_another_program(line, tmp_path):
    script = tmp_path / "read.script"
    script.write_text("axis a 1\naxis b 2\nb get 6063\na enable\na expect 6041 == 1\nb stop\n")
    other = jog(line)
    try:
        command = ["run", "--bus", line.links["can0"][0], "--disable", script]
        assert "a expect 6041 == 1" in servodrome(*command, status=1)
        assert speed(line, "reference") > 5 and line.bench.axis("ismc")["state"] != "operation enabled"
        script.write_text("axis a 1\naxis b 2\nb get 6063\na enable\n")
        servodrome(*command)
        assert speed(line, "reference") > 5 and line.bench.axis("ismc")["state"] != "operation enabled"
        assert other.poll() is None
    finally:
        other.terminate()
        other.wait(60)


def test_an_axis_that_the_script_only_reads_does_not_monitor_the_script(line, tmp_path):
    script = tmp_path / "read.script"
    script.write_text("axis a 1\naxis b 2\na enable\nb get 6063\nwait 60\n")
    other = jog(line, "--no-watch")
    try:
        process = subprocess.Popen([PROGRAM, "run", "--bus", line.links["can0"][0], str(script)], stdin=subprocess.DEVNULL)
        wait_for(lambda: line.bench.axis("ismc")["state"] == "operation enabled", "the script's own axis")
        assert line.bench.get("axes/ismc/objects/1016/1")["value"] != 0
        assert line.bench.get("axes/reference/objects/1016/1")["value"] == 0
        process.kill()
        process.wait()
        assert other.poll() is None and speed(line, "reference") > 5
    finally:
        other.terminate()
        other.wait(60)


def test_an_enable_after_a_restart_of_the_drive_renews_the_watch(line, tmp_path):
    script = tmp_path / "restart.script"
    script.write_text("axis a 1\na enable\na disable\nprint switched-off\nwait 3\na enable\nwait 60\n")
    process = subprocess.Popen(
        [PROGRAM, "run", "--bus", line.links["can0"][0], str(script)], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True
    )
    try:
        while "switched-off" not in process.stdout.readline():
            assert process.poll() is None
        line.bench.post("axes/ismc/power", {"action": "off"})
        line.bench.post("axes/ismc/power", {"action": "on"})
        wait_for(lambda: line.bench.axis("ismc")["state"] == "operation enabled", "the second enable")
        assert line.bench.get("axes/ismc/objects/1016/1")["value"] != 0
    finally:
        process.kill()
        process.wait()
