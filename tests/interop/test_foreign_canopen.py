"""Our commands as masters of third-party CANopen drives: the same simple drive on two CANopen stacks."""

import json
import signal
import subprocess

import pytest
from bus import open_bus
from foreign_drive import PRODUCT, SERIAL, UNITS, VENDOR, CanopenDrive, DurandDrive
from line import PROGRAM, servodrome, wait_for

# The device and the commands are two programs on one bus; a serial line has only one program at its other end.
pytestmark = [pytest.mark.once, pytest.mark.program("the program is the master")]

NODE = 5


@pytest.fixture(params=[CanopenDrive, DurandDrive], ids=["canopen", "durand"])
def foreign(request, line):
    device = request.param(open_bus(line.links["can0"][0]), NODE)
    yield device
    device.close()


@pytest.fixture
def command(line, foreign):
    """command(NAME, ...): runs a command on the third-party drive."""
    link = line.links["can0"][0]
    return lambda name, *arguments, **options: servodrome(
        *name.split(), *arguments, "--bus", link, "--node", NODE, **options)


def place(foreign):
    foreign.shaft.pass_time()
    return foreign.shaft.place


def test_scan(line, foreign):
    nodes = json.loads(servodrome("scan", "--bus", line.links["can0"][0], "--timeout", "5", "--json"))["nodes"]
    assert [node["node"] for node in nodes] == [1, 2, NODE]
    found = nodes[2]
    assert (found["vendor_id"], found["product_code"], found["serial_number"]) == (VENDOR, PRODUCT, SERIAL)
    assert found["product"] is None and "servo" in found["kind"]


def test_get_and_set(command, foreign, tmp_path):
    command("set", "--timeout", "30", "6081", "4321")
    assert foreign.shaft.values[0x6081, 0] == 4321
    assert json.loads(command("get", "--timeout", "30", "6081", "--json"))["value"] == 4321
    assert "several segments" in command("get", "--timeout", "30", "2000", "--type", "string")
    command("set", "--timeout", "30", "2000", "longer than it was, and still text", "--type", "string")
    assert bytes(foreign.shaft.values[0x2000, 0]).decode().startswith("longer than")
    assert "0602 0000" in command("get", "--timeout", "30", "5FFF", status=1)
    assert "0601 0002" in command("set", "--timeout", "30", "6041", "1", status=1)
    foreign.eds(tmp_path / "plain.eds")
    assert "several" not in command("get", "--timeout", "30", "Note", "--eds", tmp_path / "plain.eds")


def test_block_transfer(command, foreign):
    text = "x" * 40
    if foreign.blocks:
        command("set", "--timeout", "30", "--block", "2000", text, "--type", "string")
        assert bytes(foreign.shaft.values[0x2000, 0]).decode() == text
    else:  # it may answer a block upload with a normal one, and refuses a block download
        assert "0504 0001" in command("set", "--timeout", "30", "--block", "2000", text, "--type", "string", status=1)
    assert command("get", "--timeout", "30", "--block", "2000", "--type", "string")


def test_motions(command, foreign):
    homed = json.loads(command("home", "--method", "37", "--json"))
    assert homed["position"] == 0
    moved = json.loads(command("move", "--by", "2", "--velocity", "5", "--revolutions", "--json"))
    assert moved["position"] == 2 * UNITS and place(foreign) == 2 * UNITS
    command("move", "--to", "-500")
    assert place(foreign) == -500
    jogged = json.loads(command("jog", "--velocity", "1000", "--seconds", "0.3", "--json"))
    assert jogged["position"] > -500 and foreign.shaft.speed == 0
    assert foreign.shaft.state == "enabled"
    command("move", "--to", "0", "--disable")
    assert foreign.shaft.state != "enabled"


def test_a_script(command, line, tmp_path):
    script = tmp_path / "plain.script"
    script.write_text(f"axis it {NODE}\nunits revolutions\nenable\nmove by 1 velocity 5\nexpect 6064 == {UNITS}\ndisable\n")
    assert json.loads(servodrome("run", script, "--bus", line.links["can0"][0], "--json"))["passed"]


def test_a_fault(command, foreign):
    foreign.shaft.trip(0x4210)
    told = json.loads(command("faults", "--json", status=None))
    assert [fault["code"] for fault in told["active"]] == [0x4210]
    assert "4210h" in command("move", "--by", "10", status=1)
    command("move", "--by", "10", "--reset-fault")
    assert foreign.shaft.state == "enabled"


def test_parameters(command, foreign, tmp_path):
    sheet, saved = tmp_path / "plain.eds", tmp_path / "plain.par"
    foreign.eds(sheet)
    assert "--eds" in command("params save", saved, status=2)
    command("params save", saved, "--eds", sheet)
    assert "6081" in saved.read_text()
    foreign.shaft.values[0x6081, 0] = 77
    assert "6081" in command("params diff", saved, "--eds", sheet, status=None)
    command("params load", saved, "--eds", sheet)
    assert foreign.shaft.values[0x6081, 0] == 5 * UNITS


def test_network_management(command, foreign):
    sent = json.loads(command("nmt", "stop", "--json"))
    assert sent["command"] == "stop"
    wait_for(foreign.is_stopped, "NMT stop")
    command("nmt", "reset-node")
    wait_for(lambda: not foreign.is_stopped(), "NMT reset node")


def test_what_is_seen_of_it(line, command, foreign, tmp_path):
    seen = tmp_path / "seen.txt"
    with open(seen, "wb") as output:
        monitor = subprocess.Popen([PROGRAM, "monitor", "--bus", line.links["can0"][0]], stdout=output)
    try:

        def shown():
            command("get", "--timeout", "30", "6041")
            foreign.emergency(0x4210)
            said = seen.read_text()
            return "4210" in said and "6041" in said

        wait_for(shown, lambda: f"an emergency and an SDO in {seen.read_text()!r}")
    finally:
        monitor.send_signal(signal.SIGINT)
        assert monitor.wait(60) == 0


def test_conform_says_what_it_lacks(command, foreign):
    """The stacks have deviations, which docs/foreign.md lists; every run must end with a verdict."""
    report = json.loads(command("conform", "--json", "--timeout", "5", "--only", "identity", "--only", "power", "--only", "abort",
                                status=None))
    verdicts = {check["id"]: check["verdict"] for check in report["checks"]}
    assert report["passed"] >= 10, verdicts
    assert foreign.shaft.state != "enabled" and foreign.shaft.speed == 0
