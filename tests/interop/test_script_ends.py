"""The end of `servodrome run --disable` and `scope --disable`: the axes are at rest and off, or the command fails."""

import json
import subprocess

import pytest
from line import COUNTS, PROGRAM, servodrome, wait_for

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
