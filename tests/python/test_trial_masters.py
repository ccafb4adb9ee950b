"""`python -m servodrome trial`: what masters do as processes, and what ends them and the command."""

import json
import os
import pathlib
import signal
import subprocess
import sys
import time

import pytest
import servodrome
from conftest import ROOT
from servodrome import trial
from servodrome.trial import Trial, run_trials

LINE = f'line = "{ROOT / "scenarios/lines/can.toml"}"\n'
SHOWS = 'duration_s = 20\n[[rule]]\ndo = "show"\nobject = "6041"\nvalue = 0\n'
QUIET = 'title = "quiet"\n' + LINE + SHOWS


@pytest.fixture
def run(tmp_path):
    """The report of a master in one scenario."""

    def act(master, scenario=QUIET, arguments=(), after_s=0.0):
        (tmp_path / "master.py").write_text(master)
        (tmp_path / "quiet.toml").write_bytes(scenario if isinstance(scenario, bytes) else scenario.encode())
        (report,) = run_trials(Trial(str(tmp_path / "master.py"), arguments, after_s), [str(tmp_path / "quiet.toml")])
        return report.view

    return act


@pytest.fixture
def command(tmp_path):
    """Starts the command with a master, and scenarios by name."""

    def start(master, *options, scenarios=("one",), arguments=()):
        (tmp_path / "master.py").write_text(master)
        folder = tmp_path / "scenarios"
        folder.mkdir(exist_ok=True)
        for name in scenarios:
            (folder / f"{name}.toml").write_text(QUIET)
        environment = {**os.environ, "PYTHONPATH": str(pathlib.Path(servodrome.__file__).parents[1])}
        words = [sys.executable, "-m", "servodrome", "trial", "--scenarios", str(folder), "--after", "0", *options, str(tmp_path / "master.py"), *arguments]
        return subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment)

    return start


# ---- The main thread, and the output ----

MAIN_THREAD = """
import asyncio, faulthandler, os, signal, sys, threading
assert threading.current_thread() is threading.main_thread() and threading.active_count() == 1
signal.signal(signal.SIGTERM, signal.SIG_DFL)
faulthandler.enable()
sys.stdout.reconfigure(encoding="utf-8")

async def main():
    asyncio.get_running_loop().add_signal_handler(signal.SIGUSR1, lambda: None)
    await asyncio.sleep(1)
    os.write(1, b"direct\\n")
    sys.stdout.buffer.write(b"bytes\\n")
    sys.stdout.flush()
    os.system("echo of a shell; echo error of a shell >&2")
    print("text", file=sys.stderr)

asyncio.run(main())
"""


def test_a_master_has_the_main_thread_and_file_descriptors(run):
    view = run(MAIN_THREAD)
    assert view["exit_status"] == 0, view["output"]
    assert view["output"].splitlines() == ["direct", "bytes", "of a shell", "error of a shell", "text"] and view["seconds"] == 1.0


def test_the_output_is_its_end_from_a_whole_character_on(run):
    view = run("import sys\nsys.stdout.buffer.write(b'x' + '\\u00e9'.encode() * 3000 + b'\\xff end')\n")
    assert view["output"] == "...\n" + "\u00e9" * 1997 + "\ufffd end"


def test_the_end_of_its_time_ends_any_master(run):
    """Also one that catches every exception, in the main thread or another one."""
    master = """
import threading, time
def wait():
    while True:
        try:
            time.sleep(1)
        except BaseException:
            pass
threading.Thread(target=wait).start()
print("begun", end="")
wait()
"""
    view = run(master, after_s=1.0)
    assert view["was_ended"] and view["output"] == "begun" and view["seconds"] == 21.0


def test_the_date_is_line_time(run):
    master = """
import datetime, time
from datetime import date, datetime as dt
class Mine(dt):
    pass
for now in (dt.now(), dt.utcnow(), dt.today(), datetime.datetime.now(datetime.timezone.utc), Mine.now()):
    assert now.year == 2026 and now.timestamp() - time.time() < 1, now
    assert isinstance(now, dt) and isinstance(now, date)
assert type(dt.now()) is type(dt.now() + datetime.timedelta(1)) and type(Mine.now()) is Mine and not isinstance(dt.now(), Mine)
begin = dt.now()
time.sleep(10)
print(round((dt.now() - begin).total_seconds(), 3), date.today(), datetime.date.today() == dt.now().date())
print(time.strftime("%d"), time.localtime().tm_year, isinstance(date(2026, 1, 1), dt), issubclass(dt, date))
"""
    view = run(master)
    assert view["exit_status"] == 0, view["output"]
    assert view["output"] == "10.0 2026-01-01 True\n01 2026 False True\n"


# ---- The end of a master ----


@pytest.mark.parametrize(
    ("master", "status"),
    [
        ("import os\nprint('said', flush=True)\nos._exit(0)\n", 0),
        ("import os, threading\nprint('said', flush=True)\nthreading.Thread(target=os._exit, args=(3,)).start()\n", 3),
        ("import os, sys\nprint('said', flush=True)\nif os.fork() == 0: os._exit(5)\nos.wait()\nsys.exit(256)\n", 0),
    ],
)
def test_os_exit_is_an_end(run, master, status):
    view = run(master)
    assert (view["exit_status"], view["was_ended"], view["output"]) == (status, False, "said\n")


