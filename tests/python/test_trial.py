"""`python -m servodrome trial`: an unmodified master through scenarios, in virtual time."""

import json
import os
import pathlib
import subprocess
import sys
import xml.etree.ElementTree as ET

import pytest
import servodrome
from conftest import ROOT
from servodrome.trial import Trial, files_of, run_trials

MASTER = str(ROOT / "examples/masters/canopen_master.py")
LINE = f'line = "{ROOT / "scenarios/lines/can.toml"}"\n'
GOOD = 'title = "good"\n' + LINE + 'master = "success"\n[[rule]]\non = { message = "sdo_answer", object = "6041" }\ndo = "delay"\nms = 2\n'
MISSING = 'title = "missing"\n' + LINE + 'master = "success"\n[[rule]]\non = { message = "sdo_answer", object = "6040" }\ndo = "withhold"\ntimes = 1\n'
ELSEWHERE = 'title = "elsewhere"\n' + LINE + '[[rule]]\non = { message = "lss_request" }\ndo = "withhold"\n'
BROKEN = GOOD + '[[rule]]\ndo = "fly"\n'


def command(folder, *options, master=MASTER, arguments=("{host}", "{port}"), hash_seed="1"):
    environment = {**os.environ, "PYTHONPATH": str(pathlib.Path(servodrome.__file__).parents[1]), "PYTHONHASHSEED": hash_seed}
    words = [sys.executable, "-m", "servodrome", "trial", "--scenarios", str(folder), *options, str(master), *arguments]
    return subprocess.run(words, capture_output=True, text=True, timeout=300, env=environment)


@pytest.fixture
def scenarios(tmp_path):
    folder = tmp_path / "scenarios"
    folder.mkdir()
    for name, text in {"good": GOOD, "missing": MISSING, "elsewhere": ELSEWHERE, "broken": BROKEN}.items():
        (folder / f"{name}.toml").write_text(text)
    return folder


def test_outcomes_and_reports_are_those_of_the_program(scenarios, tmp_path):
    junit, html, kept = tmp_path / "t.xml", tmp_path / "t.html", tmp_path / "kept"
    done = command(scenarios, "--json", "--junit", str(junit), "--html", str(html), "--keep", str(kept))
    assert done.returncode == 1, done.stderr
    outcomes = {pathlib.Path(one["scenario"]).stem: one for one in json.loads(done.stdout)}
    assert {name: one["outcome"] for name, one in outcomes.items()} == {
        "good": "passed",
        "missing": "failed",
        "elsewhere": "not reached",
        "broken": "error",
    }
    assert outcomes["missing"]["reason"] == "the master ended with status 1"
    assert 'there is no action "fly"' in outcomes["broken"]["reason"]
    assert outcomes["good"]["rules"][0]["acts"] > 10 and outcomes["good"]["output"].endswith("done\n")
    assert "x rests after the master has ended" in [one["name"] for one in outcomes["good"]["expectations"]]
    (bus,) = outcomes["missing"]["traffic"]
    assert any(line["kind"] == "act" and "SDO written 6040:00 Controlword" in line["text"] for line in bus["lines"])
    suite = ET.parse(junit).getroot().find("testsuite")
    assert [suite.get(key) for key in ("tests", "failures", "errors", "skipped")] == ["4", "1", "1", "1"]
    page = html.read_text()
    assert page.count("<svg") == 6 and "withhold sdo_answer" in page and page.rstrip().endswith("</html>")
    assert sorted(file.name for file in kept.iterdir()) == [
        "scenarios-elsewhere.can0.pcap",
        "scenarios-good.can0.pcap",
        "scenarios-missing.can0.pcap",
    ]


def test_a_refused_request_leaves_the_running_trial():
    with servodrome.Line.from_file(ROOT / "scenarios/lines/can.toml") as line:
        line.request("PUT", "trial", {"text": GOOD, "file": "good.toml", "after_s": 0})
        for method, place, body in (
            ("PUT", "trial", {"text": BROKEN}),
            ("PUT", "trial", {"text": 'title = "t"\n[[rule]]\naxis = "nobody"\ndo = "power"\n'}),
            ("PUT", "scenario", {"text": 'title = "other"\n'}),
            ("DELETE", "scenario", None),
        ):
            with pytest.raises(servodrome.Error):
                line.request(method, place, body)
        line.advance(0.5)
        line.request("POST", "trial/master", {"exit_status": 0})
        ended = json.loads(line.request("DELETE", "trial")["trial"])
        assert ended["title"] == "good" and ended["seconds"] == 0.5
        assert line.request("PUT", "scenario", {"text": 'title = "other"\n'})["title"] == "other"


