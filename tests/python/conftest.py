"""Fixtures: lines of the package `servodrome`.

Environment: SERVODROME_LIBRARY, the C library; SERVODROME, the program. By default those of build/release. An installed package
is used in place of the one in python/.
"""

import os
import pathlib
import sys

ROOT = pathlib.Path(__file__).parents[2]
sys.path.append(str(ROOT / "python"))

import pytest  # noqa: E402
import servodrome  # noqa: E402

if not (pathlib.Path(servodrome.__file__).parent / "_lib").exists():
    os.environ.setdefault("SERVODROME_LIBRARY", str(ROOT / "build/release/src/capi/libservodrome.so"))

# Two drives on CAN with the home switch around 0, and one on EtherCAT.
COUNTS = 131072
TRAVEL = {
    "counts_per_unit": COUNTS,
    "low_stop": -11,
    "high_stop": 11,
    "negative_limit": -10,
    "positive_limit": 10,
    "home": {"from": -0.5, "to": 0.5},
}


def axes():
    return [
        servodrome.Axis("x", "generic402", node=2, travel={**TRAVEL, "start": 2}),
        servodrome.Axis("y", "ismc", node=1, travel=TRAVEL),
        servodrome.Axis("z", "jmc_ec"),
    ]


@pytest.fixture
def line():
    with servodrome.Line(axes=axes()) as opened:
        yield opened


@pytest.fixture
def x(line):
    return line.axes["x"]


@pytest.fixture(scope="session")
def program():
    """The program, for lines in real time."""
    file = os.environ.get("SERVODROME") or str(ROOT / "build/release/src/app/servodrome")
    assert os.access(file, os.X_OK), f"{file} does not exist: build the target servodrome, or set SERVODROME"
    return file
