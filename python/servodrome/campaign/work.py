"""One run of a campaign, in a worker or in this process."""

from __future__ import annotations

import importlib
import importlib.util
import os
from typing import Any, Callable, Dict, List, Mapping, Sequence

from ..errors import BadValue, Error
from ..line import Line
from ..tables import toml_text
from .plan import Plan, changed_line

Program = Callable[[Line, Mapping[str, Any], int], Mapping[str, float]]

_programs: Dict[str, Program] = {}


def program_of(name: str) -> Program:
    """The function FILE.py:FUNCTION or MODULE:FUNCTION. A file is loaded once in a process."""
    if name not in _programs:
        place, _, function = name.rpartition(":")
        try:
            if place.endswith(".py"):
                spec = importlib.util.spec_from_file_location(f"campaign_{abs(hash(place))}", place)
                assert spec is not None and spec.loader is not None
                module = importlib.util.module_from_spec(spec)
                spec.loader.exec_module(module)
            else:
                module = importlib.import_module(place)
            _programs[name] = getattr(module, function)
        except (ImportError, AttributeError, FileNotFoundError, SyntaxError) as error:
            raise BadValue(f"the program {name} cannot be loaded: {error}", "program", "write FILE.py:FUNCTION") from error
    return _programs[name]


def execute(plan: Plan, number: int) -> Dict[str, Any]:
    """Carries out a run. Returns its row: what it is, its outcome, and the figures that the program returned.

    The row depends on the plan and the number only. An exception of the program is an outcome ("failed"), and so is
    one of servodrome ("error").
    """
    run = plan.run(number)
    row: Dict[str, Any] = {"run": number, "scenario": os.path.basename(run.scenario), "seed": run.seed}
    row.update(run.parameters)
    row.update({"outcome": "passed", "failed": "", "error": "", "acts": 0})
    program = program_of(plan.program)
    try:
        with Line.from_text(toml_text(changed_line(plan, run))) as line:
            _carry_out(line, run.scenario, run.seed, lambda: program(line, run.parameters, run.seed), row)
            row["line_time_s"] = line.now
    except Error as error:
        row.update(outcome="error", error=str(error), line_time_s=0.0)
    return row


def _carry_out(line: Line, path: str, seed: int, program: Callable[[], Mapping[str, float]], row: Dict[str, Any]) -> None:
    scenario = None
    if path:
        with open(path, encoding="utf-8") as file:
            text = file.read()
        # The run's seed takes the place of the file's.
        rows = [one for one in text.splitlines() if not one.startswith("seed ")]
        scenario = line.scenario(path, text=f"seed = {seed}\n" + "\n".join(rows) + "\n")
    succeeded = False
    try:
        for name, value in program().items():
            row[f"figure_{name}"] = float(value)
        succeeded = True
    except Exception as error:  # noqa: BLE001 (whatever the program raises is its outcome)
        row.update(outcome="failed", error=f"{type(error).__name__}: {error}")
    if scenario is None:
        return
    scenario.master_ended(succeeded)
    line.advance(3.0)
    scenario.end()
    row["acts"] = sum(rule.acts for rule in scenario.rules.values())
    row["failed"] = ", ".join(verdict.name for verdict in scenario.failed)
    row["outcome"] = "not reached" if row["acts"] == 0 else "failed" if scenario.failed else "passed"


def execute_batch(plan: Plan, numbers: Sequence[int]) -> List[Dict[str, Any]]:
    """The rows of several runs."""
    return [execute(plan, number) for number in numbers]
