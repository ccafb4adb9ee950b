"""`trial` runs a third-party master (canopen) through scenarios, in real time."""

import json
import os
import pathlib
import signal
import subprocess
import sys
import time
import tomllib
import xml.etree.ElementTree as ET

import pytest

ROOT = pathlib.Path(__file__).parents[2]
PROGRAM = os.environ["SERVODROME"]
MASTER = [sys.executable, str(ROOT / "examples/masters/canopen_master.py"), "{host}", "{port}", "4"]  # patient, since the machine may be busy

pytestmark = pytest.mark.once

GOOD = 'title = "good"\nline = "LINE"\nmaster = "success"\nduration_s = 60\n[[rule]]\non = { message = "sdo_answer", object = "6041" }\ndo = "delay"\nms = 2\n'
MISSING = 'title = "missing"\nline = "LINE"\nmaster = "success"\nduration_s = 60\n[[rule]]\non = { message = "sdo_answer", object = "6040" }\ndo = "withhold"\ntimes = 1\n'
ELSEWHERE = 'title = "elsewhere"\nline = "LINE"\nduration_s = 60\n[[rule]]\non = { message = "lss_request" }\ndo = "withhold"\n'
# Reads 1000h once.
SPEAKS = [
    sys.executable,
    "-c",
    """
import os
import sys
import can
bus = can.Bus(interface="socketcand", host=sys.argv[1], port=int(sys.argv[2]), channel="can0")
bus.send(can.Message(arbitration_id=0x601, data=bytes.fromhex("4000100000000000"), is_extended_id=False))
while bus.recv(30).arbitration_id != 0x581:
    pass
bus.shutdown()
""",
    "{host}",
    "{port}",
]
HANGS = 'title = "hangs"\nline = "LINE"\nmaster = "success"\nduration_s = 1\n[[rule]]\ndo = "show"\nobject = "6041"\nvalue = 0\n'


def trial(folder, scenarios, master=MASTER, options=(), after="2.2"):
    for name, text in scenarios.items():
        (folder / f"{name}.toml").write_text(text.replace("LINE", str(ROOT / "scenarios/lines/can.toml")))
    command = [PROGRAM, "trial", "--scenarios", str(folder), "--after", after, *options, "--", *master]
    return subprocess.run(command, capture_output=True, text=True, timeout=300)


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
    # Each of four trials has a picture of the shaft and one of the states.
    assert page.count("<svg") == 8 and "rests after the master has ended" in page
    assert "operation enabled" in page and "Statusword" in page


def test_the_traffic_around_a_failure_is_shown_in_words(tmp_path):
    scenarios, kept = tmp_path / "scenarios", tmp_path / "kept"
    scenarios.mkdir()
    html = tmp_path / "trial.html"
    done = trial(scenarios, {"missing": MISSING}, options=["--json", "--html", str(html), "--keep", str(kept)])
    (result,) = json.loads(done.stdout)
    (bus,) = result["traffic"]
    assert bus["bus"] == "can0"
    lines = bus["lines"]
    (act,) = [line for line in lines if line["kind"] == "act"]
    assert act["from"] == "x" and act["raw"].startswith("581 [8] 60 40 60 00")
    assert act["text"] == 'rule "rule 1": withhold sdo_answer 6040h:00 (SDO written 6040:00 Controlword); nothing passes'
    place = lines.index(act)
    assert lines[place - 1]["text"] == "SDO write 6040:00 Controlword = 6 (0006h)" and lines[place - 1]["from"] == "master"
    moments = [line["text"] for line in lines if line["kind"] == "moment"]
    assert moments == ['first act of the rule "rule 1"', "failed: the master ended with status 1"]
    # Each frame occurs once; omitted parts are marked.
    assert [line["at_s"] for line in lines] == sorted(line["at_s"] for line in lines)
    assert sum(line["kind"] in ("frame", "error") for line in lines) <= 2 * (40 + 20)
    assert all(line["text"].endswith("lines are left out") for line in lines if line["kind"] == "gap")
    # The withheld answer is not in the capture; its request is.
    (capture,) = result["captures"]
    assert pathlib.Path(capture).parent == kept and pathlib.Path(capture).name == "scenarios-missing.can0.log"
    text = pathlib.Path(capture).read_text()
    assert "601#2B40600006000000" in text and text.count("581#6040600000000000") == text.count("601#2B406000") - 1
    page = html.read_text()
    assert "withhold sdo_answer" in page and f"servodrome sniff {capture}" in page


