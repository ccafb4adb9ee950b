"""The plan of a campaign: a TOML file, and the runs that it describes."""

from __future__ import annotations

import glob
import hashlib
import importlib
import json
import math
import os
import sys
from typing import Any, Dict, List, NamedTuple, Sequence, Union

from ..errors import BadValue, MissingPackage

Value = Union[float, int, str, bool]

_KEYS = {"title", "line", "program", "scenarios", "seeds", "first_seed", "parameters"}
_MOST_RUNS = 10**8


class Run(NamedTuple):
    """One run of a campaign."""

    number: int
    """From 0, the same in each run of the same plan."""
    scenario: str
    """Path of the scenario file, "" for none."""
    seed: int
    parameters: Dict[str, Value]


class Plan(NamedTuple):
    """A plan, ready to be sent to a worker: it refers to no file but the program and the scenarios."""

    title: str
    line: Dict[str, Any]
    """The content of the line file."""
    program: str
    """FILE.py:FUNCTION, with the file's whole path, or MODULE:FUNCTION."""
    scenarios: List[str]
    seeds: int
    first_seed: int
    parameters: Dict[str, List[Value]]

    @property
    def size(self) -> int:
        """The number of runs."""
        size = max(len(self.scenarios), 1) * self.seeds
        for values in self.parameters.values():
            size *= len(values)
        return size

    def run(self, number: int) -> Run:
        """The run with this number: the seed varies fastest, then the last parameter, at last the scenario."""
        rest, seed = divmod(number, self.seeds)
        chosen: Dict[str, Value] = {}
        for name in reversed(list(self.parameters)):
            rest, place = divmod(rest, len(self.parameters[name]))
            chosen[name] = self.parameters[name][place]
        scenario = self.scenarios[rest] if self.scenarios else ""
        return Run(number, scenario, self.first_seed + seed, {name: chosen[name] for name in self.parameters})

    @property
    def fingerprint(self) -> str:
        """Equal for plans with equal runs: a folder of results belongs to one plan."""
        text = json.dumps(self._asdict(), sort_keys=True)
        for path in [*self.scenarios, self.program.rpartition(":")[0]]:
            if os.path.isfile(path):
                with open(path, "rb") as file:
                    text += hashlib.sha256(file.read()).hexdigest()
        return hashlib.sha256(text.encode()).hexdigest()


def _toml() -> Any:
    try:
        return importlib.import_module("tomllib" if sys.version_info >= (3, 11) else "tomli")
    except ImportError as error:
        raise MissingPackage("tomli is not installed", "campaign", "pip install tomli") from error


def read_toml(path: str) -> Dict[str, Any]:
    """The content of a TOML file. Raises BadValue with the place of an error."""
    toml = _toml()
    try:
        with open(path, "rb") as file:
            content: Dict[str, Any] = toml.load(file)
            return content
    except OSError as error:
        raise BadValue(f"{path} cannot be read: {error.strerror}", path, "give the name of a TOML file") from None
    except toml.TOMLDecodeError as error:
        raise BadValue(str(error), path, "correct the TOML") from None


def load_plan(path: str) -> Plan:
    """Reads a plan. Raises BadValue for a wrong key or value."""
    content = read_toml(path)
    folder = os.path.dirname(os.path.abspath(path))
    for key in content:
        if key not in _KEYS:
            raise BadValue(f"unknown key {key}", path, f"known are {', '.join(sorted(_KEYS))}")
    if "line" not in content:
        raise BadValue("`line` is missing", path, 'name a line file: line = "cell.toml"')
    scenarios: List[str] = []
    for pattern in content.get("scenarios", []):
        found = sorted(glob.glob(os.path.join(folder, pattern), recursive=True))
        if not found:
            raise BadValue(f"scenarios: there is no file {pattern}", path, "give paths or patterns, relative to the plan")
        scenarios += found
    program = content.get("program", "servodrome.campaign.programs:velocity_step")
    file, _, function = program.rpartition(":")
    if not file or not function:
        raise BadValue(f"program: {program!r} names no function", path, 'write program = "FILE.py:FUNCTION"')
    if file.endswith(".py"):
        program = f"{os.path.join(folder, file)}:{function}"
    seeds = content.get("seeds", 1)
    if not isinstance(seeds, int) or seeds < 1:
        raise BadValue(f"seeds: {seeds!r} is no number of seeds", path, "give 1 or more")
    parameters = {name: values_of(name, given, path) for name, given in _flat(content.get("parameters", {})).items()}
    line = read_toml(os.path.join(folder, content["line"]))
    title = content.get("title", os.path.basename(path))
    plan = Plan(title, line, program, scenarios, seeds, content.get("first_seed", 1), parameters)
    if plan.size > _MOST_RUNS:
        raise BadValue(f"the plan has {plan.size} runs", path, f"give fewer values; {_MOST_RUNS} is the limit")
    changed_line(plan, plan.run(0))  # raises for a parameter that the line does not have
    return plan


def _flat(table: Dict[str, Any], before: str = "") -> Dict[str, Any]:
    """Dotted keys without quotes are tables in TOML: axis.x.load.inertia_kgm2 is taken in both notations."""
    flat: Dict[str, Any] = {}
    for key, value in table.items():
        name = f"{before}{key}"
        if isinstance(value, dict) and not value.keys() >= {"from", "to", "count"}:
            flat.update(_flat(value, name + "."))
        else:
            flat[name] = value
    return flat


def values_of(name: str, given: Any, where: str) -> List[Value]:
    """The values of a parameter: a list, one value, or { from, to, count, scale = "linear" or "log" }."""
    if isinstance(given, (int, float, str, bool)):
        return [given]
    if isinstance(given, list) and given and all(isinstance(value, (int, float, str, bool)) for value in given):
        return list(given)
    if isinstance(given, dict):
        try:
            begin, end, count = float(given["from"]), float(given["to"]), int(given["count"])
            scale = given.get("scale", "linear")
            if count < 2 or scale not in ("linear", "log") or (scale == "log" and (begin <= 0 or end <= 0)):
                raise ValueError
        except (KeyError, TypeError, ValueError):
            raise BadValue(
                f"{name}: {given!r} is no range", where, 'write { from = 1e-5, to = 1e-4, count = 5, scale = "log" }'
            ) from None
        shares = [place / (count - 1) for place in range(count)]
        if scale == "log":
            return [begin * math.exp(share * math.log(end / begin)) for share in shares]
        return [begin + share * (end - begin) for share in shares]
    raise BadValue(f"{name}: {given!r} has no values", where, "give a list, one value, or a range")


def changed_line(plan: Plan, run: Run) -> Dict[str, Any]:
    """The line of a run: a copy with the parameters axis.NAME.KEYS and bus.NAME.KEYS. Others are for the program only."""
    line: Dict[str, Any] = json.loads(json.dumps(plan.line))
    for name, value in run.parameters.items():
        kind, _, rest = name.partition(".")
        if kind not in ("axis", "bus"):
            continue
        who, _, keys = rest.partition(".")
        tables = [table for table in line.get(kind, []) if table.get("name") == who]
        if not tables or not keys:
            known = ", ".join(table.get("name", "?") for table in line.get(kind, []))
            raise BadValue(f"{name}: the line has no {kind} {who!r}", "parameters", f"known are {known}")
        _set(tables[0], keys.split("."), value)
    return line


def _set(table: Dict[str, Any], keys: Sequence[str], value: Value) -> None:
    for key in keys[:-1]:
        table = table.setdefault(key, {})
    table[keys[-1]] = value
