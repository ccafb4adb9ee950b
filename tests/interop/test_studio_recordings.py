"""`servodrome studio` records drives from the process data of their buses."""

import subprocess
import urllib.request

import pytest
from line import CAN_AND_ETHERCAT, PROGRAM, ApiError, Line, four_drives, wait_for
from studio import Studio, patiently

pytestmark = [pytest.mark.once, pytest.mark.program("the program is the master")]

DRIVES = four_drives({"first-ec": "generic402-ec", "second-ec": "generic402-ec"})
REFERENCE, ISMK = "generic402-2", "ismk-4"
FIRST, SECOND = "generic402-ec-1", "generic402-ec-2"
POSITION, VELOCITY, BANDWIDTH = "6064:00", "606C:00", "2010:02"


@pytest.fixture
def line(tmp_path):
    line = Line(tmp_path, DRIVES, CAN_AND_ETHERCAT)
    yield line
    line.stop()


@pytest.fixture
def studio(line):
    studio = Studio(*(line.links[name][0] for name in ("can0", "ecat")))
    wait_for(lambda: all(axis["powered"] for axis in studio.bench.get("axes")["axes"]), "an answer of every drive")
    yield studio
    studio.stop()


def done(studio, recording):
    def look():
        now = studio.bench.get(f"recordings/{recording['id']}")
        return now if now["state"] == "done" else None

    return wait_for(look, "the recording", 60)


def columns(studio, recording):
    """The values of each channel, as texts; "" for a row without a value."""
    with urllib.request.urlopen(f"{studio.bench.url}/recordings/{recording['id']}/data.csv", timeout=60) as file:
        rows = file.read().decode().splitlines()[1:]
    return list(zip(*(row.split(",")[2:] for row in rows)))


def test_two_ethercat_drives_are_recorded_in_each_cycle(studio, line):
    def attempt():
        for axis in (FIRST, SECOND):
            studio.over(studio.job(axis, do="reset_fault"))
            studio.does(axis, do="enable")
            studio.does(axis, do="velocity", velocity=1, acceleration=20, units="revolutions")
        recording = done(
            studio,
            studio.bench.post(
                "recordings",
                {
                    "channels": [
                        {"axis": FIRST, "object": POSITION},
                        {"axis": SECOND, "signal": "position_counts"},
                        {"axis": SECOND, "object": BANDWIDTH},
                    ],
                    "rate_hz": 16000,
                    "duration_ms": 2000,
                },
            ),
        )
        for axis in (FIRST, SECOND):
            assert studio.bench.get(f"axes/{axis}")["state"] == "operation enabled", "lost its master"
        return recording

    recording = patiently(attempt)
    assert recording["rate_hz"] == 500
    assert recording["samples"] == 1000
    first, second, bandwidth = (channel["sampled"] for channel in recording["channels"])
    values = columns(studio, recording)
    for channel, column in zip((first, second), values):
        assert "EtherCAT cycle" in channel["by"]
        assert "--cycle" in channel["limit"]["hint"], "16 kHz were asked for"
        # A busy computer skips cycles: these rows are counted as missed. bus_samples_test counts them exactly.
        assert channel["samples"] + channel["missed"] == 1000
        assert len(set(column) - {""}) > bandwidth["samples"], "the axis moves: more positions than readings"
    assert first["samples"] == second["samples"], "both are in the same frame"
    # An object that is not mapped is read, and holds its value between.
    assert bandwidth["by"] == "read as an object"
    assert bandwidth["due_hz"] == 100
    assert bandwidth["samples"] <= 201
    assert "map" in bandwidth["limit"]["hint"]


def tpdos(line, axis):
    """All that is configured for the TPDOs of a virtual drive."""
    return [
        line.bench.get(f"axes/{axis}/objects/{index:04X}/{sub}")["value"]
        for number in range(2)
        for index, subs in ((0x1800 + number, (1, 2)), (0x1A00 + number, (0, 1, 2)))
        for sub in subs
    ]


