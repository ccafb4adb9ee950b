"""Checks a plan before anything runs: its program, line, parameters and scenarios."""

from __future__ import annotations

import os
from typing import List, Sequence

from .._toml import read_toml
from ..errors import BadValue, Error
from ..line import Line
from ..tables import toml_text
from .plan import Places, Plan, Run, Value, changed_line
from .work import AFTER_S, program_of, read

_MOST_VALUES = 1000  # of a parameter; of a longer list the first and the last one are tried


def check_plan(path: str, plan: Plan) -> None:
    """Raises an Error with the place of the first mistake. It loads the program, and makes lines without running them."""
    places = Places(path)
    try:
        program_of(plan)
    except Error as error:
        where = error.where if error.where != "program" else places.of("program")
        raise BadValue(error.what, where, error.hint) from None
    line_file = os.path.join(os.path.dirname(os.path.abspath(path)), read_toml(path)["line"])
    Line.from_file(line_file).close()
    first = plan.run(0)
    for name, values in plan.parameters.items():
        if name.startswith(("axis.", "bus.")):
            _check_parameter(plan, first, name, values, places)
    for number in range(0, plan.size, max(plan.size // max(len(plan.scenarios), 1), 1)):
        _check_scenario(plan, plan.run(number))


def _check_parameter(plan: Plan, first: Run, name: str, values: Sequence[Value], places: Places) -> None:
    """Tries each value together with the first values of the other parameters."""
    tried: List[Value] = list(values) if len(values) <= _MOST_VALUES else [values[0], values[-1]]
    for value in tried:
        run = first._replace(parameters={**first.parameters, name: value})
        try:
            Line.from_text(toml_text(changed_line(plan, run))).close()
        except Error as error:
            raise BadValue(f"{name} = {value!r}: {error.what}", places.of(name), error.hint) from None


def _check_scenario(plan: Plan, run: Run) -> None:
    if not run.scenario:
        return
    read_toml(run.scenario)
    text = read(run.scenario, "").decode()
    with Line.from_text(toml_text(changed_line(plan, run))) as line:
        line.request("PUT", "trial", {"text": text, "file": run.scenario, "after_s": AFTER_S})
