"""`python -m servodrome trial`: a master in Python through scenarios, in virtual time (docs/scenario.md).

Each trial is a process of its own, so that no trial sees what another one has left behind, and runs in the time of its line:
a program that needs a minute takes some seconds at most, and two runs are equal to the last bit. _trial_process.py is that process.
"""

from __future__ import annotations

import contextlib
import json
import math
import os
import pathlib
import re
import signal
import subprocess
import sys
import tempfile
import threading
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Dict, Iterator, List, NamedTuple, Optional, Sequence, Set

from ._toml import read_toml
from .errors import BadValue, Error
from .line import Line

_MOST_OUTPUT = 4000  # bytes
# A trial is an error if it takes this many times its longest time, and `_LEAST_LIMIT_S` more: as in src/app/trial_run.cpp.
_SLOWEST = 10
_LEAST_LIMIT_S = 60.0
_TIME_TO_TERMINATE_S = 2.0
_DURATION_S = 10.0  # the default of `duration_s` of a scenario


class Trial(NamedTuple):
    """What to run, and how."""

    master: str
    """The file of the program."""
    arguments: Sequence[str] = ()
    after_s: float = 3.0
    """The line runs on so long after the end of the master."""
    keep: str = ""
    """Folder for captures; empty: none are kept."""


class Report(NamedTuple):
    """The outcome of a trial."""

    view: Dict[str, Any]
    """As `servodrome trial --json` has it."""
    section: str
    """Its part of the page."""


def files_of(places: Sequence[str], only: str = "") -> List[str]:
    """The scenario files of folders and files, in alphabetical order. Line files are in folders called `lines`."""
    files: Set[str] = set()
    for place in places:
        if os.path.isdir(place):
            found = pathlib.Path(place).rglob("*.toml")
            files.update(str(file) for file in found if file.parent.name != "lines")
        else:
            files.add(place)
    chosen = sorted(file for file in files if only in file)
    if not chosen:
        raise BadValue("there are no scenarios", "--scenarios", "name a folder or files, and check --only")
    return chosen


def end_of_file(path: str) -> str:
    """The last bytes of a file as text, from the begin of a character on."""
    with open(path, "rb") as file:
        size = file.seek(0, os.SEEK_END)
        file.seek(max(0, size - _MOST_OUTPUT))
        text = file.read(_MOST_OUTPUT)
    if size <= _MOST_OUTPUT:
        return text.decode(errors="replace")
    return "...\n" + re.sub(rb"^[\x80-\xbf]{1,3}", b"", text).decode(errors="replace")


def error_report(scenario: str, reason: str, outcome: str = "error", title: str = "", output: str = "") -> Report:
    """The report of a trial that its process has not written."""
    view = {
        "scenario": scenario,
        "title": title,
        "outcome": outcome,
        "reason": reason,
        "expectations": [],
        "rules": [],
        "output": output,
    }
    return Report(view, "")


class Children:
    """The processes of trials, each with a group of its own. After `stop` none is left, and none begins."""

    def __init__(self) -> None:
        self._lock = threading.RLock()  # reentrant for a signal handler that calls stop()
        self._running: Set[int] = set()  # they are their groups' numbers, too
        self.is_stopped = False

    def stop(self) -> None:
        """Kills all processes."""
        with self._lock:
            self.is_stopped = True
            for number in list(self._running):
                self._kill(number)

    def _kill(self, number: int) -> None:
        with self._lock:
            if number in self._running:
                with contextlib.suppress(ProcessLookupError):
                    os.killpg(number, signal.SIGKILL)

    def run(self, command: Sequence[str], output: str, limit_s: float) -> Optional[int]:
        """The exit status; minus the number of the signal that ended the process; None after `stop`.

        Raises TimeoutError after `limit_s`. Nothing of the process's group is left at the end.
        """
        package = str(pathlib.Path(__file__).resolve().parents[1])
        path = os.pathsep.join(filter(None, [package, os.environ.get("PYTHONPATH", "")]))
        environment = {**os.environ, "PYTHONPATH": path, "PYTHONHASHSEED": "0"}
        overtime = threading.Event()
        with self._lock, open(output, "wb") as file:
            if self.is_stopped:
                return None
            process = subprocess.Popen(
                command, stdin=subprocess.DEVNULL, stdout=file, stderr=file, start_new_session=True, env=environment
            )
            self._running.add(process.pid)

        def end() -> None:
            overtime.set()
            self._kill(process.pid)

        timer = threading.Timer(limit_s, end)
        timer.daemon = True
        timer.start()
        # The process stays a zombie until its group is killed: so the system does not give its number to another one.
        os.waitid(os.P_PID, process.pid, os.WEXITED | os.WNOWAIT)
        timer.cancel()
        with self._lock:
            self._kill(process.pid)
            self._running.remove(process.pid)
            status = process.wait()
        if overtime.is_set() and status == -signal.SIGKILL:
            raise TimeoutError
        return None if self.is_stopped and status == -signal.SIGKILL else status


