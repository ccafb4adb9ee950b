"""Recordings, and that equal runs give equal bits."""

import csv
import math
import subprocess
import sys
from array import array

import numpy
import pandas
import pytest
import servodrome
from conftest import axes


@pytest.fixture
def moved(line, x):
    """A recording of a move, stopped."""
    line.advance(0.5)
    x.enable()
    with line.record({"v": x.signal("velocity_rpm"), "p": x.signal("6064:00")}, rate=4000) as recording:
        x.move(by=1, velocity=5, acceleration=100, units="revolutions")
    return recording


def table(path):
    with open(path, newline="", encoding="utf-8") as file:
        return list(csv.reader(file))


def test_columns_and_times(moved, x, line):
    time = moved.time
    assert time.dtype == moved["v"].dtype == numpy.float64
    assert len(time) == moved.samples == len(moved["v"]) == len(moved["p"])
    assert numpy.array_equal(moved.ticks % 4, numpy.zeros(len(time)))
    assert numpy.array_equal(time, moved.ticks / 16000)
    assert time[-1] == line.ticks // 4 * 4 / 16000
    assert numpy.all(numpy.diff(moved.ticks) == 4)
    assert moved["v"].max() == pytest.approx(300, rel=0.02)
    assert moved["p"][-1] == x.objects[0x6064]
    assert moved.numpy().shape == (moved.samples, 2)
    assert numpy.array_equal(moved.numpy()[:, 1], moved["p"])
    assert list(moved) == ["v", "p"] and len(moved) == 2 and "v" in moved and "q" not in moved
    assert moved.rate == 4000
    assert not moved.is_full
    assert repr(moved) == "<recording of v, p at 4000 Hz>"
    assert moved.signals["v"].name == "velocity_rpm"


def test_a_stopped_recording_keeps_its_values(moved, line):
    before = moved.samples
    line.advance(1)
    assert moved.stop() is moved
    assert moved.samples == before
    line.close()
    assert len(moved["v"]) == before
    values = moved["v"].tolist()
    column, matrix = moved["v"], moved.numpy()
    column += 1
    matrix += 1
    assert moved["v"].tolist() == moved.numpy()[:, 0].tolist() == values  # those were copies


def test_values_so_far(line, x):
    recording = line.record({"p": x.signal("position_counts")}, rate=16000)
    assert recording.samples == 0 and len(recording["p"]) == 0 and recording.numpy().shape == (0, 1)
    line.run_ticks(10)
    assert recording.ticks.tolist() == list(range(1, 11))
    early = recording["p"]
    line.run_ticks(10)
    assert recording.samples == 20
    assert len(early) == 10
    assert recording.numpy().shape == (20, 1)


def test_closing_the_line_keeps_the_values(x, line):
    recording = line.record({"p": x.signal("position_counts")}, rate=16000)
    line.run_ticks(10)
    line.close()
    assert recording.samples == 10
    recording.stop()


def test_a_value_is_that_of_its_tick(line, x):
    line.advance(0.5)
    x.enable()
    x.velocity(2, units="revolutions", wait=False)
    velocity = x.signal("velocity_rpm")
    with line.record({"v": velocity}, rate=16000) as recording:
        seen = []
        for _ in range(200):
            line.run_ticks(1)
            seen.append(velocity.value)
    assert recording["v"].tolist() == seen
    assert len(set(seen)) > 50


def test_without_power_there_is_no_number(line, x, tmp_path):
    x.power("off")
    with line.record({"word": x.signal("statusword"), "p": x.signal("position_counts")}, rate=1000) as recording:
        line.advance(0.002)
    assert math.isnan(recording["word"][0]) and not math.isnan(recording["p"][0])
    recording.to_csv(tmp_path / "a.csv")
    rows = table(tmp_path / "a.csv")
    assert rows[0] == ["time_s", "word", "p"]
    assert rows[1] == ["0.001", "", "262144.0"]
    assert len(rows) == 3


def test_many_channels(line):
    wanted = {}
    for name, axis in line.axes.items():
        for signal in ("position_counts", "velocity_rpm", "torque_nm", "current_a", "supply_v", "state", "temperature_c"):
            wanted[f"{name}.{signal}"] = axis.signal(signal)
    assert len(wanted) == 21
    with line.record(wanted) as recording:
        line.advance(1)
    assert recording.numpy().shape == (1000, 21)
    assert recording.rate == 1000


# ---- Other forms ----


def test_a_data_frame(moved):
    frame = moved.to_pandas()
    assert list(frame.columns) == ["v", "p"]
    assert frame.index.name == "time_s"
    assert numpy.array_equal(frame.index.to_numpy(), moved.time)
    assert numpy.array_equal(frame["v"].to_numpy(), moved["v"])


def test_a_parquet_file(moved, tmp_path):
    moved.to_parquet(tmp_path / "a.parquet")
    frame = pandas.read_parquet(tmp_path / "a.parquet")
    assert list(frame.columns) == ["time_s", "v", "p"]
    assert numpy.array_equal(frame["p"].to_numpy(), moved["p"])


