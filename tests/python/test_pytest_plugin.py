"""The pytest plugin: the fixtures of a test, and the files that it writes."""

import importlib.metadata
import os
import pathlib
import re
import subprocess
import sys
import xml.etree.ElementTree as xml

import pytest
import servodrome
import servodrome._test_report as test_report  # before pytester, which unloads later imports

pytest_plugins = "pytester"

# An installed package has the entry point; the package in python/ is named explicitly.
POINTS = importlib.metadata.entry_points()
OURS = POINTS.select(group="pytest11") if hasattr(POINTS, "select") else POINTS.get("pytest11", ())  # Python 3.9 has no select
INSTALLED = any(point.value == "servodrome.pytest_plugin" for point in OURS)
PLUGIN = () if INSTALLED else ("-p", "servodrome.pytest_plugin")
CELL = '[[bus]]\nname = "can0"\n\n[[axis]]\nname = "shuttle"\nproduct = "generic402"\nnode = 2\n'
FAILS = """
    def test_fails(servodrome_line):
        x = servodrome_line.axes["reference"]
        x.enable()
        x.move(by=1, velocity=5, units="revolutions")
        x.inject("encoder_loss")
        servodrome_line.advance(0.2)
        print("ENDS AT", servodrome_line.now_ns, x.position)
        assert False
"""


@pytest.fixture
def run(pytester, monkeypatch):
    """Runs pytest in the folder of the test, in this process."""
    monkeypatch.delenv("PYTEST_ADDOPTS", raising=False)

    def runs(*arguments):
        return pytester.runpytest_inprocess(*PLUGIN, "-p", "no:cacheprovider", *arguments)

    return runs


@pytest.fixture
def run_apart(pytester, monkeypatch):
    """Runs pytest in a process of its own."""
    folder = str(pathlib.Path(servodrome.__file__).parents[1])
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(filter(None, [folder, os.environ.get("PYTHONPATH")])))

    def runs(*arguments):
        return pytester.runpytest_subprocess(*PLUGIN, "-p", "no:cacheprovider", *arguments)

    return runs


def reports(pytester):
    """Returns the folders that were written."""
    folder = pytester.path / "servodrome-reports"
    return sorted(path.name for path in folder.iterdir()) if folder.exists() else []


def test_a_passed_test_leaves_nothing(pytester, run):
    pytester.makepyfile(
        """
        def test_moves(servodrome_line):
            assert servodrome_line.clock == "virtual" and servodrome_line.now == 0
            assert list(servodrome_line.axes) == ["ismc", "reference", "pronet", "ismk", "jmc"]
            servodrome_line.advance(1)
        """
    )
    before = sorted(pytester.path.iterdir())
    run("--strict-markers").assert_outcomes(passed=1)
    assert sorted(path for path in pytester.path.iterdir() if path.name != "__pycache__") == before


def test_a_failed_test_has_captures_and_pictures(pytester, run):
    pytester.makepyfile(test_cell=FAILS)
    result = run()
    result.assert_outcomes(failed=1)
    assert reports(pytester) == ["test_cell-test_fails"]
    folder = pytester.path / "servodrome-reports" / "test_cell-test_fails"
    result.stdout.fnmatch_lines(
        ["*test_cell-test_fails has can0.candump.log, *reference.svg, replay.py, *", "*reference: * fault*"]
    )
    names = ["can0.candump.log", "can0.pcap", "ecat.pcap", "ismc.svg", "ismk.svg", "jmc.svg", "pronet.svg", "reference.svg"]
    assert sorted(path.name for path in folder.iterdir()) == [*names, "replay.py", "rs485.pcapng", "rs485.txt"]
    assert "702#00" in (folder / "can0.candump.log").read_text(), "the boot-up of node 2"
    assert (folder / "can0.pcap").read_bytes()[:4] in (b"\xd4\xc3\xb2\xa1", b"\x4d\x3c\xb2\xa1")
    for axis in ("ismc", "reference", "jmc"):
        picture = xml.parse(folder / f"{axis}.svg").getroot()
        text = "".join(picture.itertext())
        assert picture.tag == "{http://www.w3.org/2000/svg}svg" and f"axis {axis}, line time" in text
        assert len(picture.findall("{http://www.w3.org/2000/svg}polyline")) == 3
    text = "".join(xml.parse(folder / "reference.svg").getroot().itertext())
    assert "operation enabled" in text and "fault" in text
    assert all((folder / name).stat().st_size < 100_000 for name in names if name.endswith("svg"))


