"""The change log: writes of third-party masters to the drives of a line, and the undo."""

import json
import subprocess

import pytest
from canopen import Network as Canopen
from canopen import SdoAbortedError, SdoCommunicationError
from line import PROGRAM, ApiError, Line, axis_text, bus_text, servodrome, wait_for
from pymodbus.client import ModbusTcpClient
from studio import Studio

pytestmark = [pytest.mark.once, pytest.mark.program("its command lists the changes")]

DRIVES = (
    bus_text("can0")
    + bus_text("rs", "rs485")
    + bus_text("rs10", "rs485")
    + axis_text("reference", "generic402", bus="can0", node=2)
    + axis_text("second", "generic402", bus="can0", node=3)
    + axis_text("panel", "ismk", serial="rs", serial_protocol="modbus")
    + axis_text("old", "ismk", serial="rs10", serial_protocol="serial10")
)
PROFILE_VELOCITY = 0x4A00  # register of the iSMK (ch. 7, 'Object list')


@pytest.fixture
def line(tmp_path):
    line = Line(tmp_path, DRIVES, ["can0=socketcand:127.0.0.1:0/can0", "rs=tcp:127.0.0.1:0", f"rs10=pty:{tmp_path}/rs10"])
    yield line
    line.stop()


def server_of(line):
    return line.bench.url.removeprefix("http://").removesuffix("/api/v1")


def host_and_port(link):
    host, port = link.split(":", 1)[1].split("/")[0].rsplit(":", 1)
    return host, int(port)


def changes(line, *words, status=0):
    return servodrome("changes", "--server", server_of(line), *words, status=status)


def value(line, axis, index):
    return line.bench.get(f"axes/{axis}/objects/{index:04X}/0")["value"]


@pytest.fixture
def node(line):
    """Node 2, of the package canopen."""
    host, port = host_and_port(line.links["can0"][0])
    network = Canopen()
    network.connect(interface="socketcand", channel="can0", host=host, port=port)
    yield network.add_node(2)
    network.disconnect()


def test_an_sdo_of_a_foreign_master_is_listed_and_undone(line, node):
    before = value(line, "reference", 0x6083)
    node.sdo.download(0x6083, 0, (54321).to_bytes(4, "little"))
    node.sdo.download(0x6040, 0, (0).to_bytes(2, "little"))  # a controlword that starts a motion
    [row] = json.loads(changes(line, "--axis", "reference", "--json"))["changes"]
    assert (row["object"], row["before"], row["after"], row["who"]) == ("6083:00", before, 54321, "SDO on can0")
    assert row["name"] == "Profile acceleration"
    assert f"6083:00  {before} -> 54321  Profile acceleration  (SDO on can0)" in changes(line)
    assert f"{before}" in changes(line, "--undo", row["number"])
    assert int.from_bytes(node.sdo.upload(0x6083, 0), "little") == before
    assert json.loads(changes(line, "--json"))["changes"][-1]["who"] == "undo by API (servodrome)"


def test_a_register_of_pymodbus_is_listed(line):
    host, port = host_and_port(line.links["rs"][0])
    with ModbusTcpClient(host, port=port) as client:
        assert not client.write_registers(PROFILE_VELOCITY, [100, 0], device_id=1).isError()
    [row] = json.loads(changes(line, "--axis", "panel", "--json"))["changes"]
    assert (row["object"], row["who"]) == ("6081:00", "Modbus on rs")
    assert row["after"] == value(line, "panel", 0x6081)


def test_a_write_over_the_10_byte_protocol_is_listed(line):
    servodrome("set", "6083", 4321, "--bus", f"serial10:serial:{line.links['rs10'][0].removeprefix('pty:')}", "--node", 1)
    rows = json.loads(changes(line, "--axis", "old", "--json"))["changes"]
    assert [(row["object"], row["after"], row["who"]) for row in rows] == [("6083:00", 4321, "10-byte protocol on rs10")]


