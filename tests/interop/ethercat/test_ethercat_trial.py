"""`servodrome trial` with pysoem as the master, over the cable."""

import json
import pathlib
import sys

import pytest
from line import servodrome

ROOT = pathlib.Path(__file__).parents[3]
MASTER = ROOT / "examples/masters/pysoem_master.py"
SCENARIOS = ROOT / "scenarios/ethercat"


def trial(cables, scenario, *master, status=0):
    near, far = cables[0]
    link = f"ecat=raw:{far.replace('0', '{job}')}"
    options = ("--scenarios", SCENARIOS / f"{scenario}.toml", "--bus", link, "--json")
    command = [str(word).replace("MASTER", near.replace("0", "{job}")) for word in master]
    text = servodrome("trial", *options, "--", *command, status=status)
    return text if status else json.loads(text)[0]


def pysoem_master(cables, scenario):
    return trial(cables, scenario, sys.executable, MASTER, "MASTER")


@pytest.mark.parametrize("scenario", ["frame-lost-on-the-way-out", "working-counter-always-wrong", "al-refuse-op-no-sync"])
def test_pysoem_passes(cables, scenario):
    result = pysoem_master(cables, scenario)
    assert result["outcome"] == "passed", result
    assert all(rule["acts"] > 0 for rule in result["rules"])


def test_a_master_that_does_nothing_reaches_nothing(cables):
    assert trial(cables, "frame-lost-on-the-way-out", "true")["outcome"] == "not reached"


def test_a_link_to_a_bus_that_is_not_there(cables):
    options = ("--scenarios", SCENARIOS / "frame-cut.toml", "--bus", "ecatt=raw:servo0", "--json")
    assert 'there is no bus \\"ecatt\\"' in json.dumps(json.loads(servodrome("trial", *options, "--", "true", status=None)))
