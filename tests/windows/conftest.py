"""Fixtures: wine, and a line of drives in the program for Windows."""

import pathlib
import sys

import pytest

sys.path.append(str(pathlib.Path(__file__).parents[1] / "interop"))

import wine as windows  # noqa: E402  (needs the path above)
from line import axis_text, bus_text, stopped_at_the_end  # noqa: E402

LINE = (
    bus_text("can0")
    + 'links = ["socketcand:127.0.0.1:0/can0"]\n'
    + bus_text("rs", "rs485")
    + 'links = ["tcp:127.0.0.1:0"]\n'
    + bus_text("ecat", "ethercat")
    + 'links = ["udp:127.0.0.1:0"]\n'
    + axis_text("reference", "generic402", bus="can0", node=2, serial="rs", store="reference.bin")
    + axis_text("slave", "generic402-ec", bus="ecat")
)


def pytest_collection_modifyitems(items):
    reason = None
    if windows.WINE is None:
        reason = "wine64 is missing; apt-get install wine64"
    elif not windows.PROGRAM.is_file():
        reason = f"{windows.PROGRAM} is missing; run tools/package --only windows"
    if reason:
        for item in items:
            item.add_marker(pytest.mark.skip(reason=reason))


@pytest.fixture(scope="session")
def wine(tmp_path_factory):
    machine = windows.Wine(tmp_path_factory.mktemp("wine"))
    yield machine
    machine.close()


@pytest.fixture
def lines():
    """The lines of a test; they are stopped after it."""
    with stopped_at_the_end() as lines:
        yield lines


@pytest.fixture
def start_line(wine, tmp_path, lines):
    """start_line(TOML): starts a line, and ends it properly after the test."""

    def start(text=LINE):
        lines.append(windows.WindowsLine(wine, tmp_path, text))
        return lines[-1]

    return start


@pytest.fixture
def line(start_line):
    return start_line()
