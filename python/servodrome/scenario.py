"""Scenarios: drives and buses that misbehave by rules, and what a master is expected to do (docs/scenario.md)."""

from __future__ import annotations

import enum
from types import TracebackType
from typing import Any, Dict, List, NamedTuple, Optional, Type

from ._backend import Backend, path


class Outcome(enum.Enum):
    """The judgement of an expectation."""

    PASSED = "passed"
    FAILED = "failed"
    NOT_REACHED = "not reached"
    """The moment at which its watch begins has not come."""


class Verdict(NamedTuple):
    """An expectation and its judgement."""

    name: str
    outcome: Outcome
    at: float
    """Line time in seconds at which it was decided."""
    found: str
    """What was found, in words."""


class RuleState(NamedTuple):
    """What a rule has done."""

    name: str
    acts: int
    first_act: Optional[float]
    """Line time in seconds, None if it has not acted."""
    error: str
    """Why it could not act; usually ""."""


class Scenario:
    """A scenario that runs on a line. As a context manager it ends with the block."""

    def __init__(self, backend: Backend, text: str, file: str) -> None:
        self._backend = backend
        self._view: Dict[str, Any] = backend.json("PUT", "scenario", {"text": text, "file": file})
        self._ended = False

    @property
    def title(self) -> str:
        """The title in its file."""
        return str(self._view["title"])

    @property
    def rules(self) -> Dict[str, RuleState]:
        """The rules by name."""
        states = [
            RuleState(rule["name"], rule["acts"], rule["first_act_s"], rule["error"]) for rule in self._now()["rules"]
        ]
        return {state.name: state for state in states}

    @property
    def verdicts(self) -> List[Verdict]:
        """The expectations; those that are still watched are not reached."""
        return [
            Verdict(view["name"], Outcome(view["outcome"]), view["at_s"], view["found"])
            for view in self._now()["expectations"]
        ]

    @property
    def failed(self) -> List[Verdict]:
        """The expectations that have failed. `assert not scenario.failed` prints them."""
        return [verdict for verdict in self.verdicts if verdict.outcome is Outcome.FAILED]

    def add_rules(self, text: str) -> None:
        """Lets the rules of a text (`[[rule]]` ...) join; the others go on.

        Raises BadValue if one does not fit the line or has the name of a present rule: then none joins.
        """
        self._backend.json("POST", "scenario/rules", {"text": text})

    def remove_rule(self, name: str) -> None:
        """Ends a rule and takes its effect back. It is no longer among the rules. Raises UnknownName."""
        self._backend.json("DELETE", path("scenario", "rules", name))

    def master_ended(self, success: bool) -> None:
        """The master has ended, and believes that all is well or not: for the conditions `ended_ms` and `exit`."""
        self._view = self._backend.json("POST", "scenario/master", {"success": success})

    def end(self) -> None:
        """Ends all rules, takes their effects back, and decides the expectations. A second call does nothing."""
        if self._ended:
            return
        self._ended = True
        self._view = self._backend.json("DELETE", "scenario")

    def _now(self) -> Dict[str, Any]:
        if not self._ended:
            self._view = self._backend.json("GET", "scenario")
        return self._view

    def __enter__(self) -> "Scenario":
        return self

    def __exit__(
        self, kind: Optional[Type[BaseException]], error: Optional[BaseException], trace: Optional[TracebackType]
    ) -> None:
        self.end()