def test_replay_repeats_the_requests(pytester, run):
    pytester.makepyfile(test_cell=FAILS)
    result = run()
    ends = next(line for line in result.outlines if line.startswith("ENDS AT")).split()
    script = pytester.path / "servodrome-reports/test_cell-test_fails/replay.py"
    package = str(pathlib.Path(servodrome.__file__).parents[1])
    environment = {**os.environ, "PYTHONPATH": package}
    output = subprocess.run([sys.executable, script], env=environment, check=True, capture_output=True, text=True).stdout
    lines = output.splitlines()
    assert lines[0] == f"{int(ends[2]) / 1e9:.6f} s"
    assert f"reference: {ends[3]} counts, fault" in lines
    assert abs(int(ends[3])) > 100_000, "the axis has moved"


def test_a_script_has_the_first_actions_of_a_long_test(pytester, run, monkeypatch):
    monkeypatch.setattr(test_report, "_MOST_ACTIONS", 3)
    pytester.makepyfile(
        """
        def test_it(servodrome_line):
            x = servodrome_line.axes["reference"]
            for number in range(10):
                x.plant.load_torque_nm = number / 100
                servodrome_line.advance(0.25)
            assert False
        """
    )
    result = run()
    result.stdout.fnmatch_lines(["*replay.py ends at 0.750000 s*"])
    script = next((pytester.path / "servodrome-reports").glob("*/replay.py")).read_text()
    assert script.count("load_torque_nm") == 3 and "END_NS = 750000000" in script


def test_a_later_pass_deletes_the_files(pytester, run):
    pytester.makepyfile("import os\ndef test_it(servodrome_line):\n    assert os.path.exists('good')\n")
    run().assert_outcomes(failed=1)
    assert len(reports(pytester)) == 1
    (pytester.path / "good").touch()
    run().assert_outcomes(passed=1)
    assert reports(pytester) == []


def test_a_failed_setup_has_files_as_well(pytester, run):
    pytester.makepyfile(
        """
        import pytest

        @pytest.fixture
        def machine(servodrome_line):
            raise ValueError("not today")

        def test_it(machine):
            pass
        """
    )
    run().assert_outcomes(errors=1)
    assert len(reports(pytester)) == 1


def test_a_line_that_the_test_has_closed(pytester, run):
    pytester.makepyfile("def test_it(servodrome_line):\n    servodrome_line.close()\n    assert False\n")
    result = run()
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(["*can0.pcap: the line is closed*"])


def test_options_for_the_files(pytester, run):
    pytester.makepyfile(
        test_a="""
        import pytest

        @pytest.mark.servodrome(record=False)
        def test_without(servodrome_line):
            assert False

        @pytest.mark.parametrize("what", ["a/b", "a b"])
        def test_kept(servodrome_line, what):
            pass
        """
    )
    run("--servodrome-keep", "--servodrome-reports=out").assert_outcomes(passed=2, failed=1)
    folders = sorted((pytester.path / "out").iterdir())
    assert len(folders) == 3 and len({folder.name[-8:] for folder in folders}) == 3
    assert [path.name for path in (pytester.path / "out/test_a-test_without").iterdir()] == ["replay.py"]


def test_forms_of_the_marker(pytester, run):
    pytester.mkdir("sub").joinpath("cell.toml").write_text(CELL)
    pytester.path.joinpath("sub/test_forms.py").write_text(
        f"""
import pytest
from servodrome import Axis, Bus

pytestmark = pytest.mark.servodrome(file="cell.toml", record=False)

def test_file(servodrome_line):
    assert list(servodrome_line.axes) == ["shuttle"]

@pytest.mark.servodrome(text='''{CELL}'''.replace("shuttle", "other"))
def test_text(servodrome_line):
    assert list(servodrome_line.axes) == ["other"]

@pytest.mark.servodrome(axes=[Axis("a", "jmc_ec"), Axis("b", "generic402", node=7)])
class TestAxes:
    def test_axes(self, servodrome_line):
        assert list(servodrome_line.axes) == ["a", "b"] and set(servodrome_line.buses) == {{"ecat", "can0"}}

    @pytest.mark.servodrome(axes=[Axis("c", "ismc", bus="field")], buses=[Bus("field")])
    def test_the_closest_wins(self, servodrome_line):
        assert list(servodrome_line.axes) == ["c"] and list(servodrome_line.buses) == ["field"]
"""
    )
    run("--strict-markers").assert_outcomes(passed=4)


