"""`servodrome scope` on the line's CAN bus and on its serial lines: its output, and files that other programs read."""

import csv
import json
import os
import shutil
import signal
import subprocess
import xml.etree.ElementTree

import pytest
from line import COUNTS, PROGRAM, servodrome, wait_for
from mcap.reader import make_reader

pytestmark = [pytest.mark.once, pytest.mark.program("the program is the master")]  # independent of the link


@pytest.fixture
def scope(line):
    """scope(ARGUMENT, ...): a recording of the reference drive over CAN."""
    link = line.links["can0"][0]
    return lambda *arguments, **options: servodrome("scope", "--bus", link, "--node", "2", *arguments, **options)


MOVE = ["--do", "units revolutions", "--do", "enable", "--do", "move by 1 velocity 4", "--do", "wait 0.2"]


def dots_of(text):
    return [character for character in text if "\u2801" <= character <= "\u28ff"]


def rows_of(file):
    with open(file, newline="") as text:
        return list(csv.DictReader(text))


def test_a_script_knows_the_objects_of_its_product(scope, tmp_path):
    script = tmp_path / "own.script"
    checks = 'set 2020:02 15\nexpect 2020:02 == 15\nget "Brake engage delay"\n'
    script.write_text("axis reference 2 product generic402\n" + checks)
    said = scope("position", "--run", str(script))
    assert "15" in said.splitlines()[0], said
    lines = [word for line in checks.splitlines() for word in ("--do", line)]
    assert "15" in scope("position", "--product", "generic402", *lines).splitlines()[0]
    script.write_text("axis reference 2 product generic403\n")
    assert "generic403" in scope("position", "--run", str(script), status=2)


def test_what_it_prints(scope):
    said = scope("position", "statusword", "--seconds", "0.3")
    assert "node 2: " in said and "samples of 2 channels" in said and "TPDOs on SYNC" in said, said
    assert "position_actual_value" in said and "statusword" in said
    assert not dots_of(said), "no plot in a pipe"
    assert dots_of(scope("position", "--seconds", "0.2", "--plot"))


def test_a_move_as_csv_mcap_and_svg(scope, bench, tmp_path):
    files = [tmp_path / f"move.{ending}" for ending in ("csv", "mcap", "svg")]
    outputs = [word for file in files for word in ("-o", file)]
    before = bench.get("axes/reference/objects/6064/0")["value"]
    result = json.loads(scope("position", "velocity", "statusword", "--json", "--disable", *MOVE, *outputs))
    assert result["files"] == [str(file) for file in files]
    assert result["problems"] == [] and result["way"] == "TPDOs on SYNC"
    step = result["channels"][0]["step"]
    assert abs(step["to"] - step["from"] - COUNTS) < COUNTS / 100

    rows = rows_of(files[0])
    assert len(rows) == result["rows"] > 50
    assert list(rows[0]) == ["seconds", "position_actual_value [pos]", "velocity_actual_value [vel]", "statusword"]
    seconds = [float(row["seconds"]) for row in rows]
    assert seconds == sorted(set(seconds)) and seconds[0] == 0
    positions = [int(row["position_actual_value [pos]"]) for row in rows]
    assert abs(positions[0] - before) < 100 and abs(positions[-1] - before - COUNTS) < 100
    # The drive's velocity must match the change of its positions.
    moved = sum(
        float(row["velocity_actual_value [vel]"]) * (after - now)
        for row, now, after in zip(rows, seconds, seconds[1:])
    )
    assert abs(moved - COUNTS) < COUNTS / 10

    with open(files[1], "rb") as file:
        reader = make_reader(file, validate_crcs=True)
        assert reader.get_summary().statistics.message_count == len(rows)
        messages = list(reader.iter_messages())
    assert {channel.topic for _, channel, _ in messages} == {"/scope"}
    assert [json.loads(message.data)["position_actual_value"] for _, _, message in messages] == positions
    start = messages[0][2].log_time
    assert [round((message.log_time - start) / 1e9, 6) for _, _, message in messages] == [round(at, 6) for at in seconds]
    assert json.loads(messages[0][0].data)["properties"]["statusword"]["type"] == "number"

    svg = xml.etree.ElementTree.parse(files[2]).getroot()
    if pictures := os.environ.get("SERVODROME_PICTURES"):
        shutil.copy(files[2], f"{pictures}/scope-move.svg")
    texts = {text.text for text in svg.iter("{http://www.w3.org/2000/svg}text")}
    assert {"position_actual_value", "velocity_actual_value", "statusword", "seconds"} <= texts
    assert len(list(svg.iter("{http://www.w3.org/2000/svg}polyline"))) >= 3


