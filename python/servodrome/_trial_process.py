"""The process of one trial: its main thread runs the master, in the time of the line. trial.py starts it.

    python -m servodrome._trial_process TRIAL SCENARIO FOLDER      writes FOLDER/result.json

Its standard output and error are FOLDER/output. The end of the trial ends the process, so the trial does not wait for threads that the
master leaves behind.
"""

from __future__ import annotations

import atexit
import contextlib
import ctypes
import json
import os
import pathlib
import random
import runpy
import signal
import sys
import threading
import traceback
from typing import Any, List

from ._toml import read_toml
from .errors import BadValue, Error
from .line import Line
from .trial import Report, Trial, end_of_file, error_report
from .virtual_time import active_scheduler, real_time, virtual_time

_PLACES = ("link", "host", "port", "scenario", "job")  # replaced in the arguments
_CAN_INTERFACES = ("socketcand", "socketcan", "slcan", "virtual")
_PR_SET_PDEATHSIG = 1  # prctl(2)
_real_exit = os._exit


class _ExitFunctions:
    """Replaces the module atexit for a program, so that its functions run at the end of the program, and no others do."""

    def __init__(self) -> None:
        self._functions: List[Any] = []
        atexit.register, atexit.unregister = self.register, self.unregister

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


class _TrialProcess:
    """The trial of this process. One of three calls ends it: the master ends, it calls os._exit, or its time is over."""

    def __init__(self, trial: Trial, scenario: str, folder: str) -> None:
        self._trial = trial
        self._scenario = scenario
        self._folder = folder
        self._process = os.getpid()
        self._start_folder = os.getcwd()

    def run(self) -> None:
        """Runs the trial, and ends the process."""
        try:
            line_file = read_toml(self._scenario).get("line")
            if not isinstance(line_file, str):
                raise BadValue("the scenario names no line", self._scenario, 'write line = "FILE.toml"')
            with open(self._scenario, encoding="utf-8") as file:
                text = file.read()
            line = Line.from_file(pathlib.Path(self._scenario).parent / line_file)
            body = {"text": text, "file": self._scenario, "after_s": self._trial.after_s}
            begun = line.request("PUT", "trial", body)
        except (Error, OSError) as error:
            self._exit(error_report(self._scenario, str(error)))
        random.seed(begun["seed"])
        if self._trial.keep:
            for bus in line.buses.values():
                bus.record()
        self._line = line
        self._become_program()
        with virtual_time(line):
            scheduler = active_scheduler()
            assert scheduler is not None
            scheduler.set_limit(begun["duration_s"], lambda: self._end(1, was_ended=True))
            os._exit = self._end  # type: ignore[assignment]
            self._end(self._run_master())

    def _become_program(self) -> None:
        """The arguments and the module path are those of a program of its own; other CAN interfaces open buses of the line."""
        trial = self._trial
        names = {
            "scenario": self._scenario,
            "job": "0",
            "host": "servodrome",
            "port": "29536",
            "link": next(iter(self._line.buses), ""),
        }
        arguments = list(trial.arguments)
        for name in _PLACES:
            arguments = [one.replace("{" + name + "}", names[name]) for one in arguments]
        sys.argv = [trial.master, *arguments]
        sys.path.insert(0, str(pathlib.Path(trial.master).resolve().parent))
        sys.stdout.reconfigure(line_buffering=True)  # type: ignore[union-attr]  # output of its subprocesses comes in order
        try:
            import can.interfaces

            for interface in _CAN_INTERFACES:
                can.interfaces.BACKENDS[interface] = ("servodrome.can_bus", "ServodromeBus")
        except ImportError:
            pass  # a master without python-can

    def _run_master(self) -> int:
        """Runs the program as `python FILE ARGUMENTS` does, to the end of the process. Returns its exit status."""
        before = set(threading.enumerate())
        exit_functions = _ExitFunctions()
        status = 0
        try:
            runpy.run_path(self._trial.master, run_name="__main__")
        except SystemExit as ended:
            if ended.code is not None and not isinstance(ended.code, int):
                print(ended.code, file=sys.stderr)
            status = 0 if ended.code is None else ended.code & 0xFF if isinstance(ended.code, int) else 1
        except BaseException:  # noqa: BLE001 (whatever the program raises ends it, as in a process of its own)
            traceback.print_exc()
            status = 1
        # The interpreter does the same at its end: functions of `threading` (thread pools end), threads, functions of atexit.
        for function in reversed(getattr(threading, "_threading_atexits", [])):
            function()
        while rest := [one for one in threading.enumerate() if not one.daemon and one not in before]:
            rest[0].join()
        exit_functions.run()
        for stream in (sys.stdout, sys.stderr):
            _flush(stream)
        return status

    def _end(self, status: int, was_ended: bool = False) -> None:
        """Ends the trial and the process. The calling thread is the one that runs: the others wait for ever."""
        if os.getpid() != self._process:
            _real_exit(status)  # a process that the master has forked
        if was_ended:
            _flush(sys.stdout)
        with real_time():
            try:
                self._exit(self._judged(status, was_ended))
            except (Error, OSError) as error:
                self._exit(error_report(self._scenario, str(error)))

    def _judged(self, status: int, was_ended: bool) -> Report:
        line = self._line
        output = end_of_file(os.path.join(self._folder, "output"))
        ended = {"exit_status": status, "was_ended": was_ended, "uses_buses": True, "output": output}
        line.request("POST", "trial/master", ended)
        line.advance(self._trial.after_s)
        judged = line.request("DELETE", "trial")
        view = json.loads(judged["trial"])
        if self._trial.keep:
            view["captures"] = self._captures()
        return Report(view, judged["section"])

    def _captures(self) -> List[str]:
        scenario = pathlib.Path(self._scenario)
        place = scenario.parent.name
        files = []
        for name, bus in self._line.buses.items():
            file = pathlib.Path(self._trial.keep) / f"{place}{'-' if place else ''}{scenario.stem}.{name}.pcap"
            (self._start_folder / file).write_bytes(bus.capture())  # the master may have changed the folder
            files.append(str(file))
        return files

    def _exit(self, report: Report) -> None:
        result = os.path.join(self._folder, "result.json")
        with open(result + ".part", "w", encoding="utf-8") as file:
            json.dump(report, file)
        os.replace(result + ".part", result)
        _real_exit(0)


def _flush(stream: Any) -> None:
    with contextlib.suppress(Exception):  # the master may have closed or replaced it
        stream.flush()


if __name__ == "__main__":
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)  # when the command is killed
    _TrialProcess(Trial(**json.loads(sys.argv[1])), *sys.argv[2:]).run()
