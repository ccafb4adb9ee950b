"""Lines: how they are opened, their time, their end."""

import math
import pathlib
import pickle
import subprocess

import numpy
import pytest
import servodrome
from conftest import COUNTS, ROOT, axes

TICK_S = 62.5e-6
ONE_AXIS = '[[bus]]\nname = "can0"\n[[axis]]\nname = "x"\nproduct = "ismc"\n'


def test_the_built_in_line_has_five_drives():
    with servodrome.Line() as line:
        assert list(line.axes) == ["ismc", "reference", "pronet", "ismk", "jmc"]
        assert {name: bus.type for name, bus in line.buses.items()} == {"can0": "can", "rs485": "rs485", "ecat": "ethercat"}
        assert line.axes["jmc"].product == "jmc_ec"
        assert line.clock == "virtual"
        assert line.now == 0


def test_lines_of_the_repository_run_from_their_files():
    with servodrome.Line.from_file(ROOT / "lines/eight-axes.toml") as line:
        line.advance(0.1)
        assert len(line.axes) == 8
        assert line.now == 0.1


def test_a_line_from_text():
    with servodrome.Line.from_text(ONE_AXIS) as line:
        assert list(line.axes) == ["x"]


def test_a_store_is_relative_to_the_file(tmp_path):
    file = tmp_path / "cell.toml"
    file.write_text(ONE_AXIS + 'store = "x.bin"\n')
    for text in (None, file.read_text()):
        line = servodrome.Line.from_file(file) if text is None else servodrome.Line.from_text(text, name=str(file))
        with line:
            line.advance(0.1)
            line.axes["x"].objects["1010:01"] = 0x65766173  # "save"
            line.advance(1)
        assert (tmp_path / "x.bin").exists()
        (tmp_path / "x.bin").unlink()


# ---- Time ----


def test_time_passes_only_when_told(line):
    assert (line.now, line.now_ns, line.ticks) == (0, 0, 0)
    line.advance(0.1)
    assert (line.now, line.now_ns, line.ticks) == (0.1, 100_000_000, 1600)
    line.run_ticks(5)
    assert line.ticks == 1605
    line.run_until(0.25)
    assert line.now == 0.25
    line.advance(0)
    line.run_until(0.25)
    line.run_ticks(0)
    assert line.now_ns == 250_000_000
    line.advance(numpy.float32(0.5))
    line.run_ticks(numpy.int64(16))
    line.advance(1)
    assert line.now_ns == 1_751_000_000


def test_time_is_kept_in_nanoseconds(line):
    line.advance(1e-9)
    line.advance(1e-5)
    assert line.now_ns == 10_001
    assert line.ticks == 0
    line.run_ticks(1)  # to the next tick
    assert line.now_ns == 62_500


@pytest.mark.parametrize("wrong", [-1e-9, -1, math.nan, math.inf, -math.inf, 1e30, numpy.float64("nan")])
def test_a_time_that_is_none_is_refused(line, wrong):
    line.advance(1)
    for call in (line.advance, line.run_until):
        with pytest.raises(ValueError) as caught:
            call(wrong)
        assert isinstance(caught.value, servodrome.BadValue)
        assert caught.value.where and caught.value.hint
    assert line.now == 1


@pytest.mark.parametrize("wrong", ["1", None, [1], 1j, True])
def test_a_time_of_another_type_is_refused(line, wrong):
    for call in (line.advance, line.run_until, line.run_ticks):
        with pytest.raises(TypeError) as caught:
            call(wrong)
        assert isinstance(caught.value, servodrome.WrongType)
    assert line.now == 0


def test_the_past_is_refused(line):
    line.advance(1)
    with pytest.raises(servodrome.BadValue, match="0.5 s is in the past; it is 1 s"):
        line.run_until(0.5)
    with pytest.raises(servodrome.BadValue):
        line.run_ticks(-1)
    with pytest.raises(servodrome.BadValue):
        line.run_ticks(2**60)
    with pytest.raises(servodrome.WrongType):
        line.run_ticks(1.5)
    assert line.now == 1


def test_more_than_an_hour_at_once():
    with servodrome.Line(axes=[servodrome.Axis("x", "ismc")]) as line:
        line.advance(3601)  # a call of the C library takes an hour
        assert line.now == 3601
        line.run_ticks(3601 * 16000)
        assert line.now == 7202


def test_waiting_for_a_condition(line, x):
    x.objects["Modes of operation"] = 1
    begin = line.now
    assert line.wait_for(lambda: line.now_ns >= 10_000_000 and "there", what="it") == "there"
    assert line.now - begin == 0.01
    with pytest.raises(servodrome.Timeout, match="waited 0.5 s of line time for a miracle") as caught:
        line.wait_for(lambda: False, timeout=0.5, what="a miracle")
    assert isinstance(caught.value, TimeoutError)
    assert line.now == 0.51


# ---- Values ----


def test_positions_of_all_axes(line):
    positions = line.positions()
    assert positions.dtype == numpy.int64
    assert positions.tolist() == [2 * COUNTS, 0, 0]
    line.axes["y"].plant.position_counts = -5
    assert positions.tolist() == [2 * COUNTS, 0, 0]  # a copy
    assert line.positions().tolist() == [2 * COUNTS, -5, 0]


def test_reading_signals(line, x):
    signals = [x.signal("position_counts"), x.signal("supply_v"), x.signal("6064:00"), x.signal("DI2")]
    line.advance(1)
    # The encoder of the drive has errors of some arc seconds.
    assert line.read(signals) == [2 * COUNTS, pytest.approx(310, abs=1), pytest.approx(2 * COUNTS, abs=4), 0]
    assert line.read([]) == []
    with pytest.raises(servodrome.WrongType):
        line.read(["velocity_rpm"])
    with servodrome.Line(axes=axes()) as other, pytest.raises(servodrome.BadValue, match="another line"):
        other.read(signals)