def test_output_that_is_not_text_does_not_spoil_the_reports(tmp_path):
    master = [sys.executable, "-c", "import sys; sys.stdout.buffer.write(b'caf\\xe9 \\x00\\x1b[31m <&\\n'); sys.exit(1)"]
    scenarios, junit, html = tmp_path / "scenarios", tmp_path / "trial.xml", tmp_path / "trial.html"
    scenarios.mkdir()
    done = trial(scenarios, {"missing": MISSING}, master, ["--json", "--junit", str(junit), "--html", str(html)])
    assert json.loads(done.stdout)[0]["output"] == "caf\ufffd \0\x1b[31m <&\n"
    ET.parse(junit)
    assert "caf\ufffd" in html.read_text(encoding="utf-8") and "&lt;&amp;" in html.read_text(encoding="utf-8")


def test_captures_of_two_scenarios_do_not_replace_each_other(tmp_path):
    (tmp_path / "a/same").mkdir(parents=True)
    (tmp_path / "b/same").mkdir(parents=True)
    for folder in ("a", "b"):
        (tmp_path / folder / "same/missing.toml").write_text(MISSING.replace("LINE", str(ROOT / "scenarios/lines/can.toml")))
    done = trial(tmp_path, {}, ["true"], ["--keep", str(tmp_path / "kept")])
    assert done.returncode == 2 and "a/same/missing.toml and " in done.stderr and "the same names" in done.stderr, done.stderr


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


def test_a_master_that_does_not_end_fails_unless_the_scenario_waives_it(tmp_path):
    waits = HANGS.replace('master = "success"', 'master = "any"')
    waived = waits.replace("[[rule]]", '[waive]\nends = "it waits for the operator"\n[[rule]]')
    done = trial(tmp_path, {"waits": waits, "waived": waived}, ["sleep", "30"], options=["--json"])
    outcomes = {pathlib.Path(one["scenario"]).stem: one for one in json.loads(done.stdout)}
    assert outcomes["waits"]["outcome"] == "failed"
    assert (outcomes["waived"]["outcome"], outcomes["waived"]["reason"]) == ("not reached", "the master sent nothing on the bus")
    verdicts = {stem: {one["name"]: one for one in result["expectations"]} for stem, result in outcomes.items()}
    assert verdicts["waits"]["the master ends by itself"]["found"] == "the trial ended it after 1 s"
    assert verdicts["waived"]["the master ends by itself"]["found"] == "waived: it waits for the operator"


def test_a_failing_scenario_is_made_smaller(tmp_path):
    """Only one of three rules makes the master fail; its condition and its second act are not necessary."""
    rules = """
[[rule]]
name = "late"
on = { message = "sdo_answer", object = "1000" }
do = "delay"
ms = 5

[[rule]]
name = "culprit"
when = { powered = true, time_ms = 1 }
on = { message = "sdo_answer", object = "6040" }
do = "withhold"
times = 2

[[rule]]
name = "lie"
do = "show"
object = "6078"
value = 3
"""
    text = 'title = "t"\nline = "LINE"\nmaster = "success"\nduration_s = 60\n' + rules
    done = trial(tmp_path, {"big": text}, options=["--minimise", "--runs", "40"], after="0.2")
    assert done.returncode == 0, done.stdout + done.stderr
    assert 'without the rule "late": still fails' in done.stdout and "does not fail in this way" in done.stdout
    small = tmp_path / "big.minimal.toml"
    assert f"the same again: servodrome trial --scenarios {small} -- " in done.stdout
    content = tomllib.loads(small.read_text())
    (rule,) = content["rule"]
    assert rule == {"name": "culprit", "on": {"message": "sdo_answer", "object": "6040"}, "do": "withhold", "times": 1}
    assert content["seed"] == 1 and content["duration_s"] == 60 and content["line"] == str(ROOT / "scenarios/lines/can.toml")
    assert (tmp_path / "big.toml").read_text() == text.replace("LINE", content["line"])
    # The small scenario fails in the same way, and is not written again because it cannot be made smaller.
    again = trial(tmp_path, {}, options=["--only", "minimal", "--json"], after="0.2")
    assert json.loads(again.stdout)[0]["reason"] == "the master ended with status 1"
    passes = trial(tmp_path, {"good": GOOD}, options=["--only", "good.toml", "--minimise"])
    assert passes.returncode == 1 and "does not fail with this master" in passes.stderr
    both = trial(tmp_path, {}, options=["--minimise"])
    assert both.returncode == 2 and "choose one with --only" in both.stderr
    reported = trial(tmp_path, {}, options=["--only", "minimal", "--minimise", "--junit", str(tmp_path / "a.xml")])
    assert reported.returncode == 2 and "--junit excludes --minimise" in reported.stderr