def test_two_runs_are_equal(scenarios):
    first = command(scenarios, "--json", "--jobs", "1", hash_seed="1")
    second = command(scenarios, "--json", "--jobs", "4", hash_seed="2")
    assert first.stdout == second.stdout and json.loads(first.stdout)


def test_a_master_that_does_not_end_is_ended(scenarios, tmp_path):
    master = tmp_path / "hangs.py"
    master.write_text("import time\nprint('begun')\nwhile True:\n    time.sleep(1)\n")
    (scenarios / "hangs.toml").write_text('title = "hangs"\n' + LINE + 'duration_s = 300\n[[rule]]\ndo = "show"\nobject = "6041"\nvalue = 0\n')
    done = command(scenarios, "--json", "--only", "hangs", master=master, arguments=())
    (result,) = json.loads(done.stdout)
    assert result["was_ended"] and result["outcome"] == "failed" and result["output"] == "begun\n"
    verdicts = {one["name"]: one for one in result["expectations"]}
    assert verdicts["the master ends by itself"]["found"] == "the trial ended it after 300 s"
    assert result["seconds"] == 303.0


def test_exit_status_and_exceptions_are_those_of_a_process(scenarios, tmp_path):
    (scenarios / "quiet.toml").write_text('title = "quiet"\n' + LINE + '[[rule]]\ndo = "show"\nobject = "6041"\nvalue = 0\n')
    cases = {
        "import sys\nsys.exit(3)\n": (3, ""),
        "import sys\nsys.exit('no drive')\n": (1, "no drive\n"),
        "import sys\nprint(sys.argv[1:])\n": (0, "['can0', 'x']\n"),
        "raise KeyError('a')\n": (1, "KeyError: 'a'\n"),
    }
    for text, (status, output) in cases.items():
        master = tmp_path / "master.py"
        master.write_text(text)
        (result,) = json.loads(command(scenarios, "--json", "--only", "quiet", master=master, arguments=("{link}", "x")).stdout)
        assert result["exit_status"] == status and result["output"].endswith(output), text


# Each prints at its end, in the order of an interpreter: the program, its threads, the functions of atexit.
ENDS = """
import atexit, threading, time
from concurrent.futures import ThreadPoolExecutor

atexit.register(print, "last")
atexit.register(print, "first of atexit")

def work():
    time.sleep(2)
    print("thread", threading.current_thread().daemon)

threading.Thread(target=work).start()
threading.Thread(target=lambda: (time.sleep(5), print("a daemon")), daemon=True).start()
ThreadPoolExecutor(1).submit(lambda: (time.sleep(1), print("pool")))
print("program")
"""


def test_a_master_ends_with_its_threads_and_exit_functions(scenarios, tmp_path):
    (scenarios / "quiet.toml").write_text('title = "quiet"\n' + LINE + '[[rule]]\ndo = "show"\nobject = "6041"\nvalue = 0\n')
    master = tmp_path / "master.py"
    master.write_text(ENDS)
    (result,) = json.loads(command(scenarios, "--json", "--only", "quiet", master=master, arguments=()).stdout)
    assert result["output"].splitlines() == ["program", "pool", "thread False", "first of atexit", "last"]
    assert result["exit_status"] == 0 and result["seconds"] == pytest.approx(2 + 3, abs=0.1)


def test_a_thread_that_does_not_end_is_a_master_that_does_not_end(scenarios, tmp_path):
    (scenarios / "quiet.toml").write_text('title = "quiet"\n' + LINE + '[[rule]]\ndo = "show"\nobject = "6041"\nvalue = 0\n')
    master = tmp_path / "master.py"
    master.write_text("import threading, time\nthreading.Thread(target=time.sleep, args=(1000,)).start()\n")
    (result,) = json.loads(command(scenarios, "--json", "--only", "quiet", master=master, arguments=()).stdout)
    assert result["was_ended"] and result["outcome"] == "failed"


def test_files_of_the_library_run_equally():
    files = files_of([str(ROOT / "scenarios/canopen")], "sdo-answer-missing")
    trial = Trial(MASTER, ("{host}", "{port}"))
    outcomes = [[report.view for report in run_trials(trial, files, jobs=2)] for _ in range(2)]
    assert outcomes[0] == outcomes[1] and len(files) == 2
    found = {pathlib.Path(one["scenario"]).stem: one["outcome"] for one in outcomes[0]}
    assert found["sdo-answer-missing-once"] == "failed" and found["sdo-answer-missing-forever"] == "passed"


def test_wrong_use_is_explained(tmp_path):
    done = command(tmp_path)
    assert done.returncode == 2 and "there are no scenarios" in done.stderr
