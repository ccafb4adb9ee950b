"""The results of a campaign: a folder with its plan and Parquet files, each written at once."""

from __future__ import annotations

import importlib
import json
import os
import uuid
import weakref
from typing import Any, Dict, List, Optional, Sequence, Set

from ..errors import BadValue, MissingPackage
from .plan import COLUMNS, Plan

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
        """Opens the folder; with a plan, makes it for this plan. Raises BadValue if it belongs to another plan."""
        self.folder = folder
        self.parts = os.path.join(folder, "parts")
        about = os.path.join(folder, "campaign.json")
        if plan is not None:
            os.makedirs(self.parts, exist_ok=True)
            if not os.path.exists(about):
                self._write(about, json.dumps(self._about(plan), indent=2) + "\n")
        if not os.path.exists(about):
            raise BadValue(f"{folder} has no campaign.json", folder, "give the folder of `campaign run --out`")
        with open(about, encoding="utf-8") as file:
            self.about: Dict[str, Any] = json.load(file)
        if plan is not None and self.about["fingerprint"] != plan.fingerprint:
            raise BadValue(f"{folder} has results of another plan", folder, "give another folder with --out")
        if plan is not None:
            _lock(self, os.path.join(folder, "lock"))

    @staticmethod
    def _about(plan: Plan) -> Dict[str, Any]:
        columns = {**COLUMNS, **{name: "parameter" for name in plan.parameters}}
        return {
            "title": plan.title,
            "fingerprint": plan.fingerprint,
            "runs": plan.size,
            "program": plan.program,
            "parameters": plan.parameters,
            "columns": columns,
        }

    @staticmethod
    def _write(path: str, text: str) -> None:
        temporary = f"{path}.{uuid.uuid4().hex}.tmp"
        with open(temporary, "w", encoding="utf-8") as file:
            file.write(text)
        os.replace(temporary, path)

    def add(self, rows: Sequence[Dict[str, Any]]) -> None:
        """Writes rows to a file of their own; it appears whole or not at all."""
        pyarrow = arrow()
        names = list(dict.fromkeys(name for row in rows for name in row))
        table = pyarrow.table({name: [row.get(name) for row in rows] for name in names})
        path = os.path.join(self.parts, f"{rows[0]['run']:012d}-{uuid.uuid4().hex}.parquet")
        pyarrow.parquet.write_table(table, path + ".tmp")
        os.replace(path + ".tmp", path)

    def files(self) -> List[str]:
        """The files of results."""
        return sorted(os.path.join(self.parts, name) for name in os.listdir(self.parts) if name.endswith(".parquet"))

    def done(self) -> Set[int]:
        """The numbers of the runs that are in the files."""
        pyarrow = arrow()
        numbers: Set[int] = set()
        for file in self.files():
            numbers.update(pyarrow.parquet.read_table(file, columns=["run"]).column("run").to_pylist())
        return numbers

    def table(self) -> Any:
        """All results as one pyarrow table, in the order of the runs, each run once."""
        pyarrow = arrow()
        tables = [pyarrow.parquet.read_table(file) for file in self.files()]
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
        os.replace(path + ".tmp", path)
        return path
