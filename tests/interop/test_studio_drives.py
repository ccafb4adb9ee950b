"""`servodrome studio`: its server for drives on buses; the drives are those of a line in another process."""

import io
import json
import subprocess
import time
import urllib.error
import urllib.request
from urllib.parse import quote

import pytest
from line import COUNTS, PROGRAM, ApiError, Line, axis_text, bus_text, servodrome, wait_for
from mcap.reader import make_reader
from studio import Studio, patiently

DRIVES = (
    bus_text("can0")
    + bus_text("ecat", "ethercat")
    + bus_text("rs", "rs485")
    + axis_text("ismc", "ismc", bus="can0", node=1)
    + axis_text("jmc", "jmc_ec", 4000, bus="ecat")
    + axis_text("reference", "generic402", serial="rs")
)
# The names in the studio and in the line.
NAMES = {"ismc-1": "ismc", "jmc_ec-1": "jmc", "generic402": "reference"}

pytestmark = [pytest.mark.once, pytest.mark.program("the program is the master")]


def turns(axis, **numbers):
    """Converts numbers in revolutions for a job; to the ISMC's own units, because that drive does not report its units
    per
    revolution."""
    if axis == "ismc-1":
        return {key: round(value * COUNTS) for key, value in numbers.items()}
    return {"units": "revolutions", **numbers}


def start_line(folder, links=("can0=socketcand:127.0.0.1:0/can0", "ecat=udp:127.0.0.1:0", "rs=tcp:127.0.0.1:0")):
    folder.mkdir(exist_ok=True)
    return Line(folder, DRIVES, links)


def buses_of(line):
    can, ethercat, modbus = (line.links[name][0] for name in ("can0", "ecat", "rs"))
    return can, ethercat, f"modbus:{modbus}"


@pytest.fixture
def line(tmp_path):
    line = start_line(tmp_path / "line")
    yield line
    line.stop()


@pytest.fixture
def studio(line):
    studio = Studio(*buses_of(line))
    yield studio
    studio.stop()


def test_finds_the_drives_of_all_buses(studio):
    assert [axis["name"] for axis in studio.ready["axes"]] == list(NAMES)
    line = studio.bench.get("line")
    assert line["kind"] == "real" and "plant" in line["missing"]
    for axis in wait_for(
        lambda: [axis for axis in studio.bench.get("axes")["axes"] if axis["powered"]], "an answer"
    ):
        assert axis["state"] in ("switch on disabled", "ready to switch on", "not ready to switch on")


def test_what_only_simulated_drives_have_is_refused_with_the_reason(studio):
    axis = f"axes/{next(iter(NAMES))}"
    bus = quote(studio.bench.get("buses")["buses"][0]["name"], safe="")
    calls = [
        ("POST", f"{axis}/power", {"action": "off"}),
        ("GET", f"{axis}/geometry", None),
        ("GET", f"{axis}/inputs", None),
        ("PUT", f"{axis}/inputs", {"DI0": True}),
        ("GET", f"{axis}/plant", None),
        ("PUT", f"{axis}/plant", {"locked_rotor": True}),
        ("POST", f"{axis}/faults", {"inject": "encoder_loss"}),
        ("DELETE", f"{axis}/faults", None),
        ("POST", f"buses/{bus}/disturb", {"drop": 1}),
        ("DELETE", f"buses/{bus}/disturb", None),
        ("PUT", "clock", {"speed": 2}),
        ("POST", "clock/advance", {"ms": 1}),
        ("GET", "scenario", None),
        ("PUT", "scenario", {"text": ""}),
        ("DELETE", "scenario/rules/any", None),
        ("PUT", "trial", {"text": ""}),
        ("DELETE", "trial", None),
        ("GET", "recordings/1/bode?input=0&output=1", None),
    ]
    for method, path, body in calls:
        with pytest.raises(ApiError) as refusal:
            studio.bench.call(method, path, body)
        assert refusal.value.status == 409 and "simulated drives only" in str(refusal.value), (method, path)
    assert studio.bench.get(f"buses/{bus}")["connected"]
    with pytest.raises(ApiError, match="there is no bus"):
        studio.bench.get("buses/nothing")


def scan(bench, bus):
    return bench.post(f"buses/{quote(bus, safe='')}/scan", {})["found"]