def test_the_line_of_an_option(pytester, run):
    pytester.path.joinpath("cell.toml").write_text(CELL)
    pytester.path.joinpath("other.toml").write_text(CELL.replace("shuttle", "other"))
    pytester.makepyfile("def test_it(servodrome_line):\n    assert list(servodrome_line.axes) == ['shuttle']\n")
    run("--servodrome-line=cell.toml").assert_outcomes(passed=1)
    pytester.makeini("[pytest]\nservodrome_line = cell.toml\n")
    run().assert_outcomes(passed=1)
    run("--servodrome-line=other.toml").assert_outcomes(failed=1)


@pytest.mark.parametrize(
    "marker, text",
    [
        ('file="cell.toml"', "*cell.toml:6:11: *generic403*"),
        ('file="missing.toml"', "*missing.toml: cannot be read*"),
        ('text="[[bus]]\\nnam = 1"', "*line.toml:2:1: *"),
        ('fil="cell.toml"', "*'fil' is not a key*file, text, axes*"),
        ('"cell.toml"', "*'cell.toml' is not a key*"),
        ('file="cell.toml", text="a"', "*one of file=, text=, axes=*"),
        ('clock="fast"', "*clock is 'fast'*"),
    ],
)
def test_mistakes(pytester, run, marker, text):
    pytester.path.joinpath("cell.toml").write_text(CELL.replace("generic402", "generic403"))
    pytester.makepyfile(
        f"import pytest\n@pytest.mark.servodrome({marker})\ndef test_it(servodrome_line):\n    assert False, 'not reached'\n"
    )
    result = run()
    result.assert_outcomes(errors=1)
    result.stdout.fnmatch_lines([text])
    assert reports(pytester) == [] and "Traceback" not in result.stdout.str()


def test_several_processes(pytester, run_apart):
    pytest.importorskip("xdist")
    pytester.makepyfile(
        test_many="""
        import os
        import pytest

        @pytest.mark.parametrize("number", range(6))
        def test_it(servodrome_line, number):
            servodrome_line.advance(0.1)
            assert "PYTEST_XDIST_WORKER" in os.environ and number != 3
        """
    )
    run_apart("-n", "2").assert_outcomes(passed=5, failed=1)
    assert reports(pytester) == ["test_many-test_it[3]"]


def test_real_time(pytester, run, program, monkeypatch):
    monkeypatch.setenv("SERVODROME", program)
    pytester.makepyfile(
        test_real="""
        import pytest

        def test_option(servodrome_line):
            assert servodrome_line.clock == "real" and "socketcand" in servodrome_line.buses["can0"].link

        @pytest.mark.servodrome(clock="real")
        def test_marker(servodrome_line):
            assert servodrome_line.clock == "real"
            servodrome_line.axes["reference"].objects["1017:00"] = 10  # heartbeat, ms
            servodrome_line.axes["reference"].enable()
            servodrome_line.advance(0.2)
            assert False
        """
    )
    run("--servodrome-real").assert_outcomes(passed=1, failed=1)
    folder = pytester.path / "servodrome-reports/test_real-test_marker"
    assert "operation enabled" in "".join(xml.parse(folder / "reference.svg").getroot().itertext())
    assert "702#7F" in (folder / "can0.candump.log").read_text()
    result = run()
    result.assert_outcomes(failed=2)
    result.stdout.fnmatch_lines(["*'virtual' == 'real'*"])


def test_a_picture_has_the_last_second(pytester, run, program, monkeypatch):
    monkeypatch.setenv("SERVODROME", program)
    pytester.makepyfile(
        """
        import pytest

        @pytest.mark.parametrize("clock", ["virtual", pytest.param("real", marks=pytest.mark.servodrome(clock="real"))])
        def test_it(servodrome_line, clock):
            servodrome_line.advance(1.5)
            assert servodrome_line.clock != clock
        """
    )
    run().assert_outcomes(failed=2)
    pictures = sorted((pytester.path / "servodrome-reports").glob("*/reference.svg"))
    texts = ["".join(xml.parse(picture).getroot().itertext()) for picture in pictures]
    times = [[float(word) for word in re.search(r"time (\S+) s to (\S+) s", text).groups()] for text in texts]
    assert len(times) == 2 and [0.501, 1.5] in times
    assert all(end >= 1.4 and end - begin == pytest.approx(1, abs=0.01) for begin, end in times)


def test_without_the_library(pytester, run_apart, monkeypatch):
    monkeypatch.setenv("SERVODROME_LIBRARY", str(pytester.path / "missing.so"))
    pytester.makepyfile("def test_other():\n    pass\ndef test_line(servodrome_line):\n    pass\n")
    result = run_apart()
    result.assert_outcomes(passed=1, errors=1)
    result.stdout.fnmatch_lines(["*missing.so*"])
