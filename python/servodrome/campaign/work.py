"""One run of a campaign, in a worker or in this process."""

from __future__ import annotations

import hashlib
import importlib
import json
import os
import random
import sys
import traceback
import types
from typing import Any, Callable, Dict, List, Mapping, Sequence, Tuple

from .._library import version
from .._toml import read_toml
from ..errors import BadValue, Error
from ..line import Line
from ..tables import toml_text
from .plan import Plan, Run, changed_line

Program = Callable[[Line, Mapping[str, Any], int], Mapping[str, float]]

AFTER_S = 3.0  # the line runs on so long after the end of the program, as in a trial

_programs: Dict[Tuple[str, str], Program] = {}


def read(path: str, checksum: str) -> bytes:
    """The content of a file. Raises BadValue if it is another one than that of the command."""
    with open(path, "rb") as file:
        content = file.read()
    if checksum not in ("", hashlib.sha256(content).hexdigest()):
        raise BadValue(f"{path} here differs from the file of the command", path, "copy the file to each worker")
    return content


def program_of(plan: Plan) -> Program:
    """The program of the plan. A process loads each version of a file once."""
    place, _, function = plan.program.rpartition(":")
    checksum = plan.checksums.get(plan.program, "")
    key = (plan.program, checksum)
    if key not in _programs:
        try:
            if place.endswith(".py"):
                module = types.ModuleType(f"campaign_{abs(hash(place))}")
                module.__file__ = place
                exec(compile(read(place, checksum), place, "exec"), module.__dict__)  # noqa: S102 (the user's program)
            else:
                is_loaded = place in sys.modules
                module = importlib.import_module(place)
                if is_loaded and any(name == plan.program for name, _ in _programs):
                    module = importlib.reload(module)
                if module.__file__:
                    read(module.__file__, checksum)
        except Error:
            raise
        except (Exception, SystemExit) as error:  # noqa: BLE001 (whatever the user's program raises)
            what = f"the program {plan.program} cannot be loaded: {type(error).__name__}: {error}"
            raise BadValue(
                what, _place_of(error, place), "the program is FILE.py:FUNCTION, and loads without an error"
            ) from error
        found = getattr(module, function, None)
        if not callable(found):
            raise BadValue(f"{place} has no function {function}", "program", "write FILE.py:FUNCTION")
        _programs[key] = found
    return _programs[key]


def _place_of(error: BaseException, file: str) -> str:
    """FILE:LINE of an error of a program that is being loaded; "program" if it has no line."""
    if isinstance(error, SyntaxError) and error.filename:
        return f"{error.filename}:{error.lineno}:{error.offset}"
    lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if frame.filename == file]
    return f"{file}:{lines[-1]}" if lines else "program"


def _seed(seed: int) -> None:
    """Seeds the generators of the process, so that the figures of a program that uses them depend only on the plan."""
    random.seed(seed)
    numpy = sys.modules.get("numpy")
    if numpy is not None:
        numpy.random.seed(seed % 2**32)


def row_of(run: Run) -> Dict[str, Any]:
    """The row of a run without its outcome."""
    row: Dict[str, Any] = {"run": run.number, "scenario": os.path.basename(run.scenario), "seed": run.seed}
    row.update(run.parameters)
    row.update({"outcome": "passed", "failed": "", "error": "", "acts": 0})
    return row


def execute(plan: Plan, number: int) -> Dict[str, Any]:
    """Carries out a run. Returns its row: what it is, its outcome, and the figures that the program returned.

    The row depends on the plan and the number only. An exception of the program is an outcome ("failed"), and so is
    one of servodrome ("error").
    """
    run = plan.run(number)
    row = row_of(run)
    program = program_of(plan)
    scenario: Dict[str, Any] = {}
    if run.scenario:
        read(run.scenario, plan.checksums.get(run.scenario, ""))
        scenario = read_toml(run.scenario)
    _seed(run.seed)
    try:
        with Line.from_text(toml_text(changed_line(plan, run))) as line:
            _carry_out(line, run, scenario, lambda: program(line, run.parameters, run.seed), row)
            row["line_time_s"] = line.now
    except Error as error:
        row.update(outcome="error", error=str(error), line_time_s=0.0)
    return row


def _carry_out(
    line: Line, run: Run, scenario: Dict[str, Any], program: Callable[[], Mapping[str, float]], row: Dict[str, Any]
) -> None:
    duration_s = 0.0
    if scenario:
        text = toml_text({**scenario, "seed": run.seed})
        body = {"text": text, "file": run.scenario, "after_s": AFTER_S}
        duration_s = line.now + line.request("PUT", "trial", body)["duration_s"]
    succeeded = False
    try:
        for name, value in program().items():
            row[f"figure_{name}"] = float(value)
        succeeded = True
    except (Exception, SystemExit) as error:  # noqa: BLE001 (whatever the program raises is its outcome)
        row.update(outcome="failed", error=f"{type(error).__name__}: {error}")
    if not scenario:
        return
    was_ended = line.now > duration_s
    line.request("POST", "trial/master", {"exit_status": 0 if succeeded else 1, "was_ended": was_ended, "output": ""})
    line.advance(AFTER_S)
    view = json.loads(line.request("DELETE", "trial")["trial"])
    row["acts"] = sum(rule["acts"] for rule in view["rules"])
    row["failed"] = ", ".join(one["name"] for one in view["expectations"] if one["outcome"] == "failed")
    row["outcome"] = view["outcome"]
    row["error"] = row["error"] or view["reason"]


def execute_batch(plan: Plan, numbers: Sequence[int]) -> List[Dict[str, Any]]:
    """The rows of several runs."""
    if plan.version not in ("", version()):
        raise BadValue(
            f"this worker has Servodrome {version()}, and the command has {plan.version}", "worker", "install one version"
        )
    return [execute(plan, number) for number in numbers]
