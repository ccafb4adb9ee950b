"""The plan of a campaign: a TOML file, and the runs that it describes."""

from __future__ import annotations

import copy
import glob
import hashlib
import importlib.util
import json
import math
import os
import re
from typing import Any, Dict, List, NamedTuple, Sequence, Union

from .._library import version
from .._toml import read_toml
from ..errors import BadValue
from ..trial import files_of

Value = Union[float, int, str, bool]

_KEYS = {
    "title": "a string",
    "line": "a string",
    "program": "a string",
    "scenarios": "a list of strings",
    "seeds": "an integer",
    "first_seed": "an integer",
    "parameters": "a table",
}
_RANGE = {"from", "to", "count", "scale"}
_MOST_RUNS = 10**8
_GREATEST_SEED = 2**63 - 1

COLUMNS = {
    "run": "number of the run in its plan, from 0",
    "scenario": "file name of the scenario; empty: none",
    "seed": "seed of the run",
    "outcome": "passed, failed, not reached (no rule of the scenario acted), or error (the run could not be made)",
    "failed": "names of the expectations that failed",
    "error": "exception of the program, or of servodrome; reason of the outcome",
    "acts": "acts of the scenario's rules",
    "line_time_s": "line time at the end, in seconds",
}
"""The columns that each campaign has. Others are parameters, and figures of the program (figure_NAME)."""


class Run(NamedTuple):
    """One run of a campaign."""

    number: int
    """From 0, the same in each run of the same plan."""
    scenario: str
    """Path of the scenario file, "" for none."""
    seed: int
    parameters: Dict[str, Value]


class Plan(NamedTuple):
    """A plan, ready to be sent to a worker. It refers to no files but the program and the scenarios, by their checksums."""

    title: str
    line: Dict[str, Any]
    """The content of the line file."""
    program: str
    """FILE.py:FUNCTION, with the file's whole path, or MODULE:FUNCTION."""
    scenarios: List[str]
    seeds: int
    first_seed: int
    parameters: Dict[str, List[Value]]
    checksums: Dict[str, str] = {}
    """The SHA-256 of the files of the program and the scenarios, by their names in the plan. A worker refuses other files."""
    version: str = ""
    """Of Servodrome. A worker with another one refuses the plan."""

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
    def fingerprints(self) -> Dict[str, str]:
        """A checksum for each key of the plan that decides rows. The title and the folders of files decide none."""
        parts: Dict[str, Any] = {
            "line": self.line,
            "program": [self.checksums.get(self.program, self.program), self.program.rpartition(":")[2]],
            "scenarios": [[os.path.basename(path), self.checksums.get(path)] for path in self.scenarios],
            "seeds": self.seeds,
            "first_seed": self.first_seed,
            "parameters": list(self.parameters.items()),  # their order decides the numbers of the runs
        }
        texts = {key: json.dumps(part, sort_keys=True, default=str) for key, part in parts.items()}
        return {key: hashlib.sha256(text.encode()).hexdigest() for key, text in texts.items()}


def file_of(program: str) -> str:
    """The file of FILE.py:FUNCTION or MODULE:FUNCTION; "" if the module is not found here."""
    place = program.rpartition(":")[0]
    if place.endswith(".py"):
        return place
    try:
        spec = importlib.util.find_spec(place)
    except (ImportError, ValueError):
        return ""
    return (spec.origin or "") if spec is not None else ""


def checksums_of(files: Dict[str, str]) -> Dict[str, str]:
    """The SHA-256 of files by name; without those that do not exist."""
    sums = {}
    for name, path in files.items():
        if os.path.isfile(path):
            with open(path, "rb") as file:
                sums[name] = hashlib.sha256(file.read()).hexdigest()
    return sums


class Places:
    """The places of keys in a TOML file, for errors: the parser tells none."""

    def __init__(self, path: str) -> None:
        self._path = path
        with open(path, encoding="utf-8") as file:
            self._lines = file.read().splitlines()

    def of(self, key: str) -> str:
        """FILE:LINE:COLUMN of a key, also of one in a table or in quotes; FILE if it is not found."""
        for name in (key, key.rpartition(".")[2]):
            pattern = re.compile(rf"""(?:^|[\s{{,."'])({re.escape(name)})["']?\s*[=.\]]""")
            for number, text in enumerate(self._lines, start=1):
                found = pattern.search(text)
                if found and not text.lstrip().startswith("#"):
                    return f"{self._path}:{number}:{found.start(1) + 1}"
        return self._path


def _is(kind: str, value: Any) -> bool:
    if kind == "a list of strings":
        return isinstance(value, list) and all(isinstance(one, str) for one in value)
    types = {"a string": str, "an integer": int, "a table": dict}
    return isinstance(value, types[kind]) and not isinstance(value, bool)