# ---- Errors of the description ----


def test_errors_of_a_line_file_have_their_places(tmp_path):
    file = tmp_path / "cell.toml"
    file.write_text(ONE_AXIS + "nod = 3\n\n  [axis.travel]\n  low_stop = 'a'\n")
    with pytest.raises(servodrome.LineFileError) as caught:
        servodrome.Line.from_file(file)
    error = caught.value
    assert (error.file, error.line, error.column) == (str(file), 6, 1)
    assert error.what == "unknown key `nod` in axis"
    assert "node" in error.hint
    assert [(one.line, one.column) for one in error.diagnostics] == [(6, 1), (9, 14)]
    assert str(error).splitlines() == [
        f"{file}:6:1: unknown key `nod` in axis; {error.hint}",
        f"{file}:9:14: {error.diagnostics[1].what}; {error.diagnostics[1].hint}",
    ]
    again = pickle.loads(pickle.dumps(error))
    assert str(again) == str(error)


def test_a_file_that_cannot_be_read(tmp_path):
    for path in (tmp_path / "none.toml", tmp_path):
        with pytest.raises(servodrome.LineFileError, match="cannot be read") as caught:
            servodrome.Line.from_file(path)
        assert isinstance(caught.value.__cause__, OSError)
        assert caught.value.file == str(path)


@pytest.mark.parametrize("text", ["", "x", "[[axis]]", "\0", "\udcff", 'a = "\n', ONE_AXIS * 2])
def test_a_text_that_is_no_line(text):
    with pytest.raises(servodrome.LineFileError) as caught:
        servodrome.Line.from_text(text, name="some.toml")
    assert all(one.file == "some.toml" for one in caught.value.diagnostics)


def test_warnings_of_the_line_file():
    with servodrome.Line(axes=[servodrome.Axis("x", "ismc", motor={"rated_torque_nm": 9})]) as line:
        assert any("rated_torque_nm" in str(warning) for warning in line.warnings)
    with servodrome.Line() as line:
        assert line.warnings == []


def test_wrong_arguments():
    with pytest.raises(servodrome.BadValue, match="clock"):
        servodrome.Line(clock="imaginary")
    with pytest.raises(servodrome.WrongType):
        servodrome.Line(program="servodrome")
    with pytest.raises(servodrome.WrongType):
        servodrome.Line(links={"can0": "mem:"})
    with pytest.raises(servodrome.WrongType):
        servodrome.Line.from_text(b"")
    with pytest.raises(servodrome.WrongType):
        servodrome.Line(buses=[servodrome.Bus("can0")])


def test_unknown_names(line):
    for names, wrong in ((line.axes, "q"), (line.buses, "can1")):
        with pytest.raises(KeyError) as caught:
            names[wrong]
        assert isinstance(caught.value, servodrome.UnknownName)
        assert all(name in caught.value.hint for name in names)
        assert wrong not in names
        assert names.get(wrong) is None


# ---- The end ----


def test_a_closed_line_says_so(line, x):
    bus = line.buses["can0"]
    signal = x.signal("velocity_rpm")
    recording = line.record({"v": signal})
    assert not line.closed
    line.close()
    line.close()
    assert line.closed
    assert "closed" in repr(line)
    for use in (
        lambda: line.advance(1),
        lambda: line.run_until(1),
        lambda: line.run_ticks(1),
        lambda: line.now,
        lambda: line.positions(),
        lambda: line.read([signal]),
        lambda: line.record({"v": signal}),
        lambda: line.request("GET", "clock"),
        lambda: signal.value,
        lambda: x.position,
        lambda: x.state,
        lambda: x.enable(),
        lambda: x.objects["Statusword"],
        lambda: x.inputs["DI0"],
        lambda: x.plant.supply_v,
        lambda: x.signal("DI0"),
        lambda: bus.disturb(drop=1),
        lambda: bus.traffic.rows(),
    ):
        with pytest.raises(servodrome.Closed, match="the line is closed; use it before close"):
            use()
    assert recording.samples == 0  # a recording keeps its values


def test_the_with_block_closes():
    with servodrome.Line() as line:
        line.advance(0.01)
    assert line.closed


def test_an_axis_keeps_its_line():
    axis = servodrome.Line(axes=axes()).axes["x"]
    assert axis.position == 2 * COUNTS


def test_requests_of_the_bench_api(line):
    assert line.request("GET", "axes/x/geometry")["positive_stop"] == 11 * COUNTS
    with pytest.raises(servodrome.UnknownName, match="unknown address"):
        line.request("GET", "nothing")
    with pytest.raises(servodrome.WrongType, match="unknown key"):
        line.request("PUT", "axes/x/plant", {"load_torque": 1})
    with pytest.raises(servodrome.BadValue, match="method"):
        line.request("PATCH", "axes")


def test_the_version_is_that_of_the_build():
    version = subprocess.run([ROOT / "tools/version"], capture_output=True, text=True, check=True).stdout
    release = version.split("+")[0].strip()
    assert servodrome.library_version().split("+")[0] == release


def test_every_public_name_is_documented():
    for name in set(servodrome.__all__) - {"ObjectKey", "ObjectValue"}:  # aliases of types have no docstring
        assert getattr(servodrome, name).__doc__, name


def test_the_package_is_typed():
    assert (pathlib.Path(servodrome.__file__).parent / "py.typed").exists()
