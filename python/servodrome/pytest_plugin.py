"""Plugin of pytest: a line of drives for each test, and its captures and pictures if the test fails.

    def test_homes(servodrome_line):                        # the built-in line, in virtual time
        servodrome_line.axes["reference"].enable()

    @pytest.mark.servodrome(file="cell.toml")               # relative to the file of the test
    def test_cell(servodrome_line): ...

Keys of the marker, all optional; each is taken from the closest marker (function, class, module) that has it:

file=, text=, or axes= with buses=   the line: a line file, its text, or servodrome.Axis and Bus. Without: `--servodrome-line`, the
                                     ini option `servodrome_line`, or the built-in line
clock="virtual" or "real"            real: the line is a process of its own on free ports. `--servodrome-real` makes all lines real
record=True                          False: no captures and pictures, and no cost

Keep this module light: pytest imports it in every run.
"""

from __future__ import annotations

import pathlib
import re
import zlib
from typing import TYPE_CHECKING, Any, Dict, Generator, Iterator, List

import pytest

if TYPE_CHECKING:
    from ._test_report import Description, Watch
    from .line import Line

_LINE_KEYS = ("file", "text", "axes")
_KEYS = (*_LINE_KEYS, "buses", "clock", "record")
_MARKER = "servodrome(file=, text=, axes=, buses=, clock='virtual', record=True): the line of the fixture servodrome_line"
_LONGEST_NAME = 100
_watch_key: pytest.StashKey[Watch] = pytest.StashKey()


def pytest_addoption(parser: pytest.Parser) -> None:
    """Adds the options of this plugin."""
    group = parser.getgroup("servodrome", "servo drives")
    group.addoption("--servodrome-line", metavar="FILE", help="line file of tests whose marker names none")
    group.addoption("--servodrome-real", action="store_true", help="run all lines in real time")
    group.addoption("--servodrome-keep", action="store_true", help="write the files of passed tests too")
    group.addoption(
        "--servodrome-reports", metavar="DIR", default="servodrome-reports", help="folder for them (default: %(default)s)"
    )
    parser.addini("servodrome_line", "line file of tests whose marker names none, relative to the ini-file", default="")


def pytest_configure(config: pytest.Config) -> None:
    """Makes the marker known."""
    config.addinivalue_line("markers", _MARKER)


@pytest.fixture
def servodrome_line(request: pytest.FixtureRequest) -> Iterator[Line]:
    """The line of this test, as its marker `servodrome` describes it. It is closed after the test."""
    from ._test_report import Watch
    from .errors import Error
    from .line import Line

    item: Any = request.node
    keys = _keys_of(item)
    clock = "real" if item.config.getoption("servodrome_real") else keys.get("clock", "virtual")
    _remove_old(_folder_of(item))
    try:
        description = _description_of(item, keys)
        if description.text is None:
            line = Line(clock=clock)
        else:
            line = Line.from_text(description.text, name=description.name, clock=clock)
    except Error as error:
        pytest.fail(f"servodrome_line: {error}", pytrace=False)
    with line:
        item.stash[_watch_key] = Watch(line, description, keys.get("record", True))
        yield line
        del item.stash[_watch_key]


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, Any, None]:
    """Writes the files while the line is still open: before the fixtures end."""
    outcome = yield
    report: pytest.TestReport = outcome.get_result()
    watch = item.stash.get(_watch_key, None)
    keep = item.config.getoption("servodrome_keep") and report.when == "call"
    if watch is None or report.when == "teardown" or not (report.failed or keep):
        return
    folder = _folder_of(item)
    try:
        about = watch.write(folder, item.nodeid)
    except OSError as error:
        about = [f"cannot write: {error}"]
    else:
        about.insert(0, f"{folder} has {', '.join(sorted(file.name for file in folder.iterdir()))}")
    report.sections.append(("servodrome", "\n".join(about)))


def _keys_of(item: pytest.Item) -> Dict[str, Any]:
    """The keys of the markers."""
    keys: Dict[str, Any] = {}
    for marker in item.iter_markers("servodrome"):  # the closest first
        unknown = [str(value) for value in marker.args] + [key for key in marker.kwargs if key not in _KEYS]
        lines = [key for key in _LINE_KEYS if key in marker.kwargs]
        if unknown:
            pytest.fail(f"marker servodrome: {unknown[0]!r} is not a key; the keys are {', '.join(_KEYS)}", pytrace=False)
        if len(lines) > 1 or ("buses" in marker.kwargs and lines != ["axes"]):
            pytest.fail("marker servodrome: give one of file=, text=, axes=; buses= only with axes=", pytrace=False)
        has_line = any(key in keys for key in _LINE_KEYS)
        for key, value in marker.kwargs.items():
            if not (has_line and key in (*_LINE_KEYS, "buses")):
                keys.setdefault(key, value)
    return keys


def _description_of(item: pytest.Item, keys: Dict[str, Any]) -> Description:
    """The line that the keys, or the options, describe. Raises servodrome.Error."""
    from ._test_report import Description
    from .tables import line_text

    folder = item.path.parent
    if "text" in keys:
        return Description(keys["text"], str(folder / "line.toml"))
    if "axes" in keys:
        return Description(line_text(keys["axes"], keys.get("buses", ())), "line.toml")
    if "file" in keys:
        return _read(folder / keys["file"])
    config = item.config
    option, ini = config.getoption("servodrome_line"), config.getini("servodrome_line")
    if option:
        return _read(config.invocation_params.dir / option)
    if ini:
        return _read((config.inipath.parent if config.inipath else config.rootpath) / ini)
    return Description(None, "default.toml")


def _read(file: pathlib.Path) -> Description:
    from ._test_report import Description
    from .errors import Diagnostic, LineFileError

    try:
        return Description(file.read_text(encoding="utf-8", errors="surrogateescape"), str(file))
    except OSError as error:
        reason = f"cannot be read: {error.strerror}"
        raise LineFileError([Diagnostic(str(file), 0, 0, reason, "give the name of a line file")]) from error


def _folder_of(item: pytest.Item) -> pathlib.Path:
    """The folder for the files of a test: each test has its own, whatever characters its name has."""
    parts: List[str] = item.nodeid.replace(".py::", "::").split("::")
    name = re.sub(r"[^\w.\[\]-]", "_", "-".join(parts))
    if len(name) > _LONGEST_NAME or name != "-".join(parts).replace("/", "_"):
        name = f"{name[:_LONGEST_NAME]}-{zlib.crc32(item.nodeid.encode()):08x}"
    return pathlib.Path(item.config.rootpath, str(item.config.getoption("servodrome_reports")), name)


def _remove_old(folder: pathlib.Path) -> None:
    """Deletes what an earlier run of the test has written."""
    import shutil

    if (folder / "replay.py").exists():
        shutil.rmtree(folder, ignore_errors=True)
