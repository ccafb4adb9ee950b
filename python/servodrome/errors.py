"""The exceptions of this package. All derive from `Error` and have `what`, `where` and `hint`."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any, List, Mapping, NamedTuple, Optional, Sequence

if TYPE_CHECKING:
    from .jobs import Job


class Error(Exception):
    """What is wrong, where, and what to do about it. `str()` is "where: what; hint"."""

    what: str
    where: str
    hint: str

    def __init__(self, what: str, where: str = "", hint: str = "") -> None:
        super().__init__(what, where, hint)
        self.what = what
        self.where = where
        self.hint = hint

    def __str__(self) -> str:
        text = f"{self.where}: {self.what}" if self.where else self.what
        return f"{text}; {self.hint}" if self.hint else text


class Closed(Error):
    """The line, or something that was opened on it, is closed."""


def closed() -> Closed:
    """The exception for the use of a line after its end."""
    return Closed("the line is closed", "", "use it before close(), or inside its `with` block")


class Forked(Error):
    """The line belongs to the parent process: this process was forked from it."""


class WrongType(Error, TypeError):
    """A value has the wrong type, or a key does not exist."""


class BadValue(Error, ValueError):
    """A value is out of its range."""


class UnknownName(Error, KeyError):
    """There is no axis, bus, signal, input or fault of this name."""


class Refused(Error):
    """Not possible in the present state: for example the axis has no power, or another job is running."""


class ObjectError(Error):
    """The drive refuses access to an object. `abort` is the SDO abort code that a master would get (CiA 301 7.2.4.3.17)."""

    abort: int
    abort_text: str

    def __init__(self, what: str, where: str = "", hint: str = "", abort: int = 0, abort_text: str = "") -> None:
        super().__init__(what, where, hint)
        self.abort = abort
        self.abort_text = abort_text


class UnknownObject(ObjectError, KeyError):
    """The drive does not have this object (abort code 0602 0000h) or sub-index (0609 0011h)."""


class JobFailed(Error):
    """A job failed or was ended before it was done; `job` has the rest."""

    job: "Job"

    def __init__(self, what: str, where: str, hint: str, job: "Job") -> None:
        super().__init__(what, where, hint)
        self.job = job


class Timeout(Error, TimeoutError):
    """Something did not happen within its time."""


class JobTimeout(JobFailed, TimeoutError):
    """A job was not over in time. It has been told to end, which halts the axis."""


class NotInRealTime(Error):
    """Possible only with clock="virtual"."""


class NotInVirtualTime(Error):
    """Possible only with clock="real"."""


class ProgramError(Error):
    """The program `servodrome` cannot be started, or has ended."""


class LibraryError(Error, ImportError):
    """The C library cannot be loaded."""


class MissingPackage(Error, ImportError):
    """An optional Python package is not installed."""


class Diagnostic(NamedTuple):
    """An error or a warning about a line file. `line` and `column` count from 1; 0: the file as a whole."""

    file: str
    line: int
    column: int
    what: str
    hint: str

    def __str__(self) -> str:
        place = f"{self.file}:{self.line}:{self.column}" if self.line else self.file
        return f"{place}: {self.what}; {self.hint}" if self.hint else f"{place}: {self.what}"


class LineFileError(Error):
    """The line file has errors. `str()` is one line for each of them, as compilers write it: "FILE:LINE:COLUMN: what; hint"."""

    diagnostics: List[Diagnostic]

    def __init__(self, diagnostics: Sequence[Diagnostic]) -> None:
        first = diagnostics[0]
        super().__init__(first.what, f"{first.file}:{first.line}:{first.column}" if first.line else first.file, first.hint)
        self.diagnostics = list(diagnostics)

    def __reduce__(self) -> Any:
        return LineFileError, (self.diagnostics,)

    def __str__(self) -> str:
        return "\n".join(str(diagnostic) for diagnostic in self.diagnostics)

    @property
    def file(self) -> str:
        """The file of the first error."""
        return self.diagnostics[0].file

    @property
    def line(self) -> int:
        """The line of the first error, from 1; 0: the file as a whole."""
        return self.diagnostics[0].line

    @property
    def column(self) -> int:
        """The column of the first error, from 1; 0: the file as a whole."""
        return self.diagnostics[0].column


def diagnostics_of(items: Sequence[Mapping[str, Any]]) -> List[Diagnostic]:
    """The diagnostics in an answer of the C library."""
    return [Diagnostic(item["file"], item["line"], item["column"], item["what"], item["hint"]) for item in items]


_OBJECT_DOES_NOT_EXIST = 0x06020000
_SUB_INDEX_DOES_NOT_EXIST = 0x06090011
_CLASSES = {400: WrongType, 422: BadValue, 404: UnknownName, 401: Refused, 403: Refused, 409: Refused}


def refusal(status: int, body: bytes) -> Error:
    """The exception for a refusal of the bench API, docs/bench-api.md ("Refusals")."""
    try:
        error = json.loads(body)["error"]
        what, where, hint = str(error["what"]), str(error["where"]), str(error["hint"])
        abort: Optional[str] = error.get("abort")
    except (ValueError, KeyError, TypeError):
        return Error(f"the bench API answers with status {status}", "bench API", body[:200].decode(errors="replace"))
    if abort is not None:
        code = int(abort, 16)
        missing = code in (_OBJECT_DOES_NOT_EXIST, _SUB_INDEX_DOES_NOT_EXIST)
        return (UnknownObject if missing else ObjectError)(what, where, hint, code, str(error.get("abort_text", "")))
    return _CLASSES.get(status, Error)(what, where, hint)
