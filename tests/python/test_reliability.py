"""Short versions of the long runs in tests/reliability, and tests that their checks detect a failure."""

import json
import os
import pathlib
import subprocess
import sys

import pytest
from conftest import ROOT

FOLDER = ROOT / "tests/reliability"
sys.path.append(str(FOLDER))

import report  # noqa: E402
import saves  # noqa: E402
import soak  # noqa: E402


def run(name, *options):
    """The exit status and the report of a run."""
    environment = {**os.environ, "PYTHONPATH": str(pathlib.Path(sys.modules["servodrome"].__path__[0]).parent)}
    command = [sys.executable, "-W", "error", FOLDER / f"{name}.py", "--json", "--quiet", *options]
    result = subprocess.run([str(word) for word in command], capture_output=True, text=True, env=environment, timeout=250, check=False)
    assert result.stdout, result.stderr
    return result.returncode, json.loads(result.stdout)


def short_report():
    given = report.options("test", "").parse_args(["--quiet"])
    return report.Report("test", given)


# ---- soak ----

SHORT_SOAK = ("--axes", 7, "--hours", 0.034, "--period", 20, "--warm-up", 0.006, "--reference", 0.014)


def test_axes_of_all_products_move_without_drift():
    status, found = run("soak", *SHORT_SOAK)
    assert status == 0, found["findings"]
    assert found["moves"] >= 7 * 2 * 5
    assert all(figures["duration_s"]["later"] for figures in found["figures"].values())


def test_a_figure_that_leaves_its_range_is_a_finding():
    figures = soak.Figures()
    for value in (0.500, 0.504):
        figures.add("duration_s", value, True)
    assert not figures.outside("duration_s", 0.5095)
    assert figures.outside("duration_s", 0.511)
    assert figures.outside("duration_s", 0.493)


@pytest.mark.parametrize(("shift_s", "changed"), [(0.001, []), (0.002, ["duration_s"])])
def test_a_mean_that_changes_is_a_finding(shift_s, changed):
    figures = soak.Figures()
    for number in range(200):
        value = 0.500 + 0.005 * (number % 2)
        figures.add("duration_s", value, True)
        figures.add("duration_s", value + shift_s, False)
        assert not figures.outside("duration_s", value + shift_s)
    assert [name for name, _, _ in figures.changed_means()] == changed


class Drifting:
    """An axis whose position object loses counts in an overflow."""

    def __init__(self):
        self.position = 0
        self.objects = {0x6064: 0}


@pytest.mark.parametrize(("lost", "findings"), [(0, 0), (9, 0), (12, 1)])  # the encoder has errors of up to 4 counts
def test_a_drift_of_the_position_object_is_a_finding(lost, findings):
    subject = soak.Subject.__new__(soak.Subject)
    subject.axis = Drifting()
    subject.units_per_revolution = subject.counts_per_revolution = 131072
    subject.offset = subject.shown = None
    subject.overflows = 0
    texts = []
    subject.fail = texts.append
    subject.check_offset()
    for position in (2**31 - 10, 2**31 + 10, 2**32 + 5):
        subject.axis.position = position
        shown = position - lost * (position > 2**31)
        subject.axis.objects[0x6064] = (shown + 2**31) % 2**32 - 2**31
        subject.check_offset()
    assert len(texts) == findings
    assert subject.overflows == 1


# ---- saves ----


def test_killed_while_a_drive_saves(program, monkeypatch):
    monkeypatch.setenv("SERVODROME", program)
    status, found = run("saves", "--runs", 12)
    assert status == 0, found["findings"]
    assert found["kills"] == 12


class File:
    """A client that reads these numbers of saves from the drive."""

    def __init__(self, *numbers):
        self.values = [number + place for place, number in enumerate(numbers)]

    def read(self, _node, index, sub=0):
        return 0 if index == 0x603F else self.values[saves.OBJECTS.index((index, sub))]


@pytest.mark.parametrize(
    ("numbers", "findings"),
    [([7] * 8, 0), ([8] * 8, 0), ([7] * 7 + [8], 1), ([6] * 8, 1)],
    ids=["old", "new", "mixed", "older than the acknowledged one"],
)
def test_a_file_between_two_saves_is_a_finding(numbers, findings):
    out = short_report()
    kills = saves.Kills(out.given, out, None)
    kills.acknowledged, kills.under_way = 7, 8
    kills.check(1, File(*numbers))
    assert out.finding_count == findings


# ---- clients ----


def test_every_port_bears_hostile_clients(program, monkeypatch):
    """Does not judge delays, because they depend on the machine."""
    monkeypatch.setenv("SERVODROME", program)
    status, found = run("clients", "--seconds", 2, "--late", 1_000_000)
    assert status == 0, found["findings"]
    assert found["hostile_clients"] == 33
    assert found["ethercat"]["cycles"] > 0