def test_what_another_has_changed_since_stays_and_is_named(line, node):
    line.bench.put("axes/reference/objects/6083/0", {"value": 1000})
    line.bench.put("axes/reference/objects/6081/0", {"value": 2000})
    node.sdo.download(0x6083, 0, (3000).to_bytes(4, "little"))
    [first, second, _] = json.loads(changes(line, "--json"))["changes"]
    assert first["who"] == second["who"]
    with pytest.raises(ApiError) as refusal:
        line.bench.post("changes/undo", {"number": first["number"]})
    assert refusal.value.status == 409
    assert "SDO on can0 has changed the value since" in refusal.value.body["error"]["what"]
    said = changes(line, "--axis", "reference", "--undo-all", "--who", first["who"], status=1)
    assert "some values stay" in said
    assert value(line, "reference", 0x6083) == 3000
    assert value(line, "reference", 0x6081) == second["before"]


def test_all_of_an_axis_are_undone(line, node):
    before = [value(line, "reference", index) for index in (0x6081, 0x6083, 0x6084)]
    line.bench.put("axes/reference/objects/6083/0", {"value": 1000})
    node.sdo.download(0x6081, 0, (2000).to_bytes(4, "little"))
    node.sdo.download(0x6083, 0, (3000).to_bytes(4, "little"))
    line.bench.put("axes/reference/objects/6084/0", {"value": 4000})
    changes(line, "--axis", "reference", "--undo-all")
    assert [value(line, "reference", index) for index in (0x6081, 0x6083, 0x6084)] == before


def test_the_changes_of_all_axes_are_shown_and_then_undone(line, node):
    axes = ("reference", "panel", "old")
    before = {axis: value(line, axis, 0x6083) for axis in axes}
    node.sdo.download(0x6083, 0, (3000).to_bytes(4, "little"))
    for axis in ("panel", "old"):
        line.bench.put(f"axes/{axis}/objects/6083/0", {"value": 4321})
    shown = changes(line, "--undo-all", "--all-axes", "--preview")
    assert f"reference 6083:00  3000 -> {before['reference']}" in shown
    assert [value(line, axis, 0x6083) for axis in axes] == [3000, 4321, 4321]
    line.bench.post("axes/panel/power", {"action": "off"})
    [stays] = line.bench.post("changes/undo", {"all": True, "preview": True})["kept"]
    assert (stays["axis"], stays["what"]) == ("panel", "the axis has no power")
    assert "some values stay" in changes(line, "--undo-all", "--all-axes", status=1)
    assert value(line, "reference", 0x6083) == before["reference"]
    assert value(line, "old", 0x6083) == before["old"]


def test_wrong_requests_are_explained(line):
    assert "--undo-all needs --axis" in changes(line, "--undo-all", status=2)
    assert "--undo-all needs --axis" in changes(line, "--undo-all", "--axis", "reference", "--all-axes", status=2)
    assert "--all-axes needs --undo-all" in changes(line, "--all-axes", status=2)
    assert "--preview needs" in changes(line, "--preview", status=2)
    assert "--axis excludes --undo" in changes(line, "--undo", 7, "--axis", "reference", status=2)
    assert "there is no change 7" in changes(line, "--undo", 7, status=1)
    assert 'there is no axis "x"' in changes(line, "--axis", "x", status=1)
    gone = subprocess.run([PROGRAM, "changes", "--server", "127.0.0.1:1"], capture_output=True, text=True, timeout=60, check=False)
    assert gone.returncode == 1
    assert "the server does not answer" in gone.stderr


def test_the_studio_of_real_drives_lists_its_own_writes(line):
    studio = Studio(f"{line.links['can0'][0]}=2")
    try:
        before = value(line, "reference", 0x6081)
        wait_for(lambda: studio.bench.axis("generic402-2")["powered"], "the first answer of the drive")
        studio.bench.put("axes/generic402-2/objects/6083/0", {"value": 54321})
        studio.does("generic402-2", do="enable")
        studio.does("generic402-2", do="move", by=0.1, velocity=3, units="revolutions")
        studio.does("generic402-2", do="disable")
        rows = studio.bench.get("changes?axis=generic402-2")["changes"]
        assert [row["after"] for row in rows if row["object"] == "6083:00"] == [54321]
        [velocity] = [row for row in rows if row["object"] == "6081:00"]
        assert velocity["before"] == before
        assert velocity["who"].startswith("job ")
        assert velocity["who"].endswith("(move)")
        assert not [row for row in rows if row["object"] in ("6040:00", "607A:00")]
        studio.bench.post("changes/undo", {"axis": "generic402-2"})
        assert value(line, "reference", 0x6081) == before
    finally:
        studio.stop()