def load_plan(path: str) -> Plan:
    """Reads a plan. Raises BadValue for a wrong key, type or value."""
    content = read_toml(path)
    places = Places(path)
    folder = os.path.dirname(os.path.abspath(path))
    for key, value in content.items():
        if key not in _KEYS:
            raise BadValue(f"unknown key {key}", places.of(key), f"known are {', '.join(sorted(_KEYS))}")
        if not _is(_KEYS[key], value):
            raise BadValue(f"{key}: {value!r} is not {_KEYS[key]}", places.of(key), f"give {_KEYS[key]}")
    if "line" not in content:
        raise BadValue("`line` is missing", path, 'name a line file: line = "cell.toml"')
    scenarios: List[str] = []
    for pattern in content.get("scenarios", []):
        try:
            scenarios += files_of(sorted(glob.glob(os.path.join(folder, pattern), recursive=True)))
        except BadValue:
            hint = "give files, folders or patterns, relative to the plan"
            raise BadValue(f"scenarios: there is no file {pattern}", places.of("scenarios"), hint) from None
    program = content.get("program", "servodrome.campaign.programs:velocity_step")
    file, _, function = program.rpartition(":")
    if not file or not function:
        raise BadValue(f"program: {program!r} names no function", places.of("program"), 'write program = "FILE.py:FUNCTION"')
    if file.endswith(".py"):
        program = f"{os.path.join(folder, file)}:{function}"
    seeds = content.get("seeds", 1)
    if seeds < 1:
        raise BadValue(f"seeds: {seeds!r} is no number of seeds", places.of("seeds"), "give 1 or more")
    first_seed = content.get("first_seed", 1)
    if first_seed < 0 or first_seed + seeds - 1 > _GREATEST_SEED:
        raise BadValue(
            f"first_seed: seeds from {first_seed} on are not from 0 to 2^63 - 1", places.of("first_seed"), "give another one"
        )
    parameters = {}
    for name, given in _flat(content.get("parameters", {})).items():
        if name in COLUMNS or name.startswith("figure_"):
            raise BadValue(f"{name} is the name of a column of the results", places.of(name), "give the parameter another name")
        parameters[name] = values_of(name, given, places.of(name))
    line = read_toml(os.path.join(folder, content["line"]))
    title = content.get("title", os.path.basename(path))
    checksums = checksums_of({**{path: path for path in scenarios}, program: file_of(program)})
    plan = Plan(title, line, program, scenarios, seeds, first_seed, parameters, checksums, version())
    if plan.size > _MOST_RUNS:
        raise BadValue(f"the plan has {plan.size} runs", path, f"give fewer values; {_MOST_RUNS} is the limit")
    try:
        changed_line(plan, plan.run(0))
    except BadValue as error:  # the line does not have the axis or the table of a parameter
        raise BadValue(error.what, places.of(error.where), error.hint) from None
    return plan


def _is_range(name: str, table: Dict[str, Any]) -> bool:
    """A switch of a line file also has `from` and `to`."""
    if table.keys() & {"count", "scale"}:
        return True
    return table.keys() >= {"from", "to"} and not name.startswith(("axis.", "bus."))


def _flat(table: Dict[str, Any], before: str = "") -> Dict[str, Any]:
    """Dotted keys without quotes are tables in TOML: axis.x.load.inertia_kgm2 is taken in both notations."""
    flat: Dict[str, Any] = {}
    for key, value in table.items():
        name = f"{before}{key}"
        if isinstance(value, dict) and not _is_range(name, value):
            flat.update(_flat(value, name + "."))
        else:
            flat[name] = value
    return flat


def _is_column(values: List[Any]) -> bool:
    """True if the values fit one column of the results: numbers, strings, or truth values."""
    kinds = {bool if isinstance(value, bool) else float if isinstance(value, (int, float)) else type(value) for value in values}
    return len(kinds) == 1 and kinds <= {bool, float, str}


def values_of(name: str, given: Any, where: str) -> List[Value]:
    """The values of a parameter: a list, one value, or { from, to, count, scale = "linear" or "log" }."""
    if isinstance(given, (int, float, str, bool)):
        return [given]
    if isinstance(given, list) and _is_column(given):
        return list(given)
    if isinstance(given, dict):
        unknown = sorted(given.keys() - _RANGE)
        if unknown:
            raise BadValue(f"{name}: a range has no key {unknown[0]}", where, f"known are {', '.join(sorted(_RANGE))}")
        begin, end, count, scale = given.get("from"), given.get("to"), given.get("count"), given.get("scale", "linear")
        fits = _is_column([begin, end]) and not isinstance(begin, (bool, str)) and _is("an integer", count)
        if (
            not fits
            or not 2 <= count <= _MOST_RUNS
            or scale not in ("linear", "log")
            or (scale == "log" and (begin <= 0 or end <= 0))
        ):
            raise BadValue(f"{name}: {given!r} is no range", where, 'write { from = 1e-5, to = 1e-4, count = 5, scale = "log" }')
        shares = [place / (count - 1) for place in range(count)]
        if scale == "log":
            return [begin * math.exp(share * math.log(end / begin)) for share in shares]
        return [begin + share * (end - begin) for share in shares]
    raise BadValue(f"{name}: {given!r} has no values", where, "give a list of values of one type, one value, or a range")


def changed_line(plan: Plan, run: Run) -> Dict[str, Any]:
    """The line of a run: a copy with the parameters axis.NAME.KEYS and bus.NAME.KEYS. Others are for the program only."""
    line: Dict[str, Any] = copy.deepcopy(plan.line)
    for name, value in run.parameters.items():
        kind, _, rest = name.partition(".")
        if kind not in ("axis", "bus"):
            continue
        who, _, keys = rest.partition(".")
        known = [table for table in line.get(kind, []) if isinstance(table, dict)] if isinstance(line.get(kind, []), list) else []
        tables = [table for table in known if table.get("name") == who]
        if not tables or not keys:
            names = ", ".join(str(table.get("name", "?")) for table in known)
            raise BadValue(f"{name}: the line has no {kind} {who!r}", name, f"known are {names}")
        _set(tables[0], name, keys.split("."), value)
    return line


def _set(table: Dict[str, Any], name: str, keys: Sequence[str], value: Value) -> None:
    for key in keys[:-1]:
        table = table.setdefault(key, {})
        if not isinstance(table, dict):
            raise BadValue(f"{name}: {key} of the line file is no table", name, f"write a parameter that ends with {key}")
    table[keys[-1]] = value