def test_a_master_that_a_signal_ends_has_failed(run):
    view = run("import os, signal\nprint('said', flush=True)\nos.kill(os.getpid(), signal.SIGSEGV)\n")
    assert view["outcome"] == "failed" and view["reason"] == "the master was ended by signal 11 (SIGSEGV)"
    assert view["title"] == "quiet" and view["output"].startswith("said\n")


def test_a_child_that_a_master_leaves_is_killed(run):
    view = run("import subprocess\nprint(subprocess.Popen(['sleep', '100']).pid)\n")
    assert view["exit_status"] == 0
    await_end(int(view["output"]))


def await_end(process):
    end = time.monotonic() + 20
    while state_of(process) not in ("", "Z"):
        assert time.monotonic() < end
        time.sleep(0.01)


def state_of(process):
    """The letter of /proc: "R", "S", "Z" (its parent has not waited for it yet); empty: it does not exist."""
    try:
        return pathlib.Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return ""


def test_a_master_that_only_computes_has_a_limit(run, monkeypatch):
    monkeypatch.setattr(trial, "_SLOWEST", 0.0)
    monkeypatch.setattr(trial, "_LEAST_LIMIT_S", 3.0)
    view = run("print('begun')\nwhile True: pass\n")
    assert view["outcome"] == "error" and view["output"] == "begun\n"
    assert view["reason"].startswith("the trial takes more than 3 s of wall time: the master computes without waiting")


def test_the_limit_is_that_of_the_program():
    text = (ROOT / "src/app/trial_run.cpp").read_text()
    for words in ("slowest = 10;", "least_limit = std::chrono::seconds(60);", "time_to_terminate = std::chrono::seconds(2);"):
        assert words in text
    assert trial.limit_of(Trial("", after_s=3.0), 20) == 10 * (20 + 2 + 3) + 60
    with servodrome.Line.from_file(ROOT / "scenarios/lines/can.toml") as line:
        assert line.request("PUT", "trial", {"text": 'title = "t"\n'})["duration_s"] == trial._DURATION_S


HANGS_IN_TWO = """
import os, sys
if "two" in sys.argv[1]:
    open(os.path.join(os.path.dirname(__file__), "begun"), "w")
    while True: pass
"""


def await_file(path):
    while not path.exists():
        time.sleep(0.01)


@pytest.mark.parametrize(("number", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_an_interrupted_command_reports_what_is_done(command, tmp_path, number, status):
    junit = tmp_path / "t.xml"
    process = command(HANGS_IN_TWO, "--jobs", "1", "--junit", str(junit), scenarios=("one", "two", "x"), arguments=("{scenario}",))
    assert " one.toml" in process.stdout.readline().replace("/", " ")
    await_file(tmp_path / "begun")
    process.send_signal(number)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == status
    assert errors == "interrupted: 1 of 3 trials done\n" and 'tests="1"' in junit.read_text()


def test_a_killed_command_leaves_no_master(command, tmp_path):
    begun = tmp_path / "begun"
    process = command(f"import os\nos.symlink(str(os.getpid()), {str(begun)!r})\nwhile True: pass\n")  # a link appears whole
    while not begun.is_symlink():
        time.sleep(0.01)
    process.kill()
    process.communicate(timeout=60)
    await_end(int(os.readlink(begun)))


# ---- Wrong use ----


def test_the_scenario_is_an_argument(run, tmp_path):
    view = run("import sys\nprint(sys.argv[1:])\n", arguments=("{scenario}", "{job}"))
    assert view["output"] == f"{[str(tmp_path / 'quiet.toml'), '0']}\n"


@pytest.mark.parametrize(
    ("options", "error"),
    [
        (["--junit", "nowhere/t.xml"], "--junit: there is no folder nowhere; make it"),
        (["--html", "."], "--html: . cannot be written"),
        (["--keep", __file__], "cannot be made: File exists"),
        (["--jobs", "0"], "argument --jobs: 0 is not a number of at least 1"),
        (["--after", "-1"], "argument --after: "),
        (["no_such_file.py"], "no_such_file.py: there is no such file; give the file of the master"),
    ],
)
def test_wrong_use_is_explained_before_a_trial_runs(command, options, error):
    process = command("print('run')\n", *options)
    output, errors = process.communicate(timeout=60)
    assert process.returncode == 2 and error in errors and output == ""


@pytest.mark.parametrize("line", ["line = '{}'", "'line' = '{}'", '"line"     =   "{}"', "clause = '''\nline = \"no\"\n'''\nline = '{}'"])
def test_the_line_is_read_as_toml(run, line):
    view = run("", 'title = "quiet"\n' + line.format(ROOT / "scenarios/lines/can.toml") + "\n" + SHOWS)
    assert view.get("exit_status") == 0, view


def test_errors_of_files_are_errors_of_their_trials(run):
    for text, error in (
        (b'title = "\xe9"\n', "quiet.toml: the file is not UTF-8: byte 9"),
        (b"title = \n", "quiet.toml:1:9: Invalid value"),
        (b"line = 3\n", 'the scenario names no line; write line = "FILE.toml"'),
    ):
        view = run("", text)
        assert view["outcome"] == "error" and error in view["reason"], view


def test_json_of_interrupted_trials_is_json(command, tmp_path):
    process = command(HANGS_IN_TWO, "--json", scenarios=("two",), arguments=("{scenario}",))
    await_file(tmp_path / "begun")
    process.send_signal(signal.SIGINT)
    output, _ = process.communicate(timeout=60)
    assert json.loads(output) == [] and process.returncode == 130