def test_a_scan_lists_what_answers_and_changes_nothing(line):
    can, ethercat, modbus = buses_of(line)
    studio = Studio(can, ethercat, modbus)
    try:
        wait_for(lambda: studio.bench.axis("ismc-1")["powered"], "ismc-1")
        (found,) = scan(studio.bench, can)
        assert (found["address"], found["product"], found["axis"]) == (1, "ismc", "ismc-1")
        assert found["kind"] == "servo drive (CiA 402)"
        (found,) = scan(studio.bench, ethercat)
        assert (found["address"], found["product"], found["axis"]) == (1, "jmc_ec", "jmc_ec-1")
        with pytest.raises(ApiError, match="a serial line is not scanned"):
            scan(studio.bench, modbus)
        studio.does("ismc-1", do="enable")
        with pytest.raises(ApiError, match="has torque") as refusal:
            scan(studio.bench, can)
        assert refusal.value.status == 409
        assert line.bench.axis("ismc")["state"] == "operation enabled"
        studio.does("ismc-1", do="disable")
        assert scan(studio.bench, can)
    finally:
        studio.stop()
    # Drives of a virtual line that have power.
    assert [each["axis"] for each in scan(line.bench, "can0")] == ["ismc"]
    line.bench.post("axes/ismc/power", {"action": "off"})
    assert scan(line.bench, "can0") == []
    assert [each["axis"] for each in scan(line.bench, "ecat")] == ["jmc"]
    station = line.bench.axis("reference")["serial"]["station"]
    assert [(each["axis"], each["address"]) for each in scan(line.bench, "rs")] == [("reference", station)]


@pytest.mark.parametrize("axis", NAMES)
def test_enables_homes_and_moves(studio, line, axis):
    patiently(lambda: enable_home_and_move(studio, line, axis))


def enable_home_and_move(studio, line, axis):
    wait_for(lambda: studio.bench.axis(axis)["powered"], axis)
    studio.does(axis, do="reset_fault")
    studio.does(axis, do="enable")
    wait_for(lambda: studio.bench.axis(axis)["state"] == "operation enabled", "the state")
    assert line.bench.axis(NAMES[axis])["state"] == "operation enabled"
    method = 24 if axis != "jmc_ec-1" else 7
    studio.does(axis, do="home", method=method, **turns(axis, speed=4, zero_speed=1, acceleration=20))
    before = line.bench.true_position(NAMES[axis])
    # The factory limit of the JMC is 216 rpm (607Fh); a higher demand is a fault (AL.420).
    job = studio.does(axis, do="move", **turns(axis, by=1.5, velocity=3, acceleration=20))
    turn = 4000 if axis == "jmc_ec-1" else COUNTS
    assert abs(line.bench.true_position(NAMES[axis]) - before - 1.5 * turn) < turn / 100, job
    studio.does(axis, do="disable")
    assert line.bench.axis(NAMES[axis])["state"] != "operation enabled"


@pytest.mark.parametrize("axis", NAMES)
def test_objects_states_and_faults(studio, line, axis):
    bench = studio.bench
    wait_for(lambda: bench.axis(axis)["powered"], axis)
    listed = {(entry["index"], entry["sub"]) for entry in bench.get(f"axes/{axis}/objects")["objects"]}
    assert ("0x6083", 0) in listed
    bench.put(f"axes/{axis}/objects/6083/0", {"value": 98765})
    assert bench.get(f"axes/{axis}/objects/6083/0")["value"] == 98765
    assert line.bench.get(f"axes/{NAMES[axis]}/objects/6083/0")["value"] == 98765
    with pytest.raises(ApiError) as refused:
        bench.put(f"axes/{axis}/objects/6041/0", {"value": 1})
    assert refused.value.status == 409
    for ask in (lambda path: bench.get(path), lambda path: bench.put(path, {"value": 1})):
        with pytest.raises(ApiError) as refused:
            ask(f"axes/{axis}/objects/5FFF/0")
        assert refused.value.status == 404 and refused.value.body["error"]["what"]
    states = bench.get(f"axes/{axis}/states")
    assert states["transitions"]
    # Over-voltage of the JMC (AL.402) needs a power cycle; over-speed does not.
    cause = "over_speed" if axis == "jmc_ec-1" else "over_voltage"
    line.bench.post(f"axes/{NAMES[axis]}/faults", {"inject": cause})
    wait_for(lambda: bench.axis(axis)["state"] == "fault", "the fault")
    active = bench.get(f"axes/{axis}/faults")["active"]
    assert active and active[0]["name"]
    line.bench.delete(f"axes/{NAMES[axis]}/faults")
    patiently(lambda: studio.does(axis, do="reset_fault"))


