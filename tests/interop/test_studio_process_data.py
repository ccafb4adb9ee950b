"""`servodrome studio` with process data of a drive: tuning by measurement, and the content of PDOs."""

import json
import subprocess
import time
import urllib.parse
import urllib.request

import pytest
from line import CAN_AND_ETHERCAT, ApiError, Line, axis_text, bus_text, four_drives, wait_for
from studio import Studio, patiently
from test_tune import ATTEMPTS, TOO_BUSY, UNEVEN, WATCHDOG

pytestmark = [pytest.mark.once, pytest.mark.program("the program is the master")]

DRIVES = (
    four_drives({"first-ec": "generic402-ec", "second-ec": "generic402-ec"})
    + bus_text("rs", "rs485")
    + axis_text("serial", "generic402", serial="rs")
)
CAN, ETHERCAT, MODBUS = "generic402-2", "generic402-ec-2", "generic402"
GAIN = "objects/2010/2"
BANDWIDTH = 60  # Hz: without it the job would choose a bandwidth that only an idle computer can keep


@pytest.fixture
def line(tmp_path):
    line = Line(tmp_path, DRIVES, (*CAN_AND_ETHERCAT, "rs=tcp:127.0.0.1:0"))
    yield line
    line.stop()


@pytest.fixture
def studio(line):
    studio = Studio(*(line.links[name][0] for name in ("can0", "ecat")), f"modbus:{line.links['rs'][0]}")
    wait_for(lambda: all(axis["powered"] for axis in studio.bench.get("axes")["axes"]), "an answer of every drive")
    yield studio
    studio.stop()


def recover(studio, axis):
    """Recovers if the computer was too busy to keep a slave in operation: opens the bus again and resets the fault."""
    wait_for(lambda: studio.bench.get(f"axes/{axis}")["powered"], "an answer")
    studio.over(studio.job(axis, do="reset_fault"))


def begin(studio, axis, seconds, **order):
    """Begins a tuning of an axis that may have left operation because of a busy computer."""

    def attempt():
        recover(studio, axis)
        return studio.job(axis, do="tune", units="revolutions", seconds=seconds, **order)

    return patiently(attempt)


def turning(studio, line, axis, **order):
    """Returns a tuning whose axis turns; None: the computer was too busy each time."""
    name = {CAN: "reference", ETHERCAT: "second-ec"}[axis]
    for _ in range(ATTEMPTS):
        job = begin(studio, axis, 20, **order)

        def look():
            if abs(line.bench.get(f"axes/{name}")["velocity_rpm"]) > 20:
                return True
            now = studio.bench.get(f"jobs/{job['id']}")
            return now if now["state"] != "running" else None

        if (now := wait_for(look, "that it turns")) is True:
            return job
        assert too_busy(now), json.dumps(now)
    return None


def tuned(studio, axis, **order):
    """Returns the job when it is over, and its progress messages."""
    job = begin(studio, axis, 4, **order)
    doing, speeds = set(), set()

    def look():
        now = studio.bench.get(f"jobs/{job['id']}")
        if now.get("progress"):
            doing.add((now["progress"]["doing"], now["progress"]["share"]))
        speeds.add(studio.bench.get(f"axes/{axis}")["velocity"])
        return now if now["state"] != "running" else None

    return wait_for(look, "the end of the tuning", 240), doing, speeds


def too_busy(job):
    """Returns true if the job failed for lack of processor time, and says so."""
    said = job["error"]["hint"] + job["error"]["what"] if job["state"] == "failed" else ""
    return any(word in said for word in (*TOO_BUSY, *WATCHDOG, *UNEVEN))


@pytest.mark.parametrize("axis", [CAN, ETHERCAT])
def test_a_drive_is_tuned_on_its_bus(studio, axis):
    gains = studio.bench.get(f"axes/{axis}/gains")
    assert gains["measures"] and gains["writes"]
    before = studio.bench.get(f"axes/{axis}/{GAIN}")["value"]
    for _ in range(4):
        job, doing, speeds = tuned(studio, axis, apply=True, bandwidth_hz=BANDWIDTH)
        if job["state"] == "done":
            assert len(doing) > 1 and len(speeds) > 2, "others see what happens meanwhile"
            break
        assert too_busy(job), json.dumps(job)
        recover(studio, axis)
        assert studio.bench.get(f"axes/{axis}/{GAIN}")["value"] == before
    else:
        return  # every failure was reported, and nothing was changed
    assert job["found"]["before"]["inertia"] > 0
    assert job["found"]["after"]["bandwidth_hz"] > 0
    assert studio.bench.get(f"axes/{axis}/{GAIN}")["value"] != before
    patiently(lambda: move(studio, axis))


