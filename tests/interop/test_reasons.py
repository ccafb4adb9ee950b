"""The commands name the reason why a motion ends or is not possible, and the examples of the README work as printed."""

import json
import pathlib
import re
import subprocess

import pytest
from line import COUNTS, PROGRAM, Line, bus_text, servodrome

pytestmark = [pytest.mark.once, pytest.mark.program("the program is the master")]

SWITCH = 2  # revolutions, at both ends
NEAR_SWITCHES = f"""
[axis.travel]
counts_per_unit = {COUNTS}
start = 0
low_stop = -3
high_stop = 3
negative_limit = {-SWITCH}
positive_limit = {SWITCH}
"""
LINE = (
    bus_text("can0") + bus_text("ecat", "ethercat")
    + f'[[axis]]\nname = "reference"\nproduct = "generic402"\nbus = "can0"\nnode = 2\n{NEAR_SWITCHES}'
    + '[[axis]]\nname = "jmc"\nproduct = "jmc_ec"\nbus = "ecat"\n'
)
RUN = ["--revolutions", "--velocity", "4", "--acceleration", "50"]
AT_SWITCH = "where the positive limit switch is active (60FDh)"


@pytest.fixture
def near_switches(tmp_path):
    line = Line(tmp_path, LINE, ["can0=socketcand:127.0.0.1:0/can0", "ecat=udp:127.0.0.1:0"])
    yield line
    line.stop()


@pytest.fixture
def client(near_switches):
    """client(COMMAND, ...): a command for the reference drive."""
    link = near_switches.links["can0"][0]
    return lambda command, *words, **options: servodrome(command, "--bus", link, "--node", "2", *words, **options)


def test_a_fault_that_an_injection_holds(near_switches, client):
    fault = "axes/reference/faults"
    near_switches.bench.post(fault, {"inject": "over_voltage"})
    said = client("faults", "--reset", status=1)
    assert "3210h DC link over-voltage" in said and "On a virtual drive, a fault injected by the bench API holds" in said, said
    assert ".." not in said, said
    near_switches.bench.delete(fault)
    assert "no fault is active" in client("faults", "--reset")


def test_a_motion_into_a_limit_switch(client):
    said = client("move", "--by", SWITCH + 0.5, *RUN, status=1)
    assert AT_SWITCH in said and "internal limit active" in said and "move the other way" in said, said
    client("move", "--by", "-1", *RUN)
    script = ["--do", "units revolutions", "--do", "enable", "--do", "move by 2 velocity 4"]
    said = client("scope", "position", *script, status=1)
    assert "`move by 2 velocity 4`" in said and AT_SWITCH in said and "internal limit active" in said, said


def test_tune_at_a_limit_switch_names_the_switch(client):
    client("move", "--by", SWITCH - 0.1, *RUN)
    said = client("tune", "--seconds", "4", status=1)
    if "with less load" not in said and "PDOs were missing" not in said:  # a busy computer loses cycles before the axis is at the switch
        assert "the positive limit switch is active (60FDh)" in said and "start farther away from it" in said, said
        assert "allow more with --travel" not in said, said


def test_there_and_back_is_no_step(client):
    script = ["--do", "units revolutions", "--do", "enable", "--do", "move by 1 velocity 4", "--do", "move by -1 velocity 4", "--do", "wait 0.2"]
    position, velocity = json.loads(client("scope", "position", "velocity", "--json", *script))["channels"]
    assert position["greatest"] - position["least"] > 0.9 * COUNTS
    assert position["step"] is None and velocity["step"] is None


def test_the_overspeed_of_a_jmc_names_the_objects_of_its_limit(near_switches):
    near_switches.bench.post("axes/jmc/faults", {"inject": "over_speed"})
    command = [PROGRAM, "faults", "--bus", near_switches.links["ecat"][0], "--node", "1"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 1 and "A420h" in done.stdout, done
    assert "607Fh" in done.stdout and "6080h" in done.stdout, done.stdout


def test_monitor_names_the_mode_in_a_pipe(client):
    client("move", "--by", "0.1", *RUN)
    assert re.search(r"operation enabled, mode 1 \(profile position\), position ", client("monitor", "--axis", "--seconds", "0.2"))
    shown = json.loads(client("monitor", "--axis", "--seconds", "0.2", "--json").splitlines()[0])
    assert (shown["mode"], shown["mode_name"]) == (1, "profile position")


README = pathlib.Path(__file__).parents[2] / "README.md"


def test_the_curls_of_the_readme(tmp_path):
    """As printed, except for the port of the API."""
    commands = [row for row in README.read_text().splitlines() if row.startswith("curl ")]
    assert len(commands) == 3 and "encoder_loss" in commands[1] and "-X DELETE" in commands[2]
    line = Line(tmp_path, (README.parent / "lines/default.toml").read_text(),
                [f"{bus}=" + link for bus, link in (("can0", "socketcand:127.0.0.1:0/can0"), ("rs485", "tcp:127.0.0.1:0"), ("ecat", "udp:127.0.0.1:0"))])
    try:
        api = line.bench.url.partition("/api/")[0]
        view, cut, repair = [
            json.loads(subprocess.run(["sh", "-c", command.replace("http://127.0.0.1:8402", api)], capture_output=True, text=True, timeout=60, check=True).stdout or "null")
            for command in commands
        ]
        assert "position_counts" in view
        assert cut["injected"] == ["encoder_loss"]
        assert repair is None or repair["injected"] == []
        assert line.bench.get("axes/reference/faults")["injected"] == []
        servodrome("faults", "--bus", line.links["can0"][0], "--node", "2", "--reset")
    finally:
        line.stop()