def text_call(studio, method, path, body=None):
    url = f"{studio.bench.url}/{path}"
    with urllib.request.urlopen(urllib.request.Request(url, body, method=method), timeout=120) as answer:
        return answer.read()


def test_an_answer_that_does_not_tell_its_size_is_read(studio, line):
    """CiA 301 7.2.4.3.6: an expedited answer may omit its length, which then is four bytes."""
    wait_for(lambda: studio.bench.axis("ismc-1")["powered"], "the drive")
    rule = '[[rule]]\nname = "r"\naxis = "ismc"\non = { message = "sdo_answer", object = "6041" }\ndo = "alter"\nbytes = "42 ?? ?? ?? ?? ?? 55 AA"\n'
    line.bench.post("scenario/rules", {"text": rule})
    assert studio.bench.get("axes/ismc-1/objects/6041/0")["value"] == line.bench.get("axes/ismc/objects/6041/0")["value"]
    assert line.bench.get("scenario/rules")["rules"][0]["acts"] > 0


@pytest.mark.parametrize("axis", NAMES)
def test_parameters_are_saved_compared_and_loaded(studio, line, axis):
    bench = studio.bench
    wait_for(lambda: bench.axis(axis)["powered"], axis)
    bench.put(f"axes/{axis}/objects/6083/0", {"value": 98765})
    saved = text_call(studio, "GET", f"axes/{axis}/parameters")
    assert b"98765" in saved
    assert json.loads(text_call(studio, "POST", f"axes/{axis}/parameters/diff", saved))["differences"] == []
    bench.put(f"axes/{axis}/objects/6083/0", {"value": 55555})
    rows = json.loads(text_call(studio, "POST", f"axes/{axis}/parameters/diff", saved))["differences"]
    assert [(row["object"], row["left"], row["right"]) for row in rows] == [("6083:00", "98765", "55555")]
    report = json.loads(text_call(studio, "PUT", f"axes/{axis}/parameters", saved))
    assert [row["object"] for row in report["written"]] == ["6083:00"] and not report["stored"]
    assert line.bench.get(f"axes/{NAMES[axis]}/objects/6083/0")["value"] == 98765
    factory = json.loads(text_call(studio, "GET", f"axes/{axis}/parameters/diff"))
    assert "6083:00" in [row["object"] for row in factory["differences"]]
    with pytest.raises(urllib.error.HTTPError) as refused:
        text_call(studio, "PUT", f"axes/{axis}/parameters", b"not such a text\n")
    assert refused.value.code == 400


def test_a_drive_that_does_not_say_what_a_revolution_is(studio):
    units = studio.bench.get("axes/ismc-1/units")  # it reports no factors and no resolution
    assert set(units.values()) == {None} and "position_per_revolution" in units
    assert studio.bench.get("axes/generic402/units")["position_per_revolution"] == COUNTS
    with pytest.raises(ApiError) as refused:
        studio.bench.post("axes/ismc-1/jobs", {"do": "move", "by": 1, "velocity": 1, "units": "revolutions"})
    assert refused.value.status == 409 and '"units": "drive"' in refused.value.body["error"]["hint"]


def test_what_needs_a_plant_is_refused(studio):
    for method, path in (
        ("PUT", "axes/ismc-1/plant"),
        ("GET", "axes/ismc-1/geometry"),
        ("PUT", "axes/ismc-1/inputs"),
        ("POST", "axes/ismc-1/power"),
        ("POST", "axes/ismc-1/faults"),
        ("POST", "clock/advance"),
    ):
        with pytest.raises(ApiError) as refused:
            studio.bench.call(method, path, {} if method != "GET" else None)
        assert refused.value.status == 409 and "simulated drives" in refused.value.body["error"]["what"], path
    with pytest.raises(ApiError) as refused:
        studio.bench.get("axes/nobody/states")
    assert refused.value.status == 404 and "ismc-1" in refused.value.body["error"]["hint"]


def test_the_big_stop_stops_all_axes(studio, line):
    for axis in NAMES:
        wait_for(lambda axis=axis: studio.bench.axis(axis)["powered"], axis)
        studio.does(axis, do="enable")
        studio.does(axis, do="velocity", **turns(axis, velocity=0.5, acceleration=5))
        wait_for(lambda axis=axis: abs(line.bench.axis(NAMES[axis])["velocity_rpm"]) > 20, f"{axis} turns")
    stopped = studio.bench.post("stop", {})["axes"]
    assert {row["name"]: row["stopped"] for row in stopped} == dict.fromkeys(NAMES, True)
    for name in NAMES.values():
        wait_for(lambda name=name: abs(line.bench.axis(name)["velocity_rpm"]) < 1, f"{name} at rest")