def test_a_table_has_every_bit(moved, tmp_path):
    moved.to_csv(str(tmp_path / "a.csv"))
    head, *rows = table(tmp_path / "a.csv")
    assert head == ["time_s", "v", "p"]
    assert [float(row[0]) for row in rows] == moved.time.tolist()
    assert [float(row[1]) for row in rows] == moved["v"].tolist()


def test_columns_of_the_standard_library(moved):
    columns = moved.columns()
    assert list(columns) == ["time_s", "v", "p"]
    assert all(isinstance(column, array) for column in columns.values())
    assert columns["v"].tolist() == moved["v"].tolist()
    assert columns["time_s"].tolist() == moved.time.tolist()


WITHOUT = """
import sys
sys.modules["numpy"] = sys.modules["pandas"] = None
import servodrome
with servodrome.Line() as line:
    x = line.axes["reference"]
    with line.record({"v": x.signal("velocity_rpm")}) as recording:
        line.advance(0.01)
    assert len(recording.columns()["v"]) == 10
    recording.to_csv(sys.argv[1])
    assert line.read([x.signal("position_counts")]) == [0]
    for use in (lambda: recording["v"], lambda: recording.time, recording.numpy, line.positions, recording.to_pandas):
        try:
            use()
        except servodrome.MissingPackage as error:
            assert isinstance(error, ImportError) and "pip install" in error.hint, error
        else:
            raise AssertionError(use)
print("done")
"""


def test_without_numpy(tmp_path):
    environment = {"PYTHONPATH": str(servodrome.__path__[0] + "/.."), **__import__("os").environ}
    result = subprocess.run(
        [sys.executable, "-c", WITHOUT, str(tmp_path / "a.csv")], capture_output=True, text=True, env=environment, timeout=120
    )
    assert (result.stdout, result.returncode) == ("done\n", 0), result.stderr


# ---- Wrong use ----


@pytest.mark.parametrize("rate", [0, -1, 0.5, 16001, 7000, 15999, math.nan, math.inf])
def test_rates_that_are_no_whole_number_of_ticks(line, x, rate):
    with pytest.raises(servodrome.BadValue) as caught:
        line.record({"v": x.signal("velocity_rpm")}, rate=rate)
    assert caught.value.where == "rate" and "16000" in caught.value.hint


@pytest.mark.parametrize(
    "rate, stride", [(16000, 1), (1, 16000), (16000 / 3, 3), (numpy.float64(2000), 8), (16000 / 7001, 7001)]
)
def test_rates(line, x, rate, stride):
    recording = line.record({"v": x.signal("velocity_rpm")}, rate=rate)
    line.run_ticks(2 * stride)
    assert recording.ticks.tolist() == [stride, 2 * stride]
    assert recording.rate == pytest.approx(rate, rel=1e-12)


@pytest.mark.parametrize("signals", [{}, None, ["velocity_rpm"], {"v": "velocity_rpm"}, 5])
def test_what_is_no_signal(line, signals):
    with pytest.raises(servodrome.WrongType):
        line.record(signals)


def test_wrong_rate_type(line, x):
    for rate in ("1000", None, True):
        with pytest.raises(servodrome.WrongType):
            line.record({"v": x.signal("velocity_rpm")}, rate=rate)


def test_unknown_columns(moved):
    with pytest.raises(servodrome.UnknownName, match="the columns are v, p"):
        moved["q"]
    assert moved.get("q") is None


# ---- Equal runs give equal bits ----


def run(pieces):
    """The recording of a run with motions, a fault and a disturbed bus; `pieces(line, seconds)` advances it."""
    with servodrome.Line(axes=axes()) as line:
        x, y = line.axes["x"], line.axes["y"]
        wanted = {}
        for axis in (x, y):
            for name in ("position_counts", "velocity_rpm", "torque_nm", "current_a", "temperature_c", "supply_v", "state"):
                wanted[f"{axis.name}.{name}"] = axis.signal(name)
        with line.record(wanted, rate=16000) as recording:
            pieces(line, 0.5)
            line.buses["can0"].disturb(drop=0.3, seed=7)
            x.enable()
            y.enable()
            x.plant.load_torque_nm = 0.3
            y.velocity(3, units="revolutions")
            x.move(by=2, velocity=4, acceleration=30, units="revolutions", wait=False)
            pieces(line, 0.3)
            x.inject("encoder_loss")
            pieces(line, 0.7)
        assert x.state is servodrome.PowerState.FAULT
        assert y.position > 100000
        return recording.numpy().tobytes()


def whole(line, seconds):
    line.advance(seconds)


def in_ticks(line, seconds):
    for _ in range(round(seconds * 16000)):
        line.run_ticks(1)


def uneven(line, seconds):
    end = line.now_ns + round(seconds * 1e9)
    step = 1
    while line.now_ns < end:
        line.run_until(min(end, line.now_ns + step) / 1e9)
        step = step * 3 % 2_000_003 + 1


def test_equal_runs_give_equal_bits():
    first = run(whole)
    assert len(first) > 16000 * 14 * 8
    assert run(whole) == first


@pytest.mark.parametrize("pieces", [in_ticks, uneven])
def test_the_pieces_of_time_do_not_matter(pieces):
    assert run(pieces) == run(whole)
