"""`trial` runs a master of another project (canopen) through scenarios, in real time."""

import json
import os
import pathlib
import subprocess
import sys
import xml.etree.ElementTree as ET

import pytest

ROOT = pathlib.Path(__file__).parents[2]
PROGRAM = os.environ["SERVODROME"]
MASTER = [sys.executable, str(ROOT / "examples/masters/canopen_master.py"), "{host}", "{port}"]

pytestmark = pytest.mark.once

GOOD = 'title = "good"\nline = "LINE"\nmaster = "success"\n[[rule]]\non = { message = "sdo_answer", object = "6041" }\ndo = "delay"\nms = 2\n'
MISSING = 'title = "missing"\nline = "LINE"\nmaster = "success"\n[[rule]]\non = { message = "sdo_answer", object = "6040" }\ndo = "withhold"\ntimes = 1\n'
ELSEWHERE = 'title = "elsewhere"\nline = "LINE"\n[[rule]]\non = { message = "lss_request" }\ndo = "withhold"\n'
HANGS = 'title = "hangs"\nline = "LINE"\nmaster = "success"\nduration_s = 1\n[[rule]]\ndo = "show"\nobject = "6041"\nvalue = 0\n'


def trial(folder, scenarios, master=MASTER, options=(), after="0.5"):
    for name, text in scenarios.items():
        (folder / f"{name}.toml").write_text(text.replace("LINE", str(ROOT / "scenarios/lines/can.toml")))
    command = [PROGRAM, "trial", "--scenarios", str(folder), "--after", after, *options, "--", *master]
    return subprocess.run(command, capture_output=True, text=True, timeout=120)


def test_outcomes_and_reports(tmp_path):
    reports = tmp_path / "reports"
    scenarios = tmp_path / "scenarios"
    reports.mkdir()
    scenarios.mkdir()
    junit, html = reports / "trial.xml", reports / "trial.html"
    done = trial(
        scenarios,
        {"good": GOOD, "missing": MISSING, "elsewhere": ELSEWHERE, "hangs": HANGS, "error": GOOD + "[[rule]]\ndo = \"fly\"\n"},
        options=["--json", "--junit", str(junit), "--html", str(html)],
    )
    assert done.returncode == 1, done.stderr
    outcomes = {pathlib.Path(one["scenario"]).stem: one for one in json.loads(done.stdout)}
    assert {name: one["outcome"] for name, one in outcomes.items()} == {
        "good": "passed",
        "missing": "failed",
        "elsewhere": "not reached",
        "hangs": "failed",
        "error": "error",
    }
    assert outcomes["missing"]["reason"] == "the master ended with status 1"
    assert outcomes["hangs"]["was_ended"]
    assert 'there is no action "fly"' in outcomes["error"]["reason"]
    assert outcomes["good"]["rules"][0]["acts"] > 10
    suite = ET.parse(junit).getroot().find("testsuite")
    assert {key: suite.get(key) for key in ("tests", "failures", "errors", "skipped")} == {
        "tests": "5",
        "failures": "2",
        "errors": "1",
        "skipped": "1",
    }
    page = html.read_text()
    assert page.count("<svg") == 4 and "rests after the master has ended" in page


def test_a_master_that_leaves_its_axis_moving_is_told_so(tmp_path):
    master = [
        sys.executable,
        "-c",
        """
import sys
import time
import canopen
network = canopen.Network()
network.connect(interface="socketcand", host=sys.argv[1], port=int(sys.argv[2]), channel="can0")
sdo = network.add_node(1, canopen.ObjectDictionary()).sdo
for index, value, size in ((0x6060, 3, 1), (0x6083, 1310720, 4), (0x6040, 6, 2), (0x6040, 7, 2), (0x6040, 15, 2)):
    sdo.download(index, 0, value.to_bytes(size, "little"))
    time.sleep(0.3)
sdo.download(0x60FF, 0, (131072).to_bytes(4, "little"))
time.sleep(0.5)
network.disconnect()
""",
        "{host}",
        "{port}",
    ]
    rules = 'title = "t"\nline = "LINE"\n[[rule]]\ndo = "show"\nobject = "606C"\nvalue = 0\n'
    done = trial(tmp_path, {"t": rules}, master, after="3")
    assert done.returncode == 1
    assert "x rests after the master has ended: at" in done.stdout


def test_wrong_use_is_explained(tmp_path):
    assert "write its command behind --" in subprocess.run(
        [PROGRAM, "trial", "--scenarios", str(ROOT / "scenarios/canopen")], capture_output=True, text=True
    ).stderr
    empty = subprocess.run([PROGRAM, "trial", "--scenarios", str(tmp_path), "--", "true"], capture_output=True, text=True)
    assert empty.returncode == 2 and "there are no scenarios" in empty.stderr
    (tmp_path / "s.toml").write_text(GOOD.replace("LINE", str(ROOT / "scenarios/lines/can.toml")))
    absent = trial(tmp_path, {}, ["no-such-program"])
    assert "\"no-such-program\" cannot be started" in absent.stdout and absent.returncode == 1
