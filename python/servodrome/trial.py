"""`python -m servodrome trial`: a master in Python through scenarios, in this process and in virtual time (docs/scenario.md).

Each trial is a process of its own, so that no trial sees what another one has left behind, and runs in the time of its line:
a program that needs a minute takes some seconds at most, and two runs are equal to the last bit.
"""

from __future__ import annotations

import atexit
import contextlib
import io
import json
import os
import pathlib
import random
import re
import runpy
import subprocess
import sys
import tempfile
import threading
import traceback
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Dict, Iterator, List, NamedTuple, Sequence

from .errors import BadValue, Error
from .line import Line
from .virtual_time import virtual_time

_MOST_OUTPUT = 4000
_PLACES = ("link", "host", "port", "scenario", "job")  # replaced in the arguments
_CAN_INTERFACES = ("socketcand", "socketcan", "slcan", "virtual")


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
    files = set()
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


class _Overtime(Exception):
    """The time of the master is over."""


class _ExitFunctions:
    """Takes the place of the module atexit for a program, so that they run at the end of the program, not of the process."""

    def __init__(self) -> None:
        self._functions: List[Any] = []

    def register(self, function: Any, *arguments: Any, **keywords: Any) -> Any:
        """As atexit.register."""
        self._functions.append((function, arguments, keywords))
        return function

    def unregister(self, function: Any) -> None:
        """As atexit.unregister."""
        self._functions = [one for one in self._functions if one[0] != function]

    def run(self) -> None:
        """Runs the functions, the last one first. An exception does not keep the others from running."""
        while self._functions:
            function, arguments, keywords = self._functions.pop()
            try:
                function(*arguments, **keywords)
            except BaseException:  # noqa: BLE001 (as at the end of a process)
                traceback.print_exc()


class _Ending(threading.Thread):
    """The master as a thread: its exit status and its output. As in a process of its own, its threads are no daemons."""

    def __init__(self, trial: Trial) -> None:
        super().__init__(name="master", daemon=False)
        self._trial = trial
        self._before = set(threading.enumerate())
        self._exit_functions = _ExitFunctions()
        self.status = 1

    def run(self) -> None:
        """Runs the program as `python FILE ARGUMENTS` does, to the end of the process."""
        registers = (atexit.register, atexit.unregister)
        atexit.register, atexit.unregister = self._exit_functions.register, self._exit_functions.unregister
        try:
            self._run_file()
            self._end()
        finally:
            atexit.register, atexit.unregister = registers

    def _end(self) -> None:
        """What the interpreter does at its end: functions of `threading` (thread pools end), threads, functions of atexit."""
        for function in reversed(getattr(threading, "_threading_atexits", [])):
            function()
        while rest := [one for one in threading.enumerate() if not one.daemon and one is not self and one not in self._before]:
            rest[0].join()
        self._exit_functions.run()

    def _run_file(self) -> None:
        try:
            runpy.run_path(self._trial.master, run_name="__main__")
            self.status = 0
        except SystemExit as ended:
            if ended.code is not None and not isinstance(ended.code, int):
                print(ended.code, file=sys.stderr)
            self.status = 0 if ended.code is None else ended.code if isinstance(ended.code, int) else 1
        except BaseException:  # noqa: BLE001 (whatever the program raises ends it, as in a process of its own)
            traceback.print_exc()


@contextlib.contextmanager
def _as_program(trial: Trial, line: Line, output: io.StringIO) -> Iterator[None]:
    """The arguments, the module path and the output of a program of its own; other CAN interfaces open buses of the line."""
    names = {"scenario": "", "job": "0", "host": "servodrome", "port": "29536", "link": next(iter(line.buses), "")}
    arguments = list(trial.arguments)
    for name in _PLACES:
        arguments = [one.replace("{" + name + "}", names[name]) for one in arguments]
    sys.argv = [trial.master, *arguments]
    sys.path.insert(0, str(pathlib.Path(trial.master).resolve().parent))
    try:
        import can.interfaces

        for interface in _CAN_INTERFACES:
            can.interfaces.BACKENDS[interface] = ("servodrome.can_bus", "ServodromeBus")
    except ImportError:
        pass  # a master without python-can
    with contextlib.redirect_stdout(output), contextlib.redirect_stderr(output):
        yield