def beside_the_studio(transfer, *arguments):
    """Repeats an SDO transfer of canopen that took an answer to the studio, on the same SDO channel, for its own."""
    for _ in range(20):
        try:
            return transfer(*arguments)
        except SdoCommunicationError:
            continue
    raise AssertionError("canopen got no answer of its own in 20 attempts")


def test_the_studio_of_real_drives_lists_what_another_master_writes(line, node):
    studio = Studio(f"{line.links['can0'][0]}=2")

    def write(index, data):
        beside_the_studio(node.sdo.download, index, 0, data)

    def read(index):
        return int.from_bytes(beside_the_studio(node.sdo.upload, index, 0), "little")

    try:
        wait_for(lambda: studio.bench.axis("generic402-2")["powered"], "the first answer of the drive")
        acceleration = read(0x6083)
        write(0x6083, (43210).to_bytes(4, "little"))
        velocity = studio.bench.get("axes/generic402-2/objects/6081/0")["value"]  # the studio reads it
        write(0x6081, (12345).to_bytes(4, "little"))
        write(0x6085, (23456).to_bytes(4, "little"))  # has not passed on the bus
        write(0x6040, b"\x06\x00")  # a controlword is not listed
        with pytest.raises(SdoAbortedError):  # a refused write is not listed
            write(0x6041, b"\x06\x00")
        studio.bench.put("axes/generic402-2/objects/6084/0", {"value": 98765})  # its own write is listed once

        def rows():
            return studio.bench.get("changes?axis=generic402-2")["changes"]

        wait_for(lambda: len(rows()) == 4, "all changes in the log")
        read_by_studio, read_by_master, own, unread = sorted(rows(), key=lambda row: row["object"])
        assert (read_by_studio["object"], read_by_studio["before"], read_by_studio["after"]) == ("6081:00", velocity, 12345)
        assert (read_by_master["object"], read_by_master["before"], read_by_master["after"]) == ("6083:00", acceleration, 43210)
        assert (unread["object"], unread["before"], unread["after"]) == ("6085:00", None, 23456)
        for foreign in (read_by_studio, read_by_master, unread):
            assert foreign["who"] == f"SDO on {line.links['can0'][0]}"[:47]
        assert (own["object"], own["after"]) == ("6084:00", 98765)
        assert own["who"].startswith("API")
        undone = studio.bench.post("changes/undo", {"all": True})
        assert {row["object"] for row in undone["undone"]} == {"6081:00", "6083:00", "6084:00"}
        assert [(row["object"], row["what"]) for row in undone["kept"]] == [("6085:00", "the value before is not known")]
        assert (read(0x6083), read(0x6081)) == (acceleration, velocity)
    finally:
        studio.stop()


def test_a_silent_drive_keeps_its_values_and_the_others_are_undone(line):
    studio = Studio(f"{line.links['can0'][0]}=2,3")
    try:
        before = value(line, "reference", 0x6083)
        for axis in ("generic402-2", "generic402-3"):
            wait_for(lambda axis=axis: studio.bench.axis(axis)["powered"], "the first answer of the drive")
            studio.bench.put(f"axes/{axis}/objects/6083/0", {"value": 54321})
        line.bench.post("axes/second/power", {"action": "off"})
        undone = studio.bench.post("changes/undo", {"all": True})
        assert [(row["axis"], row["to"]) for row in undone["undone"]] == [("generic402-2", before)]
        assert [(row["axis"], row["object"]) for row in undone["kept"]] == [("generic402-3", "6083:00")]
        assert value(line, "reference", 0x6083) == before
        line.bench.post("axes/second/power", {"action": "on"})
    finally:
        studio.stop()