def limit_of(trial: Trial, duration_s: Any) -> float:
    """The wall time in seconds after which a trial is an error. Its process refuses a wrong `duration_s` at once."""
    is_time = isinstance(duration_s, (int, float)) and 0 < duration_s < math.inf
    duration = float(duration_s) if is_time else _DURATION_S
    return min(_SLOWEST * (duration + _TIME_TO_TERMINATE_S + trial.after_s) + _LEAST_LIMIT_S, threading.TIMEOUT_MAX)


def _name(number: int) -> str:
    """ "signal 11 (SIGSEGV)" """
    try:
        return f"signal {number} ({signal.Signals(number).name})"
    except ValueError:
        return f"signal {number}"  # a real-time signal


def _in_child(trial: Trial, scenario: str, children: Children) -> Optional[Report]:
    """Runs a trial in a new process. None: the trials were stopped before its end."""
    try:
        content = read_toml(scenario)
    except Error as error:
        return error_report(scenario, str(error))
    title = str(content.get("title", ""))
    limit_s = limit_of(trial, content.get("duration_s", _DURATION_S))
    with tempfile.TemporaryDirectory() as folder:
        result, output = os.path.join(folder, "result.json"), os.path.join(folder, "output")
        command = [sys.executable, "-m", "servodrome._trial_process", json.dumps(trial._asdict()), scenario, folder]
        try:
            status = children.run(command, output, limit_s)
        except TimeoutError:
            reason = f"the trial takes more than {limit_s:.0f} s of wall time: the master computes without waiting, "
            reason += "or the machine is too busy"
            return error_report(scenario, reason, title=title, output=end_of_file(output))
        if status is None:
            return None
        if os.path.exists(result):
            with open(result, encoding="utf-8") as file:
                return Report(*json.load(file))
        said = end_of_file(output)
        if status < 0:
            return error_report(scenario, f"the master was ended by {_name(-status)}", "failed", title, said)
        return error_report(scenario, f"the process ended with status {status}: {said}", title=title)


def run_trials(trial: Trial, scenarios: Sequence[str], jobs: int = 1, children: Optional[Children] = None) -> Iterator[Report]:
    """The outcomes in the order of the scenarios; after children.stop() only those of the trials that are done."""
    children = children or Children()
    with ThreadPoolExecutor(jobs) as pool:
        try:
            yield from filter(None, pool.map(lambda scenario: _in_child(trial, scenario, children), scenarios))
        finally:
            children.stop()


def _report(line: Line, reports: Sequence[Report], master: str, form: str) -> str:
    trials = [{key: value for key, value in report.view.items() if key not in ("traffic", "output")} for report in reports]
    body = {"trials": trials, "master": master, "format": form}
    answer = line._backend.request("POST", "/api/v1/trial/report", json.dumps(body).encode())
    if answer.status != 200:
        raise BadValue("the report cannot be written", "report", answer.body.decode(errors="replace"))
    return answer.body.decode()


def junit_of(reports: Sequence[Report], master: str) -> str:
    """A JUnit report, as `servodrome trial --junit` writes it."""
    with Line() as line:
        return _report(line, reports, master, "junit")


def html_of(reports: Sequence[Report], master: str) -> str:
    """A page, as `servodrome trial --html` writes it."""
    with Line() as line:
        page = _report(line, reports, master, "html")
    head, end = page.rsplit("</html>", 1)
    return head + "".join(report.section for report in reports) + "</html>" + end