def move(studio, axis):
    recover(studio, axis)
    studio.does(axis, do="enable")
    studio.does(axis, do="move", by=0.2, velocity=2, acceleration=20, units="revolutions")


@pytest.mark.parametrize("axis", [CAN, ETHERCAT])
def test_a_tuning_is_stopped_with_all_axes(studio, line, axis):
    name = {CAN: "reference", ETHERCAT: "second-ec"}[axis]
    before = studio.bench.get(f"axes/{axis}/{GAIN}")["value"]
    if (job := turning(studio, line, axis, apply=True)) is None:
        return  # the computer cannot tune a drive, so the stop cannot be tested
    studio.bench.post("stop", {})
    assert studio.bench.get(f"jobs/{job['id']}")["state"] == "cancelled"
    wait_for(lambda: abs(line.bench.get(f"axes/{name}")["velocity_rpm"]) < 1, "that it stands", 5)
    assert studio.bench.get(f"axes/{axis}/{GAIN}")["value"] == before


@pytest.mark.parametrize("axis", [CAN, ETHERCAT])
def test_a_tuning_that_is_stopped_while_it_enables_leaves_no_torque(studio, line, axis):
    name = {CAN: "reference", ETHERCAT: "second-ec"}[axis]
    for after_s in (0.0, 0.05, 0.1, 0.2, 0.4):
        job = begin(studio, axis, 4)
        time.sleep(after_s)
        studio.bench.post("stop", {})
        over = studio.over(job)
        assert over["state"] == "cancelled" or too_busy(over), json.dumps(over)
        wait_for(lambda: line.bench.get(f"axes/{name}")["state"] != "operation enabled", "that it is disabled", 5)
        time.sleep(0.5)
        assert line.bench.get(f"axes/{name}")["state"] != "operation enabled", after_s


def test_while_one_drive_is_tuned_others_are_served(studio, line):
    for _ in range(4):
        if (first := turning(studio, line, CAN)) is None:
            return
        second = studio.job("ismk-4", do="tune", units="revolutions", seconds=20)
        path = recorded(studio, line.links["can0"][0], "ismk-4")
        assert studio.bench.get(f"{path}/traffic?limit=10")["rows"]
        studio.bench.call("DELETE", f"jobs/{second['id']}")
        waited = studio.over(second)
        studio.does("ismk-4", do="enable")
        running = studio.bench.get(f"jobs/{first['id']}")
        studio.bench.call("DELETE", f"jobs/{first['id']}")
        ended = studio.over(first)
        if not any(too_busy(job) for job in (waited, running, ended)):
            break
        recover(studio, CAN)
        recover(studio, "ismk-4")
    else:
        return  # the computer cannot tune a drive, so it cannot be tested with two
    assert waited["state"] == "cancelled", "one that waits for its turn"
    assert running["state"] == "running"
    assert ended["state"] == "cancelled"


def test_a_tuning_over_modbus_fails_and_says_why(studio):
    assert not studio.bench.get(f"axes/{MODBUS}/gains")["measures"]
    job = studio.over(studio.job(MODBUS, do="tune", units="revolutions"))
    assert job["state"] == "failed" and "fixed rate" in job["error"]["what"], json.dumps(job)


def mapped(pdos, index):
    (pdo,) = (pdo for pdo in pdos["pdos"] if pdo["index"] == index)
    padding = "0000:00"
    return [one["object"] if one["object"] != padding else f"{padding}/{one['bits']}" for one in pdo["objects"]]