@pytest.mark.parametrize("rate_hz", [100, 1000])
def test_a_recording_waits_for_its_trigger(studio, line, rate_hz):
    """By reading objects, and by TPDOs."""
    axis = "ismc-1"
    wait_for(lambda: studio.bench.axis(axis)["powered"], axis)
    studio.does(axis, do="enable")
    recording = studio.bench.post(
        "recordings",
        {"channels": [{"axis": axis, "signal": "position_counts"}, {"axis": axis, "object": "606C:00"}],
         "rate_hz": rate_hz, "duration_ms": 3000, "pre_ms": 500, "trigger": {"kind": "edge", "channel": 1, "level": 1000}},
    )
    assert 1 <= recording["rate_hz"] <= rate_hz
    wait_for(lambda: studio.bench.get(f"recordings/{recording['id']}")["samples"] > 2, "samples before the trigger")
    assert studio.bench.get(f"recordings/{recording['id']}")["state"] == "armed"
    studio.does(axis, do="move", **turns(axis, by=2, velocity=1, acceleration=10))
    wait_for(lambda: studio.bench.get(f"recordings/{recording['id']}")["state"] == "done", "the recording")
    with studio_request(studio, f"recordings/{recording['id']}/data.csv") as rows:
        positions = [float(row.split(",")[2]) for row in rows[1:] if row.split(",")[2]]
    assert len(positions) > 5
    assert abs(positions[-1] - positions[0] - 2 * COUNTS) < COUNTS / 10
    assert all(b >= a - COUNTS / 100 for a, b in zip(positions, positions[1:]))
    with urllib.request.urlopen(f"{studio.bench.url}/recordings/{recording['id']}/data.mcap", timeout=60) as file:
        reader = make_reader(io.BytesIO(file.read()), validate_crcs=True)
    messages = list(reader.iter_messages())
    assert {channel.topic for _, channel, _ in messages} == {"/ismc-1"}
    fields = [json.loads(message.data) for _, _, message in messages]
    assert [row["position_counts"] for row in fields if row["position_counts"] is not None] == positions
    assert "velocity_actual_value_606C_00" in fields[0]
    assert abs(messages[-1][2].log_time / 1e9 - time.time()) < 3600


class studio_request:
    """The lines of a text."""

    def __init__(self, studio, path):
        self.url = f"{studio.bench.url}/{path}"

    def __enter__(self):
        with urllib.request.urlopen(self.url, timeout=60) as response:
            return response.read().decode().splitlines()

    def __exit__(self, *_):
        pass


def unplug_while_it_turns(studio, line, axis):
    wait_for(lambda: studio.bench.axis(axis)["powered"], axis)
    studio.does(axis, do="enable")
    studio.does(axis, do="velocity", **turns(axis, velocity=0.05, acceleration=1))
    line.bench.post("buses/can0/disturb", {"cut": True, "axis": NAMES[axis]})
    silent = wait_for(lambda: studio.bench.axis(axis).get("problem"), "the silence")
    assert silent["what"] and silent["hint"]
    with pytest.raises(ApiError) as refused:
        studio.job(axis, do="move", by=1)
    assert refused.value.status == 409


def watch_of(line, axis):
    return line.bench.get(f"axes/{NAMES[axis]}/objects/1016/1")["value"]


def test_a_drive_that_is_unplugged_stops_by_itself(line):
    axis = "ismc-1"
    before = watch_of(line, axis)
    studio = Studio(*buses_of(line))
    unplug_while_it_turns(studio, line, axis)
    studio.does("generic402", do="enable")  # the other jobs continue
    assert watch_of(line, axis) == 0x7F05DC
    wait_for(lambda: line.bench.axis("ismc")["state"] == "fault", "the loss, as the drive sees it")
    wait_for(lambda: abs(line.bench.axis("ismc")["velocity_rpm"]) < 0.5, "the axis at rest")
    line.bench.delete("buses/can0/disturb")
    wait_for(lambda: studio.bench.axis(axis)["powered"], "the drive")
    studio.does(axis, do="reset_fault")
    studio.does(axis, do="enable")
    # A reset ends the drive's monitoring of its master, so it is configured again.
    line.bench.post("axes/ismc/power", {"action": "off"})
    wait_for(lambda: studio.bench.axis(axis).get("problem"), "the silence")
    line.bench.post("axes/ismc/power", {"action": "on"})
    wait_for(lambda: studio.bench.axis(axis)["powered"] and watch_of(line, axis) == 0x7F05DC, "the watch")
    studio.stop()
    assert watch_of(line, axis) == before