def test_an_interrupted_search_says_so(tmp_path):
    """Ctrl-C between two runs: nobody takes what is left for the smallest scenario."""
    rules = "".join(f'[[rule]]\nname = "{n}"\non = {{ message = "sdo_answer", object = "1000" }}\ndo = "delay"\nms = {n}\n' for n in range(1, 9))
    (tmp_path / "big.toml").write_text((MISSING + rules).replace("LINE", str(ROOT / "scenarios/lines/can.toml")))
    command = [PROGRAM, "trial", "--scenarios", str(tmp_path), "--after", "0.2", "--minimise", "--", *MASTER]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        while "still fails" not in process.stdout.readline():
            assert process.poll() is None, process.stderr.read()
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=60)
    assert process.returncode == 130 and "the search was interrupted" in errors
    small = tmp_path / "big.minimal.toml"
    assert str(small) in errors and tomllib.loads(small.read_text())


def test_a_stopped_machine_changes_no_verdict(tmp_path):
    """The process of the line gets no processor time for longer than --after; the line then continues where it was."""
    (tmp_path / "scenarios").mkdir()
    text = 'title = "t"\n[[rule]]\ndo = "show"\nobject = "6041"\nvalue = 0\n'
    (tmp_path / "scenarios/t.toml").write_text(text.replace("\n", f'\nline = "{ROOT / "scenarios/lines/can.toml"}"\n', 1))
    ended = tmp_path / "ended"
    command = [PROGRAM, "trial", "--scenarios", str(tmp_path / "scenarios"), "--after", "2.2", "--json", "--", "touch", str(ended)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    while not ended.exists():
        time.sleep(0.01)
    process.send_signal(signal.SIGSTOP)
    time.sleep(3)
    process.send_signal(signal.SIGCONT)
    (result,) = json.loads(process.communicate(timeout=120)[0])
    outcomes = {one["name"]: one["outcome"] for one in result["expectations"]}
    assert outcomes["x rests after the master has ended"] == "passed"
    assert result["seconds"] >= 2.2


def test_a_trial_that_ends_too_early_has_not_passed(tmp_path):
    rules = 'title = "t"\nline = "LINE"\n[[rule]]\ndo = "show"\nobject = "606C"\nvalue = 0\n'
    done = trial(tmp_path, {"t": rules}, SPEAKS, ["--json"], after="1")
    (result,) = json.loads(done.stdout)
    assert result["outcome"] == "not reached" and "was not watched" in result["reason"]


@pytest.mark.parametrize(
    ("master", "outcome", "reason"),
    [
        (["true"], "not reached", "the master sent nothing on the bus"),
        (["false"], "failed", "the master ended with status 1 before it sent anything"),
        (SPEAKS, "passed", None),
        ([*SPEAKS[:2], SPEAKS[2] + "os.abort()", *SPEAKS[3:]], "failed", None),
    ],
    ids=["true", "false", "speaks", "crashes"],
)
def test_a_master_that_sends_nothing_or_crashes_does_not_pass(tmp_path, master, outcome, reason):
    rules = 'title = "t"\nline = "LINE"\n[[rule]]\ndo = "show"\nobject = "606C"\nvalue = 0\n'
    (result,) = json.loads(trial(tmp_path, {"t": rules}, master, ["--json"]).stdout)
    assert (result["outcome"], result.get("reason") or None) == (outcome, reason)


def test_the_trial_replaces_variables_that_a_shell_would_inherit(tmp_path):
    os.environ["SERVODROME_LINK"] = "old"
    try:
        done = trial(tmp_path, {"t": ELSEWHERE}, ["sh", "-c", "echo $SERVODROME_LINK"], ["--json"], after="0.1")
    finally:
        del os.environ["SERVODROME_LINK"]
    (result,) = json.loads(done.stdout)
    assert result["output"].startswith("socketcand:")


@pytest.mark.parametrize("wanted", ["success", "failure"])
def test_an_interrupted_trial_has_no_outcome(tmp_path, wanted):
    report = tmp_path / "report.xml"
    text = HANGS.replace('master = "success"', f'master = "{wanted}"').replace("duration_s = 1\n", "duration_s = 60\n")
    (tmp_path / "t.toml").write_text(text.replace("LINE", str(ROOT / "scenarios/lines/can.toml")))
    started = tmp_path / "started"
    command = [PROGRAM, "trial", "--scenarios", str(tmp_path / "t.toml"), "--junit", str(report), "--", "sh", "-c", f"touch {started}; sleep 60"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        while not started.exists():
            time.sleep(0.01)
        process.send_signal(signal.SIGINT)
        output, errors = process.communicate(timeout=60)
    assert process.returncode == 130 and "interrupted: 0 of 1 trials are done" in errors
    assert output == "0 passed, 0 failed, 0 not reached, 0 errors\n"
    assert ET.parse(report).getroot().find(".//testcase") is None


def test_the_list_checks_the_scenarios(tmp_path):
    wrong = {
        "action": GOOD + '[[rule]]\ndo = "fly"\n',
        "axis": GOOD + '[[rule]]\naxis = "z"\ndo = "power"\n',
        "never": GOOD + "[[expect]]\neventually = { powered = true }\nwithin_ms = 90000\n",
    }
    done = trial(tmp_path, {"good": GOOD, **wrong}, ["true"], ["--list"])
    assert done.returncode == 1 and "3 of 4 scenarios have errors" in done.stderr
    assert len(done.stdout.splitlines()) == 4 and " good\n" in done.stdout
    for problem in ('there is no action "fly"', 'there is no axis "z"', "within_ms is longer than `duration_s`"):
        assert problem in done.stderr


def test_a_master_that_breaks_down_before_any_rule_acts_fails(tmp_path):
    done = trial(tmp_path, {"elsewhere": ELSEWHERE}, ["sh", "-c", "kill -SEGV $$"], ["--json"])
    (result,) = json.loads(done.stdout)
    assert done.returncode == 1 and result["outcome"] == "failed"
    ends = next(one for one in result["expectations"] if one["name"] == "the master ends by itself")
    assert ends["found"] == "SIGSEGV ended it (status 139)"


def test_random_scenarios_are_drawn_by_their_seed(tmp_path):
    def drawn(folder, *options):
        command = [PROGRAM, "trial", "--scenarios", str(ROOT / "scenarios/canopen"), "--random", "3", "--keep", str(folder), *options, "--", "true"]
        subprocess.run(command, capture_output=True, text=True, check=True)
        return {file.name: file.read_text() for file in sorted(folder.iterdir())}

    first, second = drawn(tmp_path / "a", "--list"), drawn(tmp_path / "b", "--list")
    assert first == second and list(first) == ["random-1-1.toml", "random-1-2.toml", "random-1-3.toml"]
    assert drawn(tmp_path / "c", "--list", "--seed", "2") != first
    for text in first.values():
        content = tomllib.loads(text)
        assert len(content["rule"]) >= 2 and (tmp_path / "a" / content["line"]).exists()
    done = trial(tmp_path / "a", {}, ["sleep", "0.2"], ["--json", "--only", "random-1-2"])
    (result,) = json.loads(done.stdout)
    assert result["outcome"] == "not reached" and len(result["expectations"]) >= 5


def test_wrong_use_is_explained(tmp_path):
    assert "write its command behind --" in subprocess.run(
        [PROGRAM, "trial", "--scenarios", str(ROOT / "scenarios/canopen")], capture_output=True, text=True
    ).stderr
    empty = subprocess.run([PROGRAM, "trial", "--scenarios", str(tmp_path), "--", "true"], capture_output=True, text=True)
    assert empty.returncode == 2 and "there are no scenarios" in empty.stderr
    (tmp_path / "s.toml").write_text(GOOD.replace("LINE", str(ROOT / "scenarios/lines/can.toml")))
    absent = trial(tmp_path, {}, ["no-such-program"])
    assert "\"no-such-program\" cannot be started" in absent.stdout and absent.returncode == 1
