"""Jobs: what a commissioning tool does with an axis, in line time."""

from __future__ import annotations

import enum
from typing import Any, Dict, NamedTuple, Optional

from ._backend import Backend, path, seconds
from .errors import JobFailed, JobTimeout, Timeout


class JobState(enum.Enum):
    """The state of a job."""

    RUNNING = "running"
    DONE = "done"
    FAILED = "failed"
    CANCELLED = "cancelled"


class JobResult(NamedTuple):
    """The result of a job."""

    position: float
    """In the units of the job."""
    seconds: float
    """The duration, in line time."""


class Job:
    """A job of an axis. It makes progress while line time passes."""

    id: int
    axis: str
    do: str
    """What it does: "move"."""

    def __init__(self, backend: Backend, view: Dict[str, Any]) -> None:
        self._backend = backend
        self._view = view
        self.id = view["id"]
        self.axis = view["axis"]
        self.do = view["do"]

    def view(self) -> Dict[str, Any]:
        """The job as the bench API shows it, with "found" of a tuning; the line remembers its last 64 jobs."""
        if self._view["state"] == "running":
            self._view = self._backend.json("GET", self._path)
        return self._view

    @property
    def state(self) -> JobState:
        """The present state."""
        return JobState(self.view()["state"])

    @property
    def is_over(self) -> bool:
        """True if it is done, failed or cancelled."""
        return self.state is not JobState.RUNNING

    @property
    def result(self) -> Optional[JobResult]:
        """Position and duration of a job that is done, else None."""
        result = self.view().get("result")
        return JobResult(result["position"], result["seconds"]) if result else None

    @property
    def note(self) -> str:
        """A remark about the course of the job: a halt became a quick stop. Usually ""."""
        return str(self.view().get("note", ""))

    def wait(self, timeout: float = 60.0) -> "Job":
        """Lets line time pass until the job is over, at most `timeout` seconds. Returns the job itself.

        Raises JobFailed with the reason if it failed or was ended. If it takes longer than `timeout`, ends it and raises
        JobTimeout. If the wait itself is interrupted (Ctrl-C), the job is told to end as well, so that no axis moves on
        unattended.
        """
        seconds(timeout, "timeout")
        try:
            self._backend.wait_for(lambda: self.is_over, timeout, f"the job {self.do}")
        except Timeout:
            self._end_quietly()
            hint = "give a longer timeout; the job has been told to end"
            raise JobTimeout(f"{self.do} is not over after {timeout:g} s of line time", self.axis, hint, self) from None
        except BaseException:
            self._end_quietly()
            raise
        self.check()
        return self

    def check(self) -> None:
        """Raises JobFailed if the job failed or was ended."""
        error = self.view().get("error")
        if error is not None:
            raise JobFailed(error["what"], error["where"], error["hint"], self)

    def end(self) -> None:
        """Ends the job: the axis is halted as line time passes. A job that is over does not change."""
        self._view = self._backend.json("DELETE", self._path)

    def keep_alive(self) -> None:
        """A "jog" goes on only if this is called at least every 500 ms of the machine's time."""
        self._backend.json("POST", self._path + "/alive")

    def _end_quietly(self) -> None:
        try:
            self.end()
        except Exception:  # the line may be closed: the exception that ended the wait says so
            return

    @property
    def _path(self) -> str:
        return path("jobs", self.id)

    def __repr__(self) -> str:
        return f"<job {self.id}: {self.do} of {self.axis}, {self._view['state']}>"