def begin_on_can(studio, duration_ms, **more):
    channels = [
        {"axis": REFERENCE, "object": POSITION},
        {"axis": ISMK, "object": POSITION},
        {"axis": REFERENCE, "object": BANDWIDTH},
    ]
    body = {"channels": channels, "rate_hz": 1000, "duration_ms": duration_ms, **more}
    return studio.bench.post("recordings", body)


def test_two_can_drives_are_recorded_at_each_sync_and_have_their_tpdos_again(studio, line):
    before = [tpdos(line, axis) for axis in ("reference", "ismk")]
    studio.does(REFERENCE, do="enable")
    studio.does(REFERENCE, do="velocity", velocity=1, acceleration=20, units="revolutions")
    recording = begin_on_can(studio, 1000)
    assert [tpdos(line, axis) for axis in ("reference", "ismk")] != before
    recording = done(studio, recording)
    assert recording["rate_hz"] == 1000
    first, second, read = (channel["sampled"] for channel in recording["channels"])
    for channel in (first, second):
        assert "TPDOs with SYNC" in channel["by"]
        assert "limit" not in channel
        assert channel["samples"] + channel["missed"] == 1000
    # A busy computer sends SYNC late: such rows are missed. The values come from other frames than the readings.
    assert len(set(columns(studio, recording)[0]) - {""}) > read["samples"], "the axis moves: more positions than readings"
    assert read["by"] == "read as an object"
    wait_for(lambda: [tpdos(line, axis) for axis in ("reference", "ismk")] == before, "the TPDOs as before")
    assert studio.bench.get(f"axes/{REFERENCE}")["state"] == "operation enabled"
    assert abs(line.bench.get("axes/reference")["velocity_rpm"]) > 30, "the recording did not stop it"


@pytest.mark.parametrize("way", ["delete", "end of the program"])
def test_tpdos_are_restored_when_a_recording_does_not_end(studio, line, way):
    before = tpdos(line, "reference")
    recording = begin_on_can(studio, 1000, trigger={"kind": "edge", "channel": 0, "level": 1e9})
    assert tpdos(line, "reference") != before
    with pytest.raises(ApiError) as refused:
        studio.bench.put(f"axes/{REFERENCE}/objects/1800/2", {"value": 255})
    assert "a recording has set up the PDOs" in str(refused.value)
    if way == "delete":
        studio.bench.call("DELETE", f"recordings/{recording['id']}")
    else:
        studio.stop()
    wait_for(lambda: tpdos(line, "reference") == before, "the TPDOs as before")


def test_the_tpdos_of_another_master_are_not_touched(studio, line):
    """An operational node belongs to another master: its TPDOs are taken as they come."""
    reference = f"axes/{REFERENCE}/objects"
    studio.bench.put(f"{reference}/1800/1", {"value": 0x80000182})
    studio.bench.put(f"{reference}/1A00/0", {"value": 0})
    studio.bench.put(f"{reference}/1A00/1", {"value": 0x60640020})
    studio.bench.put(f"{reference}/1A00/0", {"value": 1})
    studio.bench.put(f"{reference}/1800/2", {"value": 255})
    studio.bench.put(f"{reference}/1800/5", {"value": 2})
    studio.bench.put(f"{reference}/1800/1", {"value": 0x182})
    subprocess.run([PROGRAM, "nmt", "start", "--bus", line.links["can0"][0], "--node", "2"], check=True, timeout=60)
    configured = tpdos(line, "reference")
    recording = done(studio, begin_on_can(studio, 1000))
    first, second, _ = (channel["sampled"] for channel in recording["channels"])
    assert first["by"] == "TPDO 1, at least every 2 ms"
    assert first["samples"] + first["missed"] >= 499
    assert "another master" in second["limit"]["what"]
    assert second["by"] == "read as an object"
    assert tpdos(line, "reference") == configured