def test_a_drive_that_is_not_watched_is_stopped_when_it_is_back(line):
    axis = "ismc-1"
    studio = Studio(*buses_of(line), options=["--no-watch"])
    unplug_while_it_turns(studio, line, axis)
    assert line.bench.axis("ismc")["state"] == "operation enabled"
    line.bench.delete("buses/can0/disturb")
    wait_for(lambda: studio.bench.axis(axis)["powered"], "the drive")
    wait_for(lambda: abs(line.bench.axis("ismc")["velocity_rpm"]) < 0.5, "the axis at rest")
    studio.stop()


def test_a_bus_goes_away_and_comes_back(tmp_path):
    line = start_line(tmp_path / "first")
    studio = Studio(*buses_of(line))
    for axis in NAMES:
        wait_for(lambda axis=axis: studio.bench.axis(axis)["powered"], axis)
        studio.does(axis, do="enable")
    running = [studio.job(axis, do="move", **turns(axis, by=5, velocity=0.2)) for axis in NAMES]
    links = [f"{name}={line.links[name][0]}" for name in ("can0", "ecat", "rs")]
    line.stop()
    for job in running:
        over = studio.over(job)
        assert over["state"] == "failed" and over["error"]["what"], over
    for axis in NAMES:
        wait_for(lambda axis=axis: studio.bench.axis(axis).get("problem"), axis)
    for row in studio.bench.post("stop", {})["axes"]:
        assert not row["stopped"] and row["error"]["what"], row
    line = start_line(tmp_path / "second", links)
    for axis in NAMES:
        wait_for(lambda axis=axis: studio.bench.axis(axis)["powered"], axis)
        studio.does(axis, do="enable")
    studio.stop()
    line.stop()


def test_axes_that_were_moved_from_here_are_stopped_at_the_end(line):
    studio = Studio(*buses_of(line))
    for axis in NAMES:
        wait_for(lambda axis=axis: studio.bench.axis(axis)["powered"], axis)
        studio.does(axis, do="enable")
        studio.does(axis, do="velocity", **turns(axis, velocity=0.5, acceleration=5))
    studio.stop()
    for name in NAMES.values():
        wait_for(lambda name=name: abs(line.bench.axis(name)["velocity_rpm"]) < 1, f"{name} at rest")
        assert line.bench.axis(name)["state"] != "operation enabled"


def test_wrong_use_is_said(line):
    can = buses_of(line)[0]
    assert "--bus" in servodrome("studio", status=2)
    assert "is not a drive number" in servodrome("studio", "--bus", f"{can}=x", status=2)
    assert "node 9 does not answer" in servodrome("studio", "--bus", f"{can}=1,9", status=1)
    assert "given twice" in servodrome("studio", "--bus", can, "--bus", can, status=2)
    servodrome("studio", "--bus", "socketcand:127.0.0.1:1/can0", status=1)


# A position on the segment is no name: with other cables another drive has it.
def test_another_slave_at_the_position_is_not_commanded(line, studio):
    bus = f"buses/{quote(buses_of(line)[1], safe='')}"
    wait_for(lambda: studio.bench.axis("jmc_ec-1")["powered"], "jmc_ec-1")
    rule = '[[rule]]\naxis = "jmc"\ndo = "sii"\nword = 10\nvalue = 7\n'  # of the product code
    line.bench.put("scenario", {"text": f'title = "another slave"\n{rule}'})
    line.bench.post("axes/jmc/power", {"action": "off"})
    wait_for(lambda: not studio.bench.get(bus)["connected"], "the loss of the bus", 30)
    line.bench.post("axes/jmc/power", {"action": "on"})
    wait_for(lambda: "another slave" in studio.bench.get(bus)["problem"]["what"], "the refusal", 30)
    with pytest.raises(ApiError, match="another slave"):
        studio.job("jmc_ec-1", do="enable")
    assert line.bench.axis("jmc")["state"] == "switch on disabled"