def test_pdos_of_a_node_are_changed(studio, line):
    path = f"axes/{CAN}/pdos"
    assert studio.bench.get(path)["bus"] == "can"
    wanted = {"index": "0x1603", "objects": ["6040:00", "60FF:00"], "can_id": 0x50A, "enabled": True}
    after = studio.bench.put(path, {"pdos": [wanted]})
    assert mapped(after, "0x1603") == ["6040:00", "60FF:00"]
    assert line.bench.get("axes/reference/objects/1603/2")["value"] == 0x60FF0020
    with pytest.raises(ApiError, match="does not fit|cannot be mapped|0604"):
        studio.bench.put(path, {"pdos": [{"index": "0x1603", "objects": ["6041:00/8"]}]})
    assert mapped(studio.bench.get(path), "0x1603") == ["6040:00", "60FF:00"], "as it was"


def test_pdos_of_a_slave_are_changed_while_the_bus_does_not_operate(studio, line):
    patiently(lambda: change_pdos_of_a_slave(studio, line))


def change_pdos_of_a_slave(studio, line):
    path = f"axes/{ETHERCAT}/pdos"
    other = "generic402-ec-1"
    recover(studio, other)
    recover(studio, ETHERCAT)
    before = studio.bench.get(path)
    assert before["bus"] == "ethercat" and before["receive"]
    index = before["receive"][0]
    now = mapped(before, index)
    wanted = now[:-1] if "60B1:00" in now else [*now, "60B1:00"]
    studio.does(other, do="enable")
    with pytest.raises(ApiError, match="torque"):
        studio.bench.put(path, {"pdos": [{"index": index, "objects": wanted}]})
    studio.does(other, do="disable")
    after = studio.bench.put(path, {"pdos": [{"index": index, "objects": wanted}]})
    assert mapped(after, index) == wanted
    for name in ("first-ec", "second-ec"):
        state = line.bench.get(f"axes/{name}")["al_state"]
        assert state == "Operational", f"lost: {name} is in {state}"
    with pytest.raises(ApiError):
        studio.bench.put(path, {"pdos": [{"index": index, "objects": ["6041:00/8"]}]})
    assert mapped(studio.bench.get(path), index) == wanted, "what was there before"
    wait_for(lambda: line.bench.get("axes/second-ec")["al_state"] == "Operational", "operation, which is lost", 20)
    move(studio, ETHERCAT)


def recorded(studio, bus, axis):
    """The traffic of a bus while an object of the axis is read."""
    path = "buses/" + urllib.parse.quote(bus, safe="")
    assert studio.bench.put(f"{path}/traffic", {"record": True})["recording"]
    studio.bench.get(f"axes/{axis}/objects/6064/0")
    time.sleep(0.2)
    assert not studio.bench.put(f"{path}/traffic", {"record": False})["recording"]
    return path


@pytest.mark.parametrize(
    ("bus", "axis", "words", "sides"),
    [
        ("can0", CAN, "read", {"master", CAN}),
        ("ecat", ETHERCAT, "Position actual value", {"slaves"}),  # frames are listed when they are back
        ("rs", MODBUS, "read", {"master", "drive"}),
    ],
)
def test_traffic_of_a_bus_is_told_in_words(studio, line, bus, axis, words, sides, tmp_path):
    link = line.links[bus][0]
    path = recorded(studio, f"modbus:{link}" if bus == "rs" else link, axis)
    answer = studio.bench.get(f"{path}/traffic?limit=5000")
    rows = answer["rows"]
    assert rows and not (wrong := [row["text"] for row in rows if row["error"]]), wrong[:5]
    assert {row["from"] for row in rows} >= sides
    assert any(words in row["text"] for row in rows), rows[:20]
    times = [row["time_ns"] for row in rows]
    assert times == sorted(times) and times[-1] - times[0] < 60e9
    with urllib.request.urlopen(f"{studio.ready['api']}/{path}/capture?format=pcap", timeout=30) as capture:
        file = tmp_path / "capture.pcap"
        file.write_bytes(capture.read())
    decoded = subprocess.run(["tshark", "-r", file], capture_output=True, text=True, timeout=60, check=True).stdout
    assert len(decoded.splitlines()) > 3 and "Malformed" not in decoded
    assert {"can0": "CAN", "ecat": "ECAT", "rs": "Modbus"}[bus] in decoded


def test_a_bus_that_is_not_there_has_no_traffic(studio):
    with pytest.raises(ApiError, match="404"):
        studio.bench.get("buses/socketcand%3Anowhere/traffic")


def test_there_are_no_process_data_over_modbus(studio):
    with pytest.raises(ApiError, match="no process data"):
        studio.bench.get(f"axes/{MODBUS}/pdos")