def test_the_trigger_and_what_was_before_it(scope, tmp_path):
    file = tmp_path / "part.csv"
    start = int(json.loads(scope("6064", "--seconds", "0.05", "--json"))["channels"][0]["values"][0])
    scope("position", "--trigger", f"position_actual rises {start + COUNTS // 2}", "--pre", "0.1", "--seconds", "0.1", *MOVE, "-o", file)
    rows = rows_of(file)
    before = [int(row["position_actual_value [pos]"]) for row in rows if float(row["seconds"]) < 0]
    after = [int(row["position_actual_value [pos]"]) for row in rows if float(row["seconds"]) >= 0]
    assert max(before) < start + COUNTS // 2 <= min(after)
    assert -0.101 < float(rows[0]["seconds"]) < -0.05


def test_another_program_moves_the_axis(scope, line):
    link = line.links["can0"][0]
    command = [PROGRAM, "scope", "--bus", link, "--node", "2", "position", "--json", "--trigger", "fault", "--pre", "1", "--seconds", "0.2"]
    recording = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    servodrome("move", "--bus", link, "--node", "2", "--by", "65536")
    line.bench.post("axes/reference/faults", {"inject": "over_voltage"})
    said, _ = recording.communicate(timeout=90)
    result = json.loads(said)
    assert result["triggered"] and recording.returncode == 0, said
    word = next(channel for channel in result["channels"] if channel["name"] == "statusword")
    assert not int(word["values"][0]) & 8 and int(word["values"][-1]) & 8


def test_pdos_are_put_back(scope, line):
    def set_up():
        return [
            line.bench.get(f"axes/reference/objects/{index:X}/{sub}")["value"]
            for index in (0x1800, 0x1801, 0x1A00, 0x1A01)
            for sub in (0, 1, 2)
        ]

    before = set_up()
    scope("position", "velocity", "torque", "--seconds", "0.1")
    assert set_up() == before


def test_ctrl_c_keeps_what_there_is(line, tmp_path):
    file = tmp_path / "kept.csv"
    command = [PROGRAM, "scope", "--bus", line.links["can0"][0], "--node", "2", "position", "--seconds", "600", "-o", file]
    recording = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    sync = line.bench
    wait_for(lambda: sync.get("axes/reference/objects/1A00/1")["value"] >> 16 == 0x6064, "the mapping")
    sync.put("buses/can0/traffic", {"record": True})
    wait_for(lambda: len(sync.get("buses/can0/traffic?kind=pdo&limit=100")["rows"]) >= 20, "samples")
    assert recording.poll() is None
    recording.send_signal(signal.SIGINT)
    said, _ = recording.communicate(timeout=60)
    assert recording.returncode == 0 and f"written: {file}" in said
    assert len(rows_of(file)) > 1
    assert sync.get("axes/reference/objects/1A00/1")["value"] >> 16 != 0x6064


def test_wrong_use_is_told_before_anything_is_done(scope, tmp_path):
    assert ".csv, .mcap or .svg" in scope("position", "-o", tmp_path / "a.xlsx", status=2)
    assert "cannot be written" in scope("position", "-o", tmp_path / "no" / "a.csv", status=2)
    assert "write CHANNEL" in scope("position", "--trigger", "position", status=2)
    assert "pozition" in scope("pozition", status=2)
    assert "give a lower rate" in scope("position", "--rate", "2000", status=1)
    assert "neither a command nor an axis" in scope("position", "--do", "mvoe by 3", status=2)
    assert "5FFF:00" in scope("5FFF", status=1)
    assert "did not occur within" in scope("position", "--trigger", "position > 2147483646", "--timeout", "0.3", status=1)
    assert [path.name for path in tmp_path.iterdir()] == ["line0"], "the line's own folder"


def test_a_full_disk_is_told_and_leaves_no_cut_file(scope, tmp_path):
    full = tmp_path / "full.csv"
    full.symlink_to("/dev/full")
    assert "cannot be written" in scope("position", "--seconds", "0.1", "-o", full, status=1)
    assert {path.name for path in tmp_path.iterdir()} == {"line0", "full.csv"}


def test_a_drive_that_loses_its_supply_ends_it_with_what_there_is(line, tmp_path):
    file = tmp_path / "until.csv"
    command = [PROGRAM, "scope", "--bus", line.links["can0"][0], "--node", "2", "position", "--seconds", "600", "-o", file]
    recording = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    wait_for(lambda: line.bench.get("axes/reference/objects/1A00/1")["value"] >> 16 == 0x6064, "the mapping")
    with pytest.raises(subprocess.TimeoutExpired):
        recording.wait(0.5)
    line.bench.post("axes/reference/power", {"action": "off"})
    said, problem = recording.communicate(timeout=90)
    assert recording.returncode == 1
    assert "node 2" in problem and "PDOs" in problem, problem
    assert len(rows_of(file)) > 1