def _run_master(trial: Trial, line: Line, duration_s: float, output: io.StringIO) -> "tuple[int, bool]":
    """Returns the exit status, and whether the trial has ended the master."""
    with _as_program(trial, line, output):
        try:
            with virtual_time(line):
                master = _Ending(trial)
                master.start()
                master.join(duration_s)
                if master.is_alive():
                    raise _Overtime
        except _Overtime:
            return 1, True
        return master.status, False


def _captures(line: Line, folder: str, scenario: pathlib.Path) -> List[str]:
    files = []
    for name, bus in line.buses.items():
        place = scenario.parent.name
        file = pathlib.Path(folder) / f"{place}{'-' if place else ''}{scenario.stem}.{name}.pcap"
        file.write_bytes(bus.capture())
        files.append(str(file))
    return files


def run_trial(trial: Trial, scenario: str) -> Report:
    """Runs the master through one scenario in this process. The process should end afterwards: see the module's text."""
    try:
        with open(scenario, encoding="utf-8") as file:
            text = file.read()
        found = re.search(r'^line\s*=\s*"([^"]*)"', text, re.MULTILINE)
        if found is None:
            raise BadValue("the scenario names no line", scenario, 'write line = "FILE.toml"')
        line_file = pathlib.Path(scenario).parent / found.group(1)
        with Line.from_file(line_file) as line:
            begun = line.request("PUT", "trial", {"text": text, "file": scenario, "after_s": trial.after_s})
            random.seed(begun["seed"])
            output = io.StringIO()
            if trial.keep:
                for bus in line.buses.values():
                    bus.record()
            status, was_ended = _run_master(trial, line, begun["duration_s"], output)
            said = output.getvalue()
            said = said if len(said) <= _MOST_OUTPUT else "...\n" + said[-_MOST_OUTPUT:]
            line.request("POST", "trial/master", {"exit_status": status, "was_ended": was_ended, "output": said})
            line.advance(trial.after_s)
            ended = line.request("DELETE", "trial")
            view = json.loads(ended["trial"])
            if trial.keep:
                view["captures"] = _captures(line, trial.keep, pathlib.Path(scenario))
            return Report(view, ended["section"])
    except (Error, OSError) as error:
        return _error(scenario, str(error))


def _error(scenario: str, reason: str) -> Report:
    view = {"scenario": scenario, "title": "", "outcome": "error", "reason": reason, "expectations": [], "rules": []}
    return Report(view, "")


def _in_child(trial: Trial, scenario: str) -> Report:
    """Runs a trial in a new process, so that no trial sees what another one has left behind."""
    package = str(pathlib.Path(__file__).resolve().parents[1])
    path = os.pathsep.join(filter(None, [package, os.environ.get("PYTHONPATH", "")]))
    environment = {**os.environ, "PYTHONPATH": path, "PYTHONHASHSEED": "0"}
    with tempfile.TemporaryDirectory() as folder:
        result = os.path.join(folder, "result.json")
        command = [sys.executable, "-m", "servodrome.trial", json.dumps(trial._asdict()), scenario, result]
        done = subprocess.run(command, capture_output=True, text=True, errors="replace", env=environment, check=False)
        if not os.path.exists(result):
            return _error(scenario, f"the process ended with status {done.returncode}: {done.stderr[-_MOST_OUTPUT:]}")
        with open(result, encoding="utf-8") as file:
            return Report(*json.load(file))


def run_trials(trial: Trial, scenarios: Sequence[str], jobs: int = 1) -> Iterator[Report]:
    """The outcomes in the order of the scenarios."""
    with ThreadPoolExecutor(jobs) as pool:
        yield from pool.map(lambda scenario: _in_child(trial, scenario), scenarios)


def _main(trial: str, scenario: str, result: str) -> None:
    report = run_trial(Trial(**json.loads(trial)), scenario)
    with open(result + ".part", "w", encoding="utf-8") as file:
        json.dump(report, file)
    os.replace(result + ".part", result)


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


if __name__ == "__main__":
    _main(*sys.argv[1:])
    sys.stdout.flush()
    os._exit(0)  # threads that the master has left behind do not hold up the end
