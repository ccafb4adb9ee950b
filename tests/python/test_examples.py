"""Runs the project that users copy, examples/python, as a user does."""

import os
import pathlib
import shutil
import subprocess
import sys

import pytest
import servodrome
from test_pytest_plugin import PLUGIN

pytest.importorskip("canopen")
pytest.importorskip("can")

EXAMPLE = pathlib.Path(__file__).parents[2] / "examples/python"


def run(folder, *arguments):
    package = str(pathlib.Path(servodrome.__file__).parents[1])
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, [package, os.environ.get("PYTHONPATH")]))}
    environment.pop("PYTEST_ADDOPTS", None)
    command = [sys.executable, "-m", "pytest", *PLUGIN, "-p", "no:cacheprovider", *arguments]
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True)


def test_its_tests_pass_in_a_copy(tmp_path):
    project = tmp_path / "project"
    shutil.copytree(EXAMPLE, project, ignore=shutil.ignore_patterns("__pycache__", "servodrome-reports"))
    result = run(project)
    assert result.returncode == 0 and "10 passed" in result.stdout, result.stdout
    assert not (project / "servodrome-reports").exists()


@pytest.mark.parametrize(
    "old, new, failed",
    [
        ("self._check_door()", "pass", "test_an_open_door_stops_the_bridge"),
        ("MASTER_NODE << 16 | int(HEARTBEAT_TIMEOUT_S * 1000)", "0", "test_a_cable_breaks"),
        (
            "self.write(0x6065, COUNTS_PER_REVOLUTION // 4, 4)",
            "self.write(0x6065, 2**32 - 1, 4)",
            "test_a_blocked_end_stops_the_other",
        ),
        ("drive.write(0x6072, permille, 2)", "pass", "test_overload_does_not_exceed_the_torque_limit"),
        (
            "round(speed * COUNTS_PER_REVOLUTION)",
            "round(speed * COUNTS_PER_REVOLUTION) + drive.node.id * 1000",
            "test_both_ends_move_in_step",
        ),
        ("self.homed = False", "self.homed = True", "test_after_a_restart_it_must_be_homed"),
    ],
)
def test_a_mistake_in_the_machine_is_found(tmp_path, old, new, failed):
    project = tmp_path / "project"
    shutil.copytree(EXAMPLE, project, ignore=shutil.ignore_patterns("__pycache__", "servodrome-reports"))
    program = project / "machine.py"
    text = program.read_text()
    assert old in text
    program.write_text(text.replace(old, new))
    result = run(project, "-k", failed)
    assert "1 failed" in result.stdout, result.stdout
    folder = project / "servodrome-reports" / f"test_machine-{failed}"
    environment = {**os.environ, "PYTHONPATH": str(pathlib.Path(servodrome.__file__).parents[1])}
    replayed = subprocess.run([sys.executable, folder / "replay.py"], env=environment, capture_output=True, text=True)
    for line in replayed.stdout.splitlines()[1:]:  # "left: 65536 counts, fault"
        position, state = line.split(", ")
        assert any(text.startswith(position) and state in text for text in result.stdout.splitlines()), (line, result.stdout)
    assert replayed.returncode == 0 and len(replayed.stdout.splitlines()) == 3, replayed
    assert {"can0.candump.log", "left.svg", "right.svg", "replay.py", "line.toml"} <= {file.name for file in folder.iterdir()}
