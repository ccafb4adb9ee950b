"""The results of a campaign: a folder with its plan and Parquet files, each written at once."""

from __future__ import annotations

import importlib
import json
import os
import sys
import uuid
import weakref
from typing import Any, Dict, List, Optional, Sequence, Set

from .._outputs import make_folder, replace
from ..errors import BadValue, MissingPackage
from .plan import COLUMNS, Plan

_KEYS = ("title", "version", "plan", "runs", "parameters", "columns")  # of campaign.json


def arrow() -> Any:
    """The package pyarrow."""
    try:
        importlib.import_module("pyarrow.parquet")
        return importlib.import_module("pyarrow")
    except ImportError as error:
        raise MissingPackage("pyarrow is not installed", "campaign", "pip install servodrome[campaign]") from error


def _lock(owner: "Store", path: str) -> None:
    """Locks the file for the life of the owner. Raises BadValue if another process or object has locked it."""
    try:
        fcntl: Any = importlib.import_module("fcntl")
    except ImportError:
        return  # on Windows two commands may compute the same runs; table() drops one of them
    file = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
    weakref.finalize(owner, os.close, file)
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise BadValue("another command writes to this folder", os.path.dirname(path), "wait for its end") from None


class Store:
    """A folder of results. A kill at any moment loses the runs of the file that is being written, and no others."""

    def __init__(self, folder: str, plan: Optional[Plan] = None) -> None:
        """Opens the folder; with a plan, makes it for this plan. Raises BadValue if it belongs to another plan or version."""
        self.folder = folder
        self.parts = os.path.join(folder, "parts")
        self._is_writer = plan is not None
        about = os.path.join(folder, "campaign.json")
        if plan is not None:
            make_folder(self.parts, "--out")
            _lock(self, os.path.join(folder, "lock"))
            if not os.path.exists(about):
                self._write(about, self._about(plan))
        self.about: Dict[str, Any] = self._read_about(about)
        if plan is not None:
            self._check(plan)
            if self.about["title"] != plan.title:
                self.about["title"] = plan.title
                self._write(about, self.about)

    def _check(self, plan: Plan) -> None:
        """Raises BadValue if the folder has results of another plan, or of another version."""
        if self.about["version"] != plan.version:
            what = f"{self.folder} has results of Servodrome {self.about['version']}, and this is {plan.version}"
            raise BadValue(what, self.folder, "go on with that version, or give another folder with --out")
        old, new = self.about["plan"], plan.fingerprints
        changed = ", ".join(key for key in new if new[key] != old.get(key))
        if changed:
            raise BadValue(
                f"{self.folder} has results of another plan: {changed} changed", self.folder, "give another folder with --out"
            )

    @staticmethod
    def _read_about(path: str) -> Dict[str, Any]:
        try:
            with open(path, encoding="utf-8") as file:
                about: Dict[str, Any] = json.load(file)
            missing = [key for key in _KEYS if key not in about]
        except FileNotFoundError:
            folder = os.path.dirname(path)
            raise BadValue(f"{folder} has no campaign.json", folder, "give the folder of `campaign run --out`") from None
        except OSError as error:
            raise BadValue(
                f"the file cannot be read: {error.strerror}", path, "give the folder of `campaign run --out`"
            ) from None
        except (ValueError, TypeError):
            missing = ["its JSON"]
        if missing:
            hint = "delete it, and run the same `campaign run` again: it writes the file anew"
            raise BadValue(f"the file is damaged: {missing[0]} is missing", path, hint)
        return about

    @staticmethod
    def _about(plan: Plan) -> Dict[str, Any]:
        columns = {**COLUMNS, **{name: "parameter" for name in plan.parameters}}
        return {
            "title": plan.title,
            "version": plan.version,
            "plan": plan.fingerprints,
            "runs": plan.size,
            "program": plan.program,
            "parameters": plan.parameters,
            "columns": columns,
        }

    @staticmethod
    def _write(path: str, about: Dict[str, Any]) -> None:
        temporary = f"{path}.{uuid.uuid4().hex}.tmp"
        with open(temporary, "w", encoding="utf-8") as file:
            file.write(json.dumps(about, indent=2) + "\n")
        replace(temporary, path)

    def add(self, rows: Sequence[Dict[str, Any]]) -> None:
        """Writes rows to a file of their own; it appears whole or not at all."""
        pyarrow = arrow()
        names = list(dict.fromkeys(name for row in rows for name in row))
        table = pyarrow.table({name: [row.get(name) for row in rows] for name in names})
        path = os.path.join(self.parts, f"{rows[0]['run']:012d}-{uuid.uuid4().hex}.parquet")
        pyarrow.parquet.write_table(table, path + ".tmp")
        replace(path + ".tmp", path)

    def files(self) -> List[str]:
        """The files of results."""
        try:
            names = os.listdir(self.parts)
        except OSError as error:
            hint = "give the folder of `campaign run --out`"
            raise BadValue(f"the folder of the results cannot be read: {error.strerror}", self.parts, hint) from None
        return sorted(os.path.join(self.parts, name) for name in names if name.endswith(".parquet"))

    def done(self) -> Set[int]:
        """The numbers of the runs that are in the files. A store with a plan sets damaged files aside."""
        numbers: Set[int] = set()
        for file in self.files():
            try:
                numbers.update(self._rows_of(file).column("run").to_pylist())
            except BadValue as error:
                if not self._is_writer:
                    raise
                os.replace(file, file + ".damaged")
                print(f"campaign: {file}: {error.what}; it is {file}.damaged now, and its runs run again", file=sys.stderr)
        return numbers

    @staticmethod
    def _rows_of(file: str) -> Any:
        """The table of a file. Raises BadValue if the file is damaged."""
        pyarrow = arrow()
        try:
            table = pyarrow.parquet.read_table(file)
            table.column("run")
        except PermissionError:
            raise
        except (OSError, KeyError, pyarrow.ArrowException) as error:
            reason = str(error).partition("\n")[0]
            raise BadValue(f"the file is damaged: {reason}", file, "the same `campaign run` computes its runs again") from None
        return table

    def table(self) -> Any:
        """All results as one pyarrow table, in the order of the runs, each run once."""
        pyarrow = arrow()
        tables = [self._rows_of(file) for file in self.files()]
        if not tables:
            raise BadValue("there are no results yet", self.folder, "run the campaign first")
        table = pyarrow.concat_tables(tables, promote_options="permissive").sort_by("run")
        runs = table.column("run").to_pylist()
        return table.take([place for place, run in enumerate(runs) if place == 0 or run != runs[place - 1]])

    def merge(self) -> str:
        """Writes all results to runs.parquet, with the meaning of each column, and returns its path."""
        pyarrow = arrow()
        table = self.table()
        about = {name: self.about["columns"].get(name, "figure of the program") for name in table.column_names}
        metadata = {**(table.schema.metadata or {}), b"servodrome.columns": json.dumps(about).encode()}
        path = os.path.join(self.folder, "runs.parquet")
        pyarrow.parquet.write_table(table.replace_schema_metadata(metadata), path + ".tmp")
        replace(path + ".tmp", path)
        return path
